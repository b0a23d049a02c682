#include <tests/folder.h>
#include <trainer/settings.h>
#include <trainer/state.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>

namespace palpate::trainer {
namespace {

bool has(const std::vector<std::string>& words, const std::string& word)
{
    return std::ranges::find(words, word) != words.end();
}

TEST(Settings, AreThereAgain)
{
    const tests::Folder folder;
    const auto file = folder.path() / "a" / "trainer.json";
    EXPECT_EQ(writeSettings(file, {"de", "colour-blind", true, 1.5, "Ada"}), "");
    const Settings s = readSettings(file);
    EXPECT_EQ(s.language, "de");
    EXPECT_EQ(s.palette, "colour-blind");
    EXPECT_TRUE(s.sounds);
    EXPECT_EQ(s.textScale, 1.5);
    EXPECT_EQ(s.person, "Ada");
    const auto link = folder.path() / "link.json";
    std::filesystem::create_symlink(file, link);
    EXPECT_EQ(writeSettings(link, {"fr", "standard", false, 1, ""}), "");
    EXPECT_TRUE(std::filesystem::is_symlink(link)) << "of somebody who keeps his settings elsewhere";
    EXPECT_EQ(readSettings(file).language, "fr");
    EXPECT_NE(writeSettings("/proc/none/trainer.json", s), "") << "cannot be written, and says so";
    EXPECT_NE(writeSettings({}, s), "") << "a user without a home";
    EXPECT_FALSE(std::filesystem::exists(".new"));
}

TEST(Settings, WhatIsNotAsItShouldBeIsAsAtFirst)
{
    const tests::Folder folder;
    const auto file = folder.path() / "trainer.json";
    for (const char* text : {"", "[1]", "{\"sounds\": 3, \"text_scale\": 99, \"palette\": \"loud\", \"language\": {}}"}) {
        std::ofstream(file) << text;
        const Settings s = readSettings(file);
        EXPECT_EQ(s.language, "");
        EXPECT_EQ(s.palette, "standard");
        EXPECT_FALSE(s.sounds);
        EXPECT_EQ(s.textScale, 1);
    }
}

TEST(Settings, GoWithTheViewer)
{
    State state;
    CaseEntry c;
    c.id = "layered";
    state.cases.push_back(c);
    EXPECT_FALSE(has(trainArguments(state, {}), "--palette"));
    state.settings.palette = "colour-blind";
    state.settings.sounds = true;
    for (const auto& words : {trainArguments(state, {}), tryoutArguments(state), debriefArguments(state)}) {
        EXPECT_TRUE(has(words, "colour-blind"));
        EXPECT_TRUE(has(words, "--sounds"));
    }
    state.screen = Screen::result;
    EXPECT_EQ(debrief(state, 12.5), Errand::startDebrief);
    EXPECT_TRUE(has(debriefArguments(state), "12.50"));
    EXPECT_TRUE(has(expertArguments(state, "e.db"), "expert"));
}

}  // namespace
}  // namespace palpate::trainer
