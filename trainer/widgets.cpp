#include <trainer/widgets.h>

#include <base/words.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

namespace palpate::trainer {

using base::tr;

void words(const std::string& text)
{
    ImGui::PushTextWrapPos(0);
    ImGui::TextUnformatted(text.c_str());
    ImGui::PopTextWrapPos();
}

void words(const std::string& text, Rgb colour)
{
    ImGui::PushStyleColor(ImGuiCol_Text, vec(colour));
    words(text);
    ImGui::PopStyleColor();
}

void heading(const std::string& text, float scale)
{
    ImGui::SetWindowFontScale(scale);
    words(text);
    ImGui::SetWindowFontScale(1);
}

void drawPicture(const Texture& texture, float wide, float high)
{
    if (texture.id == 0) {
        ImGui::Dummy({wide, high});
        return;
    }
    const float scale = std::min(wide / static_cast<float>(texture.width), high / static_cast<float>(texture.height));
    ImGui::Image(reinterpret_cast<ImTextureID>(static_cast<std::uintptr_t>(texture.id)),
                 {scale * static_cast<float>(texture.width), scale * static_cast<float>(texture.height)});
}

bool enterPressed()
{
    return ImGui::IsKeyPressed(ImGui::GetIO().KeyMap[ImGuiKey_Enter], false);
}

void besideIfRoom(const std::string& label)
{
    const ImGuiStyle& style = ImGui::GetStyle();
    const float wide = ImGui::CalcTextSize(label.c_str()).x + 2 * style.FramePadding.x + style.ItemSpacing.x;
    ImGui::SameLine();
    if (ImGui::GetContentRegionAvail().x < wide) {
        ImGui::NewLine();
    }
}

std::string shortened(const std::string& text, float wide)
{
    std::string out = text;
    for (std::size_t end = text.size(); end > 0 && ImGui::CalcTextSize(out.c_str()).x > wide;) {
        // To where a character begins, in UTF-8.
        do {
            --end;
        } while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U);
        out = text.substr(0, end) + "...";
    }
    return out;
}

bool roomForTwo()
{
    return ImGui::GetIO().DisplaySize.x > 52 * ImGui::GetFontSize();
}

Errand drawSettings(State& state)
{
    const std::string title = std::string(tr("Settings")) + "###settings";
    if (ImGui::Button(tr("Settings"))) {
        ImGui::OpenPopup(title.c_str());
    }
    ImGui::SetNextWindowPos(ImGui::GetMainViewport()->GetCenter(), ImGuiCond_Always, {0.5F, 0.5F});
    if (!ImGui::BeginPopupModal(title.c_str(), nullptr, ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoMove)) {
        return Errand::none;
    }
    Settings& s = state.settings;
    bool changed = false;
    const auto choice = [&changed](const char* label, std::string& value, const char* key) {
        if (ImGui::RadioButton(label, value == key)) {
            value = key;
            changed = true;
        }
    };
    ImGui::TextUnformatted(tr("Language"));
    // A language is called in itself.
    if (s.language.empty()) {
        s.language = base::language() == "de" ? "de" : "en";
    }
    choice("English", s.language, "en");
    ImGui::SameLine();
    choice("Deutsch", s.language, "de");
    ImGui::TextUnformatted(tr("Colours of tissues"));
    choice(tr("as in the body"), s.palette, "standard");
    ImGui::SameLine();
    choice(tr("safe for colour blindness, with patterns in slices"), s.palette, "colour-blind");
    changed = ImGui::Checkbox(tr("Sounds for warnings"), &s.sounds) || changed;
    ImGui::TextUnformatted(tr("Size of texts"));
    for (const auto& [label, scale] : {std::pair{"100 %", 1.0}, {"125 %", 1.25}, {"150 %", 1.5}, {"200 %", 2.0}}) {
        if (ImGui::RadioButton(label, s.textScale == scale)) {
            s.textScale = scale;
            changed = true;
        }
        ImGui::SameLine();
    }
    ImGui::NewLine();
    if (ImGui::Button(tr("Close")) || ImGui::IsKeyPressed(ImGui::GetIO().KeyMap[ImGuiKey_Escape], false)) {
        ImGui::CloseCurrentPopup();
    }
    ImGui::EndPopup();
    return changed ? Errand::keepSettings : Errand::none;
}

}  // namespace palpate::trainer
