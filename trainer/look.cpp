#include <trainer/look.h>

#include <base/utf8.h>

#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <iterator>
#include <system_error>
#include <utility>
#include <vector>

namespace palpate::trainer {

namespace {

// The package fonts-dejavu-core; without it ImGui's own font, which has no sizes.
constexpr const char* fontFile = "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf";
constexpr float lineHeight = 18;  // [pixels]
// Names of people, in all letters that DejaVu has: Latin, Greek, Cyrillic, Armenian, Hebrew, Arabic, N'Ko, Lao, Georgian,
// Canadian syllables, Tifinagh, Lisu; and signs of texts. ImGui reads it until the end.
constexpr std::array<ImWchar, 27> letters{0x20,   0x52F,  0x531,  0x6FF,  0x7C0,  0x7FF,  0xE81,  0xEDD,  0x10A0,
                                          0x10FF, 0x1401, 0x1676, 0x1E00, 0x1FFE, 0x2010, 0x205E, 0x20A0, 0x20BF,
                                          0x2C60, 0x2D6F, 0xA4D0, 0xA4FF, 0xFB00, 0xFDFF, 0xFE70, 0xFEFC, 0};

bool isRightToLeft(const base::Character& c)
{
    const auto within = [&](char32_t low, char32_t high) { return low <= c.code && c.code <= high; };
    return within(0x590, 0x7FF) || within(0xFB1D, 0xFDFF) || within(0xFE70, 0xFEFC);
}

// Words and what is between them.
void turnRightToLeft(std::vector<base::Character>& all)
{
    const auto neither = [](const base::Character& c) { return c.code != ' ' && !isRightToLeft(c); };
    for (auto from = std::ranges::find_if(all, isRightToLeft); from != all.end();) {
        auto end = std::find_if(from, all.end(), neither);
        const auto next = end;
        while (!isRightToLeft(*std::prev(end))) {
            --end;
        }
        std::reverse(from, end);
        from = std::find_if(next, all.end(), isRightToLeft);
    }
}

void setColours(ImGuiStyle& style)
{
    ImGui::StyleColorsDark(&style);
    const auto set = [&style](ImGuiCol which, float r, float g, float b) { style.Colors[which] = {r, g, b, 1}; };
    set(ImGuiCol_WindowBg, 0.09F, 0.10F, 0.13F);
    set(ImGuiCol_ChildBg, 0.12F, 0.135F, 0.17F);
    set(ImGuiCol_Button, 0.17F, 0.27F, 0.40F);
    set(ImGuiCol_ButtonHovered, 0.22F, 0.36F, 0.53F);
    set(ImGuiCol_ButtonActive, 0.16F, 0.45F, 0.68F);
    set(ImGuiCol_Header, 0.17F, 0.30F, 0.45F);
    set(ImGuiCol_HeaderHovered, 0.19F, 0.25F, 0.34F);
    set(ImGuiCol_HeaderActive, 0.20F, 0.35F, 0.52F);
    set(ImGuiCol_NavHighlight, 0.90F, 0.62F, 0.00F);
    set(ImGuiCol_PlotHistogram, 0.10F, 0.47F, 0.69F);  // white words on it: 4.8 to 1
    set(ImGuiCol_FrameBg, 0.19F, 0.21F, 0.26F);
}

}  // namespace

void setLook(float scale)
{
    ImGuiStyle& style = ImGui::GetStyle();
    style = ImGuiStyle();
    setColours(style);
    style.WindowPadding = {22, 18};
    style.FramePadding = {12, 7};
    style.ItemSpacing = {12, 8};
    style.FrameRounding = style.ChildRounding = 5;
    style.ScaleAllSizes(scale);
    ImGuiIO& io = ImGui::GetIO();
    io.Fonts->Clear();
    std::error_code none;
    if (std::filesystem::exists(fontFile, none)) {
        io.Fonts->AddFontFromFileTTF(fontFile, lineHeight * scale, nullptr, letters.data());
        io.FontGlobalScale = 1;
    } else {
        io.Fonts->AddFontDefault();
        io.FontGlobalScale = 1.3F * scale;
    }
}

std::string drawable(const std::string& text)
{
    if (std::ranges::all_of(text, [](char c) { return static_cast<unsigned char>(c) < 0x80; })) {
        return text;
    }
    const ImFont& font = *ImGui::GetIO().Fonts->Fonts[0];
    std::vector<base::Character> all = base::charactersOf(text);
    turnRightToLeft(all);
    std::string out;
    bool codes = false;
    for (const base::Character& c : all) {
        const bool whole = c.bytes.size() > 1 || c.code < 0x80;
        const bool drawn = c.code < 0x20 ||
                           (whole && c.code <= 0xFFFF && font.FindGlyphNoFallback(static_cast<ImWchar>(c.code)) != nullptr);
        if (drawn) {
            out += std::exchange(codes, false) ? "]" : "";
            out += c.bytes;
        } else {
            out += fmt::format("{}U+{:04X}", std::exchange(codes, true) ? " " : "[", static_cast<unsigned>(c.code));
        }
    }
    return out + (codes ? "]" : "");
}

}  // namespace palpate::trainer
