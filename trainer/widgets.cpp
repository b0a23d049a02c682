#include <trainer/widgets.h>

#include <base/utf8.h>
#include <base/words.h>

#include <imgui_internal.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

namespace palpate::trainer {

using base::tr;

void words(const std::string& text)
{
    ImGui::PushTextWrapPos(0);
    ImGui::TextUnformatted(drawable(text).c_str());
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
    ImGui::Image(
        reinterpret_cast<ImTextureID>(static_cast<std::uintptr_t>(texture.id)),
        {std::floor(scale * static_cast<float>(texture.width)), std::floor(scale * static_cast<float>(texture.height))});
}

bool enterPressed()
{
    return ImGui::IsKeyPressed(ImGui::GetIO().KeyMap[ImGuiKey_Enter], false);
}

void besideIfRoom(const std::string& label)
{
    const ImGuiStyle& style = ImGui::GetStyle();
    const float wide = ImGui::CalcTextSize(label.c_str()).x + 2 * style.FramePadding.x + style.ItemSpacing.x;
    const float from = ImGui::GetCurrentWindow()->DC.CursorPosPrevLine.x + style.ItemSpacing.x;
    if (ImGui::GetCursorScreenPos().x + ImGui::GetContentRegionAvail().x - from >= wide) {
        ImGui::SameLine();
    }
}

bool buttonBeside(const std::string& label)
{
    besideIfRoom(label);
    return ImGui::Button(fitted(label).c_str());
}

std::string shortened(const std::string& text, float wide)
{
    std::string out = text;
    for (std::size_t end = text.size(); end > 0 && ImGui::CalcTextSize(out.c_str()).x > wide;) {
        do {
            --end;
        } while (end > 0 && !base::beginsCharacter(text[end]));
        out = text.substr(0, end) + "...";
    }
    return out;
}

bool roomForTwo()
{
    return ImGui::GetIO().DisplaySize.x > 52 * ImGui::GetFontSize();
}

bool rollsAsOne()
{
    constexpr float narrow = 26, low = 18;  // in fonts
    const ImVec2 size = ImGui::GetIO().DisplaySize;
    return size.x < narrow * ImGui::GetFontSize() || (!roomForTwo() && size.y < low * ImGui::GetFontSize());
}

void beginPart(const char* name, float wide, float high)
{
    ImGui::PushID(name);
    rollsAsOne() ? ImGui::BeginGroup() : void(ImGui::BeginChild(name, {wide, high}, false, ImGuiWindowFlags_NavFlattened));
}

void endPart()
{
    rollsAsOne() ? ImGui::EndGroup() : ImGui::EndChild();
    ImGui::PopID();
}

std::string withoutKey(const std::string& label)
{
    return label.ends_with(')') ? label.substr(0, label.rfind(" (")) : label;
}

std::string fitted(const std::string& label)
{
    const float room = ImGui::GetContentRegionAvail().x - 2 * ImGui::GetStyle().FramePadding.x;
    return ImGui::CalcTextSize(label.c_str()).x <= room ? label : shortened(withoutKey(label), room);
}

std::string preview(const std::string& chosen)
{
    return shortened(drawable(chosen),
                     ImGui::CalcItemWidth() - ImGui::GetFrameHeight() - 2 * ImGui::GetStyle().FramePadding.x);
}

std::optional<std::size_t> choice(const std::string& name, const std::string& shown, std::size_t count, std::size_t chosen,
                                  const std::function<std::string(std::size_t)>& label)
{
    std::optional<std::size_t> now;
    if (!ImGui::BeginCombo(name.c_str(), preview(shown).c_str())) {
        return now;
    }
    for (std::size_t i = 0; i < count; ++i) {
        ImGui::PushID(static_cast<int>(i));
        now = ImGui::Selectable(drawable(label(i)).c_str(), i == chosen) ? i : now;
        ImGui::PopID();
    }
    ImGui::EndCombo();
    return now;
}

void drawRow(ImVec2 at, const std::string& title, const std::string& facts, Rgb colour)
{
    const ImVec2 next = ImGui::GetCursorPos();
    ImGui::SetCursorPos({at.x + 0.4F * ImGui::GetFontSize(), at.y});
    ImGui::BeginGroup();
    const float wide = ImGui::GetContentRegionAvail().x;
    ImGui::TextUnformatted(shortened(drawable(title), wide).c_str());
    ImGui::TextColored(vec(colour), "%s", shortened(drawable(facts), wide).c_str());
    ImGui::EndGroup();
    ImGui::SetCursorPos(next);
}

bool radio(const std::string& label, bool active)
{
    const float circle = ImGui::GetFrameHeight() + ImGui::GetStyle().ItemInnerSpacing.x;
    if (circle + ImGui::CalcTextSize(label.c_str()).x <= ImGui::GetContentRegionAvail().x) {
        return ImGui::RadioButton(label.c_str(), active);
    }
    const bool pressed = ImGui::RadioButton(("##" + label).c_str(), active);
    ImGui::SameLine(0, ImGui::GetStyle().ItemInnerSpacing.x);
    words(label);
    return pressed || ImGui::IsItemClicked();
}

std::string fieldLabel(const std::string& label, float wide)
{
    if (!rollsAsOne()) {
        ImGui::SetNextItemWidth(wide);
        return label;
    }
    words(label);
    ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x);
    return "##" + label;
}

Errand drawSettings(State& state)
{
    const std::string title = std::string(tr("Settings")) + "###settings";
    if (ImGui::Button(tr("Settings"))) {
        ImGui::OpenPopup(title.c_str());
    }
    ImGui::SetNextWindowPos(ImGui::GetMainViewport()->GetCenter(), ImGuiCond_Always, {0.5F, 0.5F});
    const bool one = rollsAsOne();
    if (one) {
        const ImVec2 all = ImGui::GetIO().DisplaySize;
        ImGui::SetNextWindowSize({0.96F * all.x, 0.96F * all.y});
    }
    const ImGuiWindowFlags fits = one ? ImGuiWindowFlags_NoResize : ImGuiWindowFlags_AlwaysAutoResize;
    if (!ImGui::BeginPopupModal(title.c_str(), nullptr, fits | ImGuiWindowFlags_NoMove)) {
        return Errand::none;
    }
    const auto beside = [one](const char* label) { one ? besideIfRoom(std::string(label) + "     ") : ImGui::SameLine(); };
    Settings& s = state.settings;
    bool changed = false;
    const auto choice = [&changed, one](const char* label, std::string& value, const char* key) {
        if (one ? radio(label, value == key) : ImGui::RadioButton(label, value == key)) {
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
    beside("Deutsch");
    choice("Deutsch", s.language, "de");
    ImGui::TextUnformatted(tr("Colours of tissues"));
    choice(tr("as in the body"), s.palette, "standard");
    one ? void() : besideIfRoom(std::string(tr("safe for colour blindness, with patterns in slices")) + "     ");
    choice(tr("safe for colour blindness, with patterns in slices"), s.palette, "colour-blind");
    changed = ImGui::Checkbox(tr("Sounds for warnings"), &s.sounds) || changed;
    ImGui::TextUnformatted(tr("Size of texts"));
    for (const auto& [label, scale] : {std::pair{"100 %", 1.0}, {"125 %", 1.25}, {"150 %", 1.5}, {"200 %", 2.0}}) {
        if (ImGui::RadioButton(label, s.textScale == scale)) {
            s.textScale = scale;
            changed = true;
        }
        beside("200 %");
    }
    ImGui::NewLine();
    words(tr("In a session they grow with its window."), quiet);
    if (ImGui::Button(tr("Close")) || ImGui::IsKeyPressed(ImGui::GetIO().KeyMap[ImGuiKey_Escape], false)) {
        ImGui::CloseCurrentPopup();
    }
    ImGui::EndPopup();
    return changed ? Errand::keepSettings : Errand::none;
}

}  // namespace palpate::trainer
