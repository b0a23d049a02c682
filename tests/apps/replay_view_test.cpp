#include <base/png.h>
#include <tests/apps/desktop.h>
#include <tests/apps/sweep_plan.h>

#include <gtest/gtest.h>

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

namespace palpate::apps {
namespace {

namespace fs = std::filesystem;

bool canDraw()
{
    return built("palpate-view") && installed("Xvfb");
}

std::vector<fs::path> pictures(const fs::path& folder)
{
    std::vector<fs::path> found;
    for (const auto& entry : fs::directory_iterator(folder))
        found.push_back(entry.path().filename());
    return found;
}

// The session's own pictures depend on the clock; those of its record are one per asked time, with every event.
TEST(ReplayView, WritesAPictureOfEveryAskedTimeAndEveryEvent)
{
    if (!canDraw())
        GTEST_SKIP() << "needs palpate-view and Xvfb (package xvfb)";
    const Folder folder;
    const auto session = figures({"train", smallLayered(), "--unpaced", "--no-view", "--record", folder / "s.db"});
    Program view("palpate-view", {"--replay", folder / "s.db", "--offscreen", folder / "pictures", "--every", "1", "--size",
                                  "400x320", "--json", "-"});
    const Outcome outcome = view.wait();
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const double length = 1e-3 * (session["ticks"].get<double>() - 1);
    const auto frames = static_cast<std::size_t>(length) + 1;
    std::size_t counted = 0, fired = 0, inserted = 0;
    for (const auto& name : pictures(folder / "pictures")) {
        counted += name.string().starts_with("frame_") ? 1 : 0;
        fired += name.string().ends_with("_fired.png") ? 1 : 0;
        inserted += name.string().ends_with("_inserted.png") ? 1 : 0;
    }
    EXPECT_EQ(base::textInPng(readText(folder / "pictures/frame_00002.png"), base::pngTimeKeyword), "2.000");
    EXPECT_EQ(counted, frames);
    EXPECT_EQ(fired, 1U);
    EXPECT_EQ(inserted, 1U);
}

// Without a clock the pictures are drawn of the record afterwards: of one for them alone, which is gone then, or of the one
// that was asked for.
TEST(ReplayView, AnUnpacedSessionHasPicturesOfItsEvents)
{
    if (!canDraw())
        GTEST_SKIP() << "needs palpate-view and Xvfb (package xvfb)";
    const Folder folder;
    for (const bool recorded : {false, true}) {
        const fs::path to = folder / (recorded ? "second" : "first");
        std::vector<std::string> command = {"train",     smallLayered(), "--setting",  "fast",
                                            "--unpaced", "--no-view",    "--pictures", to};
        if (recorded)
            command.insert(command.end(), {"--record", folder / "s.db"});
        const Outcome outcome = palpate(command);
        ASSERT_EQ(outcome.status, 0) << outcome.err;
        std::size_t fired = 0;
        for (const auto& name : pictures(to))
            fired += name.string().ends_with("_fired.png") ? 1 : 0;
        EXPECT_EQ(fired, 1U);
        EXPECT_EQ(outcome.out.find("record: ") != std::string::npos, recorded) << outcome.out;
        EXPECT_EQ(fs::exists(folder / "s.db"), recorded);
    }
}

// While the viewer makes its body, the session writes on: what is shown are the ticks that there were when it was opened.
TEST(ReplayView, ARecordThatIsStillWrittenIsShownAsFarAsItWas)
{
    if (!canDraw())
        GTEST_SKIP() << "needs palpate-view and Xvfb (package xvfb)";
    const Folder folder;
    const std::string scene = folder / "wait.toml";
    writeText(scene, readText(smallLayered()) + "[[script]]\nkind = \"wait\"\nseconds = 60\n");
    Program session("palpate", {"train", scene, "--model", "spring", "--headless", "--no-view", "--seconds", "60",
                                "--record", folder / "s.db"});
    for (int i = 0; i < 600 && palpate({"score", folder / "s.db"}).status != 0; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
    ASSERT_TRUE(session.running());
    std::this_thread::sleep_for(std::chrono::seconds(2));  // what is written first may be one tick
    const Outcome outcome = Program("palpate-view", {"--replay", folder / "s.db", "--offscreen", folder / "pictures",
                                                     "--frames", "2", "--size", "320x320"})
                                .wait();
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(pictures(folder / "pictures").size(), 2U);
    EXPECT_TRUE(session.running()) << "it ended before the viewer did: nothing was tested";
    session.send(SIGINT);
    EXPECT_EQ(session.wait().status, 130);
}

TEST(ReplayView, RefusesWhatIsNotInTheRecordAndOtherFilms)
{
    if (!canDraw())
        GTEST_SKIP() << "needs palpate-view and Xvfb (package xvfb)";
    const Folder folder;
    const auto refusal = [&](std::vector<std::string> more) {
        more.insert(more.begin(), {"--replay", threeSeconds(), "--offscreen", folder / "p", "--size", "320x320"});
        const Outcome outcome = Program("palpate-view", more).wait();
        EXPECT_EQ(outcome.status, 1);
        return outcome.err;
    };
    EXPECT_NE(refusal({"--at", "100"}).find("--at 100s: the record runs from 0 s to 2.999 s"), std::string::npos);
    EXPECT_NE(refusal({"--movie", folder / "film.txt"}).find("film.txt: a film is an .mp4 file"), std::string::npos);
    const std::string hidden = refusal({"--hide", "nosuch"});
    EXPECT_NE(hidden.find("--hide nosuch: there is no such tissue; the body has: skin, fat"), std::string::npos) << hidden;
    EXPECT_FALSE(fs::exists(folder / "film.txt"));
}

// There is nothing between two ticks: every tick is one picture, and then it ends.
TEST(ReplayView, WritesEveryTickOnceWhereNoTimeBetweenPicturesIsAskedFor)
{
    if (!canDraw())
        GTEST_SKIP() << "needs palpate-view and Xvfb (package xvfb)";
    const Folder folder;
    const auto session =
        figures({"train", smallLayered(), "--unpaced", "--no-view", "--seconds", "0.01", "--record", folder / "s.db"});
    const Outcome outcome = Program("palpate-view", {"--replay", folder / "s.db", "--offscreen", folder / "pictures",
                                                     "--every", "0", "--size", "320x320"})
                                .wait();
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(pictures(folder / "pictures").size(), session["ticks"].get<std::size_t>());
}

TEST(ReplayView, WritesAFilmOrSaysThatFfmpegIsMissing)
{
    if (!canDraw())
        GTEST_SKIP() << "needs palpate-view and Xvfb (package xvfb)";
    const Folder folder;
    figures({"train", smallLayered(), "--unpaced", "--no-view", "--seconds", "1", "--record", folder / "s.db"});
    const std::vector<std::string> film{"--replay", folder / "s.db", "--movie", folder / "s.mp4", "--size", "321x320"};
    const Outcome made = Program("palpate-view", film).wait();
    if (!installed("ffmpeg")) {
        EXPECT_EQ(made.status, 1);
        EXPECT_NE(made.err.find("install the package ffmpeg"), std::string::npos) << made.err;
        GTEST_SKIP() << "needs ffmpeg (package ffmpeg)";
    }
    ASSERT_EQ(made.status, 0) << made.err;
    EXPECT_FALSE(fs::exists(folder / "s.mp4.part"));
    const Outcome told = Program("/usr/bin/env", {"ffprobe", "-v", "error", "-show_entries", "stream=nb_frames,width",
                                                  "-of", "csv=p=0", folder / "s.mp4"})
                             .wait();
    EXPECT_EQ(told.out, "322,30\n") << "a second, 30 pictures; the codec wants an even width";
}

std::vector<std::uint64_t> ticksIn(const fs::path& timeline)
{
    std::ifstream file(timeline);
    std::vector<std::uint64_t> ticks;
    std::string line;
    std::getline(file, line);
    while (std::getline(file, line))
        ticks.push_back(std::stoull(line));
    return ticks;
}

// Each key has its picture within a second: alone on the machine.
TEST(ReplayKeys, GoThroughTheRecordInBothDirections)
{
    if (!canDraw() || !installed("xdotool"))
        GTEST_SKIP() << "needs palpate-view, Xvfb and xdotool (packages xvfb and xdotool)";
    const Folder folder;
    const Desktop desktop;
    const auto view = desktop.start("palpate-view", {"--replay", threeSeconds(), "--layout", "instructor", "--size",
                                                     "400x320", "--timeline", folder / "t.csv"});
    ASSERT_FALSE(desktop.window("Palpate").empty());
    const auto key = [&](const char* name) {
        desktop.xdotool({"key", name});
        std::this_thread::sleep_for(std::chrono::milliseconds(1000));
    };
    for (const char* name : {"space", "End", "Home", "period", "period", "comma", "shift+period", "Right", "Left", "q"})
        key(name);
    const Outcome outcome = view->wait();
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const auto ticks = ticksIn(folder / "t.csv");
    const std::vector<std::uint64_t> asked{2999, 0, 1, 2, 1, 34, 1034, 34};
    ASSERT_GE(ticks.size(), asked.size());
    EXPECT_EQ(std::vector<std::uint64_t>(ticks.end() - static_cast<std::ptrdiff_t>(asked.size()), ticks.end()), asked);
}

TEST(ReplayView, SaysThatARecordHasLostItsBeginning)
{
    if (!canDraw() || !installed("sqlite3"))
        GTEST_SKIP() << "needs palpate-view, Xvfb and sqlite3 (packages xvfb and sqlite3)";
    const Folder folder;
    fs::copy_file(threeSeconds(), folder / "s.db");
    const Outcome cut = Program("/usr/bin/env", {"sqlite3", folder / "s.db", "DELETE FROM ticks WHERE tick < 10;"}).wait();
    ASSERT_EQ(cut.status, 0) << cut.err;
    const Outcome window = Program("palpate-view", {"--replay", folder / "s.db", "--hidden"}).wait();
    EXPECT_EQ(window.status, 1);
    EXPECT_NE(window.err.find("tick 0 is missing"), std::string::npos) << window.err;
}

// An expert's record is made at another setting than a session that keeps the clock on a slow machine.
TEST(ReplayView, AGhostMayBeOfAnotherSettingButNotOfAnotherBody)
{
    if (!canDraw())
        GTEST_SKIP() << "needs palpate-view and Xvfb (package xvfb)";
    const Folder folder;
    const auto record = [&](const std::string& name, const std::vector<std::string>& what) {
        std::vector<std::string> words{"train", "--unpaced", "--no-view", "--seconds", "0.05", "--record", folder / name};
        words.insert(words.end(), what.begin(), what.end());
        figures(words);
    };
    record("fast.db", {smallLayered(), "--model", "elastic", "--setting", "fast"});
    record("default.db", {smallLayered(), "--model", "elastic", "--setting", "default"});
    record("other.db", {"block", "--model", "spring"});
    const auto beside = [&](const std::string& ghost) {
        return Program("palpate-view", {"--replay", folder / "fast.db", "--ghost", folder / ghost, "--offscreen",
                                        folder / "pictures", "--size", "320x320", "--frames", "1"})
            .wait();
    };
    const Outcome same = beside("default.db");
    EXPECT_EQ(same.status, 0) << same.err;
    const Outcome other = beside("other.db");
    EXPECT_EQ(other.status, 1);
    EXPECT_NE(other.err.find("is a session in another body than"), std::string::npos) << other.err;
}

// Ctrl-C in a terminal reaches all that has been started there: the display without a screen is not among it.
TEST(ReplayView, PicturesThatASignalHasEndedAreSaidToBe)
{
    if (!canDraw())
        GTEST_SKIP() << "needs palpate-view and Xvfb (package xvfb)";
    const Folder folder;
    Program view("/usr/bin/setsid", {PALPATE_BIN_DIR "/palpate-view", "--replay", threeSeconds(), "--offscreen",
                                     folder / "pictures", "--every", "0", "--size", "320x320"});
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (!fs::exists(folder / "pictures/frame_00001.png") && std::chrono::steady_clock::now() < end)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    ASSERT_EQ(::kill(-view.pid(), SIGINT), 0);
    const Outcome outcome = view.wait();
    EXPECT_EQ(outcome.status, 130);
    EXPECT_EQ(outcome.err, "palpate-view: interrupted: the pictures end before the record does\n");
}

// Of a record and of a session that runs: the film that is kept is shorter than either.
TEST(ReplayView, AFilmThatASignalHasEndedIsSaidToBe)
{
    if (!canDraw() || !installed("ffmpeg"))
        GTEST_SKIP() << "needs palpate-view, Xvfb and ffmpeg (packages xvfb and ffmpeg)";
    const Folder folder;
    const std::string film = folder / "s.mp4", session = "film-" + std::to_string(::getpid());
    Program running("palpate", {"train", smallLayered(), "--setting", "fast", "--no-view", "--device", "mouse", "--session",
                                session, "--seconds", "120", "--anyway"});
    const auto interrupted = [&](const std::vector<std::string>& what) {
        std::vector<std::string> words{"--movie", film, "--size", "320x320"};
        words.insert(words.end(), what.begin(), what.end());
        Program view("palpate-view", words);
        const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
        while (!fs::exists(film + ".part") && std::chrono::steady_clock::now() < end)
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
        std::this_thread::sleep_for(std::chrono::milliseconds(500));
        view.send(SIGINT);
        return view.wait();
    };
    const Outcome record = interrupted({"--replay", threeSeconds()});
    EXPECT_EQ(record.status, 130);
    EXPECT_EQ(record.err, "palpate-view: interrupted: " + film + " ends before the record does\n");
    const Outcome live = interrupted({"--session", session});
    EXPECT_EQ(live.status, 0);
    EXPECT_EQ(live.err, "palpate-view: interrupted: " + film + " ends before the session does\n");
    EXPECT_TRUE(fs::exists(film));
}

// The viewer has the record open and could go on.
TEST(ReplayView, OfARecordThatIsErasedMeanwhileNoFilmIsKept)
{
    if (!canDraw() || !installed("ffmpeg"))
        GTEST_SKIP() << "needs palpate-view, Xvfb and ffmpeg (packages xvfb and ffmpeg)";
    const Folder folder;
    const std::string record = folder / "s.db", film = folder / "s.mp4";
    fs::copy_file(threeSeconds(), record);
    Program view("palpate-view", {"--replay", record, "--movie", film, "--size", "320x320"});
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (!fs::exists(film + ".part") && std::chrono::steady_clock::now() < end)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    fs::remove(record);
    const Outcome outcome = view.wait();
    EXPECT_EQ(outcome.status, 1);
    EXPECT_EQ(outcome.err,
              "palpate-view: " + record + ": is no longer there, it was erased or moved: no film of it is kept\n");
    EXPECT_FALSE(fs::exists(film));
    EXPECT_FALSE(fs::exists(film + ".part"));
}

// Ended before its first picture: ffmpeg has made a file of 262 bytes, which nothing plays.
TEST(ReplayView, AFilmWithoutPicturesIsNoFile)
{
    if (!canDraw() || !installed("ffmpeg"))
        GTEST_SKIP() << "needs palpate-view, Xvfb and ffmpeg (packages xvfb and ffmpeg)";
    const Folder folder;
    const std::string film = folder / "s.mp4";
    Program view("palpate-view", {"--session", "film-" + std::to_string(::getpid()) + "-none", "--movie", film, "--size",
                                  "320x320", "--wait", "60"});
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    const auto filming = [&] {
        return std::ranges::any_of(childrenOf(view.pid()), [](int child) {
            return readText("/proc/" + std::to_string(child) + "/comm") == "ffmpeg\n";
        });
    };
    while (!filming() && std::chrono::steady_clock::now() < end)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    view.send(SIGINT);
    const Outcome outcome = view.wait();
    EXPECT_EQ(outcome.status, 130);
    EXPECT_EQ(outcome.err, "palpate-view: interrupted: " + film + ": there is no film: no picture had been drawn\n");
    EXPECT_FALSE(fs::exists(film));
    EXPECT_FALSE(fs::exists(film + ".part"));
}

TEST(ReplayView, RefusesWhatCannotBePlayed)
{
    if (!canDraw())
        GTEST_SKIP() << "needs palpate-view and Xvfb (package xvfb)";
    const Folder folder;
    const Outcome missing = Program("palpate-view", {"--replay", folder / "none.db", "--hidden"}).wait();
    EXPECT_EQ(missing.status, 1);
    EXPECT_NE(missing.err.find("none.db"), std::string::npos) << missing.err;
}

}  // namespace
}  // namespace palpate::apps
