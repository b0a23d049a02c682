#include <base/words.h>
#include <tests/error_of.h>
#include <tests/folder.h>
#include <trainer/results.h>

#include <gtest/gtest.h>

#include <cstdint>
#include <fstream>
#include <limits>
#include <string>

namespace palpate::trainer {
using tests::Folder;

namespace {

void write(const std::filesystem::path& file, const std::string& text)
{
    std::ofstream(file) << text;
}

constexpr const char* figures = R"({"score": {"total": 71.5, "points": {"core": 38, "vital": 25, "technique": 8.5},
    "passes": 2, "peak_force_n": 2.04, "targeting_error_mm": null,
    "losses": [{"measure": "best_target_pct", "points": 12, "words": "The core missed", "at_s": 4.2}]}})";

TEST(Results, AreReadAsTheCommandWroteThem)
{
    const Folder folder;
    write(folder / "a.json", figures);
    const Result r = readResult(folder / "a.json");
    EXPECT_EQ(r.problem, "");
    EXPECT_EQ(r.total, 71.5);
    ASSERT_EQ(r.parts.size(), 3U);
    EXPECT_EQ(r.parts[2].points, 8.5);
    ASSERT_EQ(r.losses.size(), 1U);
    EXPECT_EQ(r.losses[0].words, "The core missed");
    ASSERT_EQ(r.measures.size(), 2U) << "what was not measured is not shown";
    EXPECT_EQ(r.measures[1].second, "2.04 N");
}

// Somebody who only looked has no score, and no best one.
TEST(Results, ASessionThatTouchedNothingHasNone)
{
    const Folder folder;
    std::string text = figures;
    write(folder / "near-vessel-20260728-101500.json", text.replace(0, 1, R"({"contacts": 0, )"));
    const Result r = readResult(folder / "near-vessel-20260728-101500.json");
    EXPECT_TRUE(r.untouched);
    EXPECT_NE(r.problem.find("never touched"), std::string::npos) << r.problem;
    CaseEntry entry;
    entry.id = "near-vessel";
    EXPECT_FALSE(SessionFolder(folder / ".").best(entry));
    write(folder / "a.json", std::string(figures).replace(0, 1, R"({"contacts": 1, )"));
    EXPECT_EQ(readResult(folder / "a.json").problem, "");
}

// A case of ultrasound is about the picture, which the general list does not have.
TEST(Results, WhatTheCaseIsAboutAndTheLevelsAreShown)
{
    const Folder folder;
    std::string text = figures;
    const std::string asked = R"({"asked": [
        {"measure": "peak_force_n", "label": "Peak force", "unit": "N", "decimals": 2, "at_most": 2, "met": false},
        {"measure": "ct_scans", "label": "CT scans", "unit": "", "decimals": 0, "at_least": null, "met": null},
        {"measure": "tip_in_beam_pct", "label": "Tip in the picture", "unit": "%", "decimals": 0, "at_least": 60, "met": true}], )";
    text.replace(text.find("\"passes\""), 0, R"("tip_in_beam_pct": 71.2, "ct_scans": 3, )");
    write(folder / "a.json", text.replace(0, 1, asked));
    const Result r = readResult(folder / "a.json");
    ASSERT_EQ(r.measures.size(), 4U) << r.problem;
    EXPECT_EQ(r.measures[1].second, "2.04 N, at most 2: not met");
    EXPECT_EQ(r.measures[2], std::pair(std::string("CT scans"), std::string("3")));
    EXPECT_EQ(r.measures[3].second, "71 %, at least 60: met");
}

// Its score is whole; that it was lost is not to be seen from the points.
TEST(Results, ASessionThatWasNotKeptSaysWhy)
{
    const Folder folder;
    write(folder / "a.json", figures);
    EXPECT_EQ(readResult(folder / "a.json").fault, "") << "of an older program";
    EXPECT_FALSE(readResult(folder / "a.json").notKept);
    write(folder / "a.json",
          std::string(figures).replace(0, 1, R"({"kept": false, "problem": "the record is not whole", )"));
    const Result r = readResult(folder / "a.json");
    EXPECT_EQ(r.problem, "");
    EXPECT_EQ(r.fault, "the record is not whole");
    EXPECT_TRUE(r.notKept);
    State state;
    state.cases.resize(1);
    state.person = "ada";
    sessionEnded(state, r);
    EXPECT_FALSE(state.cases[0].best);
}

// "100 of 100 points" and a loss of one contradict each other; so do no loss and a bar that is not full.
TEST(Results, ALossThatTheTotalDoesNotShowIsToldWhereItIsTheOnlyOne)
{
    const Folder folder;
    for (const auto& [losses, told] :
         {std::pair{"12, \"words\": \"large\"}, {\"points\": 0.4", 1U}, {"0.4", 1U}, {"0.04", 0U}}) {
        std::string text = figures;
        write(folder / "a.json", text.replace(text.find("12, \"words"), 2, losses));
        EXPECT_EQ(readResult(folder / "a.json").losses.size(), told) << losses;
    }
}

TEST(Results, ABrokenFileIsAProblemAndNoCrash)
{
    const Folder folder;
    EXPECT_NE(readResult(folder / "none.json").problem, "");
    for (const char* text :
         {"", "[]", "{", "{\"score\": 3}", "{\"score\": {\"total\": \"x\"}}", "{\"score\": {\"total\": 3}}"}) {
        write(folder / "b.json", text);
        EXPECT_NE(readResult(folder / "b.json").problem, "") << text;
        EXPECT_TRUE(readDevices(folder / "b.json").done) << text;
    }
}

// A session that was killed leaves no figures, and its record is whole.
TEST(Results, ASessionThatWasCutOffNamesItsRecordAndWhatReadsIt)
{
    const Folder folder;
    write(folder / "killed.db", "a record");
    const std::string record = (folder / "killed.db").string(), problem = readResult(folder / "killed.json").problem;
    EXPECT_NE(problem.find("palpate-view --replay " + record), std::string::npos) << problem;
    EXPECT_NE(problem.find("palpate score " + record), std::string::npos) << problem;
    EXPECT_EQ(problem.find(".json"), std::string::npos) << problem;
}

TEST(Results, TheBestOfACaseIsThatOfItsOwnFiles)
{
    const Folder folder;
    SessionFolder sink(folder / "sessions");
    CaseEntry layered, other;
    layered.id = "layered";
    other.id = "layered-2";
    EXPECT_FALSE(sink.best(layered)) << "the folder is not there yet";
    const SessionFiles first = sink.filesFor(layered);
    write(first.figures, figures);
    EXPECT_EQ(sink.best(layered), 71.5);
    EXPECT_FALSE(sink.best(other));
    const SessionFiles second = sink.filesFor(layered);
    EXPECT_NE(second.figures, first.figures) << "in the same second too";
    write(sink.filesFor(other).figures,
          "{\"score\": {\"total\": 99, \"points\": {\"core\": 1, \"vital\": 1, \"technique\": 1}}}");
    EXPECT_EQ(sink.best(layered), 71.5);
    EXPECT_EQ(sink.best(other), 99);
}

TEST(Results, ADiskThatIsNearlyFullIsSaidBeforeTheSession)
{
    const Folder folder;
    EXPECT_EQ(littleRoom(folder / "none"), "") << "nothing is known of it";
    EXPECT_EQ(littleRoom(folder.path(), 0), "");
    const std::string told = littleRoom(folder.path(), std::numeric_limits<std::uintmax_t>::max());
    EXPECT_NE(told.find(folder.path().string() + ": the disk is nearly full ("), std::string::npos) << told;
    EXPECT_EQ(whyNoSessions(folder.path()), "") << "it can be tried";
}

// A file is in the way: that stops root as well.
TEST(Results, AFolderThatCannotBeMadeIsSaidWithTheOptionForAnother)
{
    const Folder folder;
    write(folder / "file", "");
    SessionFolder sink(folder / "file/sessions");
    const std::string english = tests::errorOf([&] { sink.filesFor({}); });
    base::useLanguage("de");
    const std::string german = tests::errorOf([&] { sink.filesFor({}); });
    base::useLanguage("en");
    for (const std::string& said : {english, german}) {
        EXPECT_NE(said.find((folder / "file/sessions").string()), std::string::npos) << said;
        EXPECT_NE(said.find("--sessions"), std::string::npos) << said;
    }
    EXPECT_NE(english, german);
    EXPECT_EQ(whyNoSessions(folder / "new/sessions"), "");
}

TEST(Devices, AreToldWithWhatToDo)
{
    const Folder folder;
    const auto check = [&](const std::string& text) {
        write(folder / "d.json", text);
        return readDevices(folder / "d.json");
    };
    EXPECT_FALSE(check(R"({"falcons": []})").falconReady);
    const DeviceCheck closed = check(R"({"falcons": [{"allowed": false}]})");
    EXPECT_FALSE(closed.falconReady);
    EXPECT_NE(closed.remedy.find("--install-udev"), std::string::npos);
    EXPECT_TRUE(check(R"({"falcons": [{"allowed": true, "firmware_runs": false}]})").falconReady);
    const DeviceCheck busy = check(
        R"({"falcons": [{"allowed": true, "firmware_runs": null, "homed": null, "problem": "another program uses it"}]})");
    EXPECT_TRUE(busy.falconReady);
    EXPECT_EQ(busy.remedy, "another program uses it");
    const DeviceCheck ready = check(R"({"falcons": [{"allowed": true, "firmware_runs": true, "homed": true}]})");
    EXPECT_TRUE(ready.falconReady);
    EXPECT_EQ(ready.remedy, "");
}

// Where no core was asked for, no line says that there is none.
TEST(Results, NameWhatThePointsAreForWhereNoCoreWasAskedFor)
{
    const Folder folder;
    write(folder / "a.json",
          R"({"score": {"total": 100, "judged": "rest", "passes": 0, "best_target_pct": 0, "mark_error_mm": 0.3,
        "rest_s": 3.4, "points": {"core": 50, "vital": 25, "technique": 25}, "losses": []}})");
    const Result r = readResult(folder / "a.json");
    ASSERT_EQ(r.parts.size(), 3U);
    EXPECT_EQ(r.parts[0].name, "Rest on the skin");
    ASSERT_EQ(r.measures.size(), 1U);
    EXPECT_EQ(r.measures[0].second, "3.4 s");

    // Of a palpation, whether the program says what it judged or is older.
    for (const char* const judged : {R"("judged": "marks", )", ""}) {
        write(folder / "b.json", std::string(R"({"score": {"total": 90, )") + judged +
                                     R"("passes": 0, "best_target_pct": 0, "best_target_length_mm": 0, "mark_error_mm": 2.5,
            "points": {"core": 40, "vital": 25, "technique": 25}, "losses": []}})");
        const Result lump = readResult(folder / "b.json");
        EXPECT_EQ(lump.parts.at(0).name, "Place and size");
        ASSERT_EQ(lump.measures.size(), 1U);
        EXPECT_EQ(lump.measures[0].second, "2.5 mm");
    }
}

}  // namespace
}  // namespace palpate::trainer
