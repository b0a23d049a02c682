// The screens as they are laid out, without a display: ImGui needs none until somebody looks.
#include <base/words.h>
#include <trainer/example.h>
#include <trainer/look.h>
#include <trainer/screens.h>

#include <gtest/gtest.h>

#include <imgui.h>
#include <imgui_internal.h>

#include <string>
#include <tuple>
#include <vector>

namespace palpate::trainer {
namespace {

constexpr float width = 1280, height = 720;

class Screens : public testing::TestWithParam<std::tuple<std::string, int>> {
protected:
    Screens()
    {
        ImGui::CreateContext();
        ImGui::GetIO().IniFilename = nullptr;
        ImGui::GetIO().DisplaySize = {width, height};
        base::useLanguage(std::get<0>(GetParam()));
        setLook(0.01F * static_cast<float>(std::get<1>(GetParam())));
        unsigned char* pixels = nullptr;
        int wide = 0, high = 0;
        ImGui::GetIO().Fonts->GetTexDataAsRGBA32(&pixels, &wide, &high);
    }
    ~Screens() override
    {
        base::useLanguage("en");
        ImGui::DestroyContext();
    }

    static void draw(State& state)
    {
        constexpr int untilAllHasItsPlace = 4;
        for (int i = 0; i < untilAllHasItsPlace; ++i) {
            ImGui::GetIO().DeltaTime = 0.02F;
            ImGui::NewFrame();
            drawScreen(
                state,
                [](const std::string&) {
                    return Texture{1, 640, 480};
                },
                width, height, i == 0);
            ImGui::Render();
        }
    }
    // Those of the last picture.
    static std::vector<ImGuiWindow*> windows()
    {
        std::vector<ImGuiWindow*> shown;
        for (ImGuiWindow* const w : ImGui::GetCurrentContext()->Windows)
            // Fields of several lines roll within themselves.
            if (w->WasActive && !w->Hidden && std::string(w->Name).starts_with("Palpate") &&
                std::string(w->Name).find("##note") == std::string::npos)
                shown.push_back(w);
        return shown;
    }

    static State listed()
    {
        State state;
        for (int i = 0; i < 16; ++i) {
            CaseEntry c;
            c.id = "case-" + std::to_string(i);
            c.title = "Core biopsy between two vessels under ultrasound";
            c.picture = "picture.png";
            c.trains = "a needle between an artery and a vein, with both seen in the picture of the ultrasound probe";
            c.steps = {"Touch the skin at the mark.", "Push until the skin gives way, and stop at the rim of the lesion."};
            c.best = 97;
            state.cases.push_back(c);
        }
        return state;
    }
};

// Nothing lies over the window's side; what is too long has a bar to roll it by.
TEST_P(Screens, NothingIsCutOff)
{
    for (auto& [name, state] : exampleScreens(listed())) {
        SCOPED_TRACE(name);
        draw(state);
        ASSERT_FALSE(windows().empty());
        for (const ImGuiWindow* w : windows()) {
            EXPECT_LE(w->WindowPadding.x + w->ContentSize.x, w->InnerRect.GetWidth() + 1) << w->Name;
            const bool rolls = (w->Flags & ImGuiWindowFlags_NoScrollbar) == 0;
            EXPECT_TRUE(rolls || w->WindowPadding.y + w->ContentSize.y <= w->InnerRect.GetHeight() + 1)
                << w->Name << ": " << w->ContentSize.y;
        }
    }
}

// A part that rolls shows enough of itself to be read: a heading and four lines.
TEST_P(Screens, WhatRollsIsNoSlit)
{
    for (auto& [name, state] : exampleScreens(listed())) {
        SCOPED_TRACE(name);
        draw(state);
        for (const ImGuiWindow* w : windows()) {
            const bool part = (w->Flags & ImGuiWindowFlags_ChildWindow) != 0;
            EXPECT_TRUE(!part || w->InnerRect.GetHeight() >= 6 * ImGui::GetIO().Fonts->Fonts[0]->FontSize)
                << w->Name << ": " << w->InnerRect.GetHeight();
        }
    }
}

// Language, and size of texts in per cent.
INSTANTIATE_TEST_SUITE_P(At, Screens, testing::Combine(testing::Values("en", "de"), testing::Values(100, 150, 200)),
                         [](const auto& test) {
                             return std::get<0>(test.param) + std::to_string(std::get<1>(test.param));
                         });

}  // namespace
}  // namespace palpate::trainer
