// The screens as they are laid out, without a display: ImGui needs none until somebody looks.
#include <base/words.h>
#include <trainer/example.h>
#include <trainer/look.h>
#include <trainer/screens.h>
#include <trainer/widgets.h>

#include <gtest/gtest.h>

#include <imgui.h>
#include <imgui_internal.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <tuple>
#include <vector>

namespace palpate::trainer {
namespace {

// Size of texts in per cent, in a window of so many pixels.
struct Look {
    int scale;
    float width, height;
};

class Screens : public testing::TestWithParam<std::tuple<std::string, Look>> {
protected:
    Screens() : width(std::get<1>(GetParam()).width), height(std::get<1>(GetParam()).height)
    {
        ImGui::CreateContext();
        ImGui::GetIO().IniFilename = nullptr;
        ImGui::GetIO().DisplaySize = {width, height};
        base::useLanguage(std::get<0>(GetParam()));
        setLook(0.01F * static_cast<float>(std::get<1>(GetParam()).scale));
        unsigned char* pixels = nullptr;
        int wide = 0, high = 0;
        ImGui::GetIO().Fonts->GetTexDataAsRGBA32(&pixels, &wide, &high);
    }
    ~Screens() override
    {
        base::useLanguage("en");
        ImGui::DestroyContext();
    }

    void draw(State& state, bool entered = true) const
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
                width, height, entered && i == 0);
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

    const float width, height;
};

// WCAG 2, the contrast of two colours.
double contrast(const ImVec4& a, const ImVec4& b)
{
    const auto light = [](const ImVec4& c) {
        const auto linear = [](double v) { return v <= 0.03928 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4); };
        return 0.2126 * linear(c.x) + 0.7152 * linear(c.y) + 0.0722 * linear(c.z);
    };
    return (std::max(light(a), light(b)) + 0.05) / (std::min(light(a), light(b)) + 0.05);
}

TEST(Look, WordsOnBarsCanBeRead)
{
    ImGui::CreateContext();
    setLook(1);
    const ImVec4* const colours = ImGui::GetStyle().Colors;
    for (const ImGuiCol behind : {ImGuiCol_PlotHistogram, ImGuiCol_FrameBg, ImGuiCol_Button, ImGuiCol_Header})
        EXPECT_GE(contrast(colours[ImGuiCol_Text], colours[behind]), 4.5) << behind;
    ImGui::DestroyContext();
}

struct Names : testing::Test {
    Names()
    {
        ImGui::CreateContext();
        setLook(1);
        unsigned char* pixels = nullptr;
        int wide = 0, high = 0;
        ImGui::GetIO().Fonts->GetTexDataAsRGBA32(&pixels, &wide, &high);
    }
    ~Names() override { ImGui::DestroyContext(); }

    // Else ImGui's own font, which ends with Latin 1.
    static bool hasDejaVu() { return ImGui::GetIO().Fonts->Fonts[0]->FindGlyphNoFallback(0x141) != nullptr; }
};

TEST_F(Names, HaveTheirLetters)
{
    for (const char* name : {"Łukasz Dvořák", "Αθηνά", "Жанна", "Nguyệt", "Անի", "ნინო", "ᐊᓂ"})
        EXPECT_TRUE(!hasDejaVu() || drawable(name) == name) << drawable(name);
}

// ImGui draws from left to right.
TEST_F(Names, InHebrewAndArabicAreTurnedRound)
{
    EXPECT_TRUE(!hasDejaVu() || drawable("Dr. דוד כהן (2)") == "Dr. ןהכ דוד (2)") << drawable("Dr. דוד כהן (2)");
    EXPECT_TRUE(!hasDejaVu() || drawable("سعد") == "دعس");
}

// What the font does not have looks alike: 張偉, 李娜 and a character beyond 16 bits were "??".
TEST_F(Names, WithoutLettersInTheFontAreToldApart)
{
    EXPECT_EQ(drawable("Wei 张伟: 1"), "Wei [U+5F20 U+4F1F]: 1");
    EXPECT_NE(drawable("李娜"), drawable("张伟"));
    EXPECT_EQ(drawable("𠮷"), "[U+20BB7]");
    EXPECT_EQ(drawable("a\xE9"), "a[U+00E9]") << "not UTF-8, as a path may be";
}

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
            EXPECT_TRUE(w->Scroll.y <= 0 || state.screen == Screen::cases) << w->Name << " does not begin at its top";
        }
    }
}

// The field that a long name was typed into begins anew: its hint was drawn as far to the left as the name had rolled.
TEST_P(Screens, TheHintOfANameIsWhole)
{
    State state = listed();
    draw(state);
    ImGuiContext& g = *ImGui::GetCurrentContext();
    const auto go = [&] { draw(state, false); };
    ImGuiID field = 0;
    for (const ImGuiWindow* w : windows()) {
        const ImGuiID here = ImHashStr("##name", 0, w->ID);
        g.NavNextActivateId = here;
        g.NavNextActivateFlags = ImGuiActivateFlags_PreferInput;
        go();
        field = g.ActiveId == here ? here : field;
    }
    if (field == 0) {
        EXPECT_EQ(std::tuple(width, height), std::tuple(320, 320)) << "where it is rolled out of sight";
        return;
    }
    ImGui::GetIO().AddInputCharactersUTF8("somebody with a name that is much too long for the field");
    go();
    ASSERT_FALSE(state.newPerson.empty());
    ASSERT_GT(g.InputTextState.ScrollX, 0);
    ImGui::ClearActiveID();  // as the button does
    state.newPerson.clear();
    go();
    ASSERT_EQ(g.InputTextState.ID, field);
    EXPECT_EQ(g.InputTextState.ScrollX, 0);
}

// A note that was not kept yet stays: Esc leaves its field, and takes nothing back.
TEST_P(Screens, EscInANoteKeepsWhatWasTyped)
{
    auto all = exampleScreens(listed());
    const auto kept = std::ranges::find(all, "instructor, kept", [](const auto& one) { return one.first; });
    ASSERT_NE(kept, all.end());
    State& state = kept->second;
    draw(state);
    ImGuiContext& g = *ImGui::GetCurrentContext();
    ImGuiIO& io = ImGui::GetIO();
    io.KeyMap[ImGuiKey_Escape] = 0;
    ImGuiID field = 0;
    for (const ImGuiWindow* w : windows()) {
        const ImGuiID here = ImHashStr("##note", 0, w->ID);
        g.NavNextActivateId = here;
        g.NavNextActivateFlags = ImGuiActivateFlags_PreferInput;
        draw(state, false);
        field = g.ActiveId == here ? here : field;
    }
    if (field == 0) {
        EXPECT_FALSE(roomForTwo()) << "where it is rolled out of sight";
        return;
    }
    const std::string before = state.instructor.note;
    io.AddInputCharactersUTF8("Good.");
    draw(state, false);
    ASSERT_EQ(state.instructor.note, before + "Good.");
    for (const bool down : {true, false}) {
        io.KeysDown[0] = down;
        draw(state, false);
    }
    EXPECT_EQ(state.instructor.note, before + "Good.");
    EXPECT_NE(g.ActiveId, field) << "Esc leaves the field";
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

// Whoever is about to click must not hit another button because something was said.
TEST_P(Screens, WhatIsSaidMovesNothing)
{
    const auto places = [] {
        std::map<std::string, std::vector<float>> all;
        for (const ImGuiWindow* w : windows()) {
            all[w->Name] = {w->Pos.x, w->Pos.y, w->Size.x, w->Size.y};
            if (!rollsAsOne())  // there what was said adds room at the end
                all[w->Name].insert(all[w->Name].end(), {w->DC.CursorStartPos.y, w->ContentSize.y});
        }
        return all;
    };
    for (auto& [name, state] : exampleScreens(listed())) {
        SCOPED_TRACE(name);
        draw(state);
        const auto before = places();
        state.notice = "That did not work:\npalpate: ada: is not there";
        state.told = "Written to /home/ada/.local/share/palpate/sessions/groups-20261128-225228.html";
        draw(state);
        EXPECT_EQ(places(), before);
        const ImGuiWindow* const said = ImGui::FindWindowByName("notice");
        ASSERT_NE(said, nullptr);
        EXPECT_TRUE(said->WasActive);
        EXPECT_LE(said->Pos.x + said->Size.x, width);
        EXPECT_LE(said->Pos.y + said->Size.y, height);
    }
}

INSTANTIATE_TEST_SUITE_P(At, Screens,
                         testing::Combine(testing::Values("en", "de"),
                                          testing::Values(Look{100, 1280, 720}, Look{150, 1280, 720}, Look{200, 1280, 720},
                                                          Look{125, 320, 320}, Look{125, 420, 700}, Look{100, 700, 320})),
                         [](const auto& test) {
                             const Look& look = std::get<1>(test.param);
                             return std::get<0>(test.param) + std::to_string(look.scale) + "In" +
                                    std::to_string(static_cast<int>(look.width)) + "x" +
                                    std::to_string(static_cast<int>(look.height));
                         });

}  // namespace
}  // namespace palpate::trainer
