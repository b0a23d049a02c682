#include <trainer/look.h>

#include <imgui.h>

#include <array>
#include <filesystem>
#include <system_error>

namespace palpate::trainer {

namespace {

// The package fonts-dejavu-core; without it ImGui's own font, which has no sizes.
constexpr const char* fontFile = "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf";
constexpr float lineHeight = 18;  // [pixels]
// Names of people: Latin of all of Europe and Vietnam, Greek, Cyrillic; and signs of texts. ImGui reads it until the end.
constexpr std::array<ImWchar, 13> letters{0x20,   0x24F,  0x370,  0x3FF,  0x400,  0x52F, 0x1E00,
                                          0x1EFF, 0x2010, 0x205E, 0x20A0, 0x20BF, 0};

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

}  // namespace palpate::trainer
