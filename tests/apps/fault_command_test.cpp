#include <tests/apps/program.h>

#include <haptics/recorder.h>
#include <haptics/stabiliser.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <sstream>

namespace palpate::apps {
namespace {

constexpr double cap = 8.5;  // of the built-in scenes [N]
constexpr double slew = 0.05 * cap;

// A session of the layered phantom with something going wrong in it. In 1.5 to 3 s its needle goes in.
struct Session {
    explicit Session(const std::string& inject, const std::vector<std::string>& more = {"--unpaced"},
                     const std::string& scene = smallLayered())
        : program("palpate", words(scene, inject, more))
    {
    }
    void end()
    {
        outcome = program.wait();
        haptics::Record(file()).each([&](const haptics::TickRecord& r) { ticks.push_back(r); });
    }

    std::vector<std::string> words(const std::string& scene, const std::string& inject,
                                   const std::vector<std::string>& more) const
    {
        std::vector<std::string> all{"train", scene,    "--headless", "--seconds", "3.5", "--record",
                                     file(),  "--json", json(),       "--inject",  inject};
        all.insert(all.end(), more.begin(), more.end());
        return all;
    }

    std::string file() const { return folder / "session.db"; }
    std::string json() const { return folder / "session.json"; }
    nlohmann::json figures() const { return nlohmann::json::parse(readText(json())); }
    bool replays() const { return apps::figures({"replay", file()}).at("identical"); }

    Folder folder;
    Program program;
    Outcome outcome;
    std::vector<haptics::TickRecord> ticks;
};

// A force may also fall as fast as a stable spring does on the way that the hand goes along with it; a machine that is late
// makes that way longer. No hand goes as far as a pose jumps.
void expectContinuousForce(const Session& session)
{
    const double stiffest = haptics::stableLimits({}).stiffness;
    constexpr double furthest = 2e-3;  // [m]
    for (std::size_t i = 1; i < session.ticks.size(); ++i) {
        const auto &before = session.ticks[i - 1], &now = session.ticks[i];
        const Vec3 way = now.device.position - before.device.position;
        const bool falls = now.device.fresh && glm::length(way) < furthest && glm::dot(before.total, way) > 0.0 &&
                           glm::length(now.total) < glm::length(before.total);
        const double step = glm::distance(now.total, before.total);
        ASSERT_LE(step, (slew + (falls ? stiffest * glm::length(way) : 0.0)) * (1.0 + 1e-9)) << "tick " << i;
    }
}

// The most that the hand has been given at any moment beyond what it has put in, each force held to the next pose [J].
double energyMade(const Session& session)
{
    double given = 0.0, most = 0.0;
    for (std::size_t i = 1; i < session.ticks.size(); ++i) {
        const Vec3 way = session.ticks[i].device.position - session.ticks[i - 1].device.position;
        given += glm::dot(session.ticks[i - 1].total, way);
        most = std::max(most, given);
    }
    return most;
}

double peakForce(const Session& session, std::size_t from, std::size_t to)
{
    double most = 0.0;
    for (std::size_t i = from; i < std::min(to, session.ticks.size()); ++i) {
        most = std::max(most, glm::length(session.ticks[i].total));
    }
    return most;
}

// The loop sleeps while the needle goes in: the tissue that the hand meets afterwards is up to a centimetre further.
void expectNoJumpBehind(Session& session, int gap)
{
    SCOPED_TRACE("a gap of " + std::to_string(gap) + " ms");
    session.end();
    EXPECT_EQ(session.outcome.status, 0) << session.outcome.err;
    const auto figures = session.figures();
    EXPECT_GE(figures.at("longest_gap_ms"), gap - 1);
    EXPECT_GE(figures.at("missed_ticks"), gap - 1);
    EXPECT_GE(figures.at("gaps"), 1);
    const auto stale = std::ranges::count_if(session.ticks.begin() + 2001, session.ticks.end(),
                                             [](const auto& r) { return !r.device.fresh; });
    EXPECT_GE(stale, std::min(gap - 1, 50));
    EXPECT_GT(peakForce(session, 1500, 2000), 0.1) << "nothing was felt: nothing is tested";
    expectContinuousForce(session);
    EXPECT_LE(energyMade(session), 1e-3);
    EXPECT_TRUE(session.replays());
    EXPECT_NE(session.outcome.out.find("missed in"), std::string::npos) << session.outcome.out;
}

TEST(Fault, AGapIsCountedMakesNoForceJumpAndNoEnergy)
{
    Session few("gap=5ms@2s", {}), more("gap=50ms@2s", {}), many("gap=500ms@2s", {});
    expectNoJumpBehind(few, 5);
    expectNoJumpBehind(more, 50);
    expectNoJumpBehind(many, 500);
}

TEST(Fault, LateForcesAreOverrunsAndMakeNoForceJump)
{
    Session session("late=5ms/300ms@2s", {});
    session.end();
    EXPECT_EQ(session.outcome.status, 0) << session.outcome.err;
    const auto figures = session.figures();
    EXPECT_GE(figures.at("overruns"), 300);
    EXPECT_GE(figures.at("missed_ticks"), 5 * 300);
    expectContinuousForce(session);
    EXPECT_TRUE(session.replays());
}

TEST(Fault, APoseThatIsNoNumberEndsTheForceForGood)
{
    Session session("nan@2s");
    session.end();
    EXPECT_EQ(session.outcome.status, 1);
    EXPECT_NE(session.outcome.err.find("was not finite: the force was switched off"), std::string::npos);
    EXPECT_EQ(std::ranges::count(session.outcome.err, '\n'), 1) << session.outcome.err;
    ASSERT_EQ(session.ticks.size(), 3500U);
    EXPECT_GT(peakForce(session, 1500, 2000), 0.3);
    EXPECT_EQ(peakForce(session, 2000, 3500), 0.0);
    EXPECT_FALSE(session.ticks[1999].faulted);
    for (std::size_t i = 2000; i < session.ticks.size(); ++i) {
        ASSERT_TRUE(session.ticks[i].faulted) << i;
    }
    EXPECT_TRUE(haptics::Record(session.file()).complete());
    EXPECT_TRUE(session.replays());
}

TEST(Fault, APoseThatJumpsMakesNoForceJump)
{
    Session session("jump=100mm@2s");
    session.end();
    EXPECT_EQ(session.outcome.status, 0) << session.outcome.err;
    ASSERT_GT(session.ticks.size(), 2020U);
    EXPECT_GT(glm::distance(session.ticks[2000].device.position, session.ticks[1999].device.position), 0.09);
    expectContinuousForce(session);
    EXPECT_TRUE(session.replays());
}

// Fades to zero in 50 ms, is zero until the poses come back, and then rises by the ramp, which lasts half a second.
TEST(Fault, AnUnpluggedDeviceFadesAndComesBackByTheRamp)
{
    Session session("unplug=200ms@2s", {"--unpaced"}, "layered");
    session.end();
    EXPECT_EQ(session.outcome.status, 0) << session.outcome.err;
    EXPECT_GT(peakForce(session, 1990, 2000), 0.3);
    EXPECT_EQ(peakForce(session, 2052, 2200), 0.0);
    EXPECT_GT(peakForce(session, 2300, 3500), 0.1) << "it never came back";
    for (std::size_t i = 2200; i < 2700; ++i) {
        ASSERT_LE(glm::length(session.ticks[i].total), 2e-3 * static_cast<double>(i - 2199) * cap) << i;
    }
    expectContinuousForce(session);
    EXPECT_TRUE(session.replays());
}

TEST(Fault, AFullDiskEndsTheRecordAndNotTheSession)
{
    Session session("disk-full@1500ms", {});
    session.end();
    EXPECT_EQ(session.outcome.status, 1);
    EXPECT_EQ(session.figures().at("ticks"), 3500);
    int lines = 0;
    std::istringstream err(session.outcome.err);
    for (std::string line; std::getline(err, line);) {
        lines += line.find(session.file() + ": recording stopped: ") != std::string::npos ? 1 : 0;
    }
    EXPECT_EQ(lines, 1) << session.outcome.err;
    EXPECT_FALSE(haptics::Record(session.file()).complete());
    // A commit is made every 0.1 s.
    EXPECT_GT(session.ticks.size(), 1000U);
    EXPECT_LT(session.ticks.size(), 3000U);
    EXPECT_TRUE(session.replays());
}

// A viewer that writes down when it runs, once in 10 ms for 2 s.
constexpr const char* diary = "#!/bin/sh\ni=0\nwhile [ $i -lt 200 ]; do date +%s%N; i=$((i + 1)); sleep 0.01; done > ";

double longestPause(const std::string& times)
{
    double longest = 0.0, last = 0.0;
    std::istringstream in(times);
    for (double time = 0.0; in >> time; last = time) {
        longest = last > 0.0 ? std::max(longest, 1e-9 * (time - last)) : 0.0;
    }
    return longest;
}

// The second stall is longer than the session: the viewer goes on when it is over.
TEST(Fault, AStalledViewerCostsNoTicks)
{
    std::array<std::uint64_t, 2> missed{};
    for (const bool stalled : {false, true}) {
        const Folder folder;
        const std::string program = folder / "palpate", viewer = folder / "palpate-view", pictures = folder / "pictures",
                          json = folder / "session.json", times = folder / "times";
        std::filesystem::copy_file(std::filesystem::path(PALPATE_BIN_DIR) / "palpate", program);
        writeText(viewer, diary + times + "\n");
        std::filesystem::permissions(viewer, std::filesystem::perms::owner_all);
        std::filesystem::create_directory(pictures);
        std::vector<std::string> words{"train",  smallLayered(), "--headless", "--seconds", "2",
                                       "--json", json,           "--pictures", pictures};
        if (stalled) {
            words.insert(words.end(), {"--inject", "stall-viewer=600ms@500ms", "--inject", "stall-viewer=9s@1.6s"});
        }
        const Outcome outcome = Program(program, words).wait();
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        const double pause = longestPause(readText(times));
        EXPECT_EQ(pause > 0.5, stalled) << pause << " s";
        missed[stalled ? 1 : 0] = nlohmann::json::parse(readText(json)).at("missed_ticks");
    }
    EXPECT_LT(missed[1], 2 * missed[0] + 500) << "a second of stalls";
}

// What is counted fits: p50 to max in order, and no more gaps than missed ticks. Without a load, which is not ours to
// install.
TEST(Fault, LatenessIsMeasuredWithAndWithoutRealTime)
{
    const Folder folder;
    const std::string scene = folder / "press.toml";
    writeText(scene, readText(smallLayered()) + "[[script]]\nkind = \"press\"\nto_mm = [0, 1, 0]\nseconds = 1.5\n");
    const nlohmann::json load = figures({"bench", "load", scene, "--model", "spring", "--idle", "--runs", "1"});
    ASSERT_EQ(load["cases"].size(), 2U);
    EXPECT_FALSE(load["cases"][0]["asked_for_real_time"].get<bool>());
    EXPECT_TRUE(load["cases"][1]["asked_for_real_time"].get<bool>());
    for (const auto& run : load["cases"]) {
        const auto& late = run["lateness_us"];
        EXPECT_GE(late["p50"], 0.0);
        EXPECT_LE(late["p50"], late["p99"]);
        EXPECT_LE(late["p99"], late["max"]);
        EXPECT_LE(run["gaps"], run["missed_ticks"]);
        EXPECT_TRUE(!run["asked_for_real_time"] || run["sched_fifo"] || !load["warnings"].empty());
    }
}

TEST(Fault, WhatStrikesNothingIsRefused)
{
    const std::vector<std::string> unpaced{"train", "layered", "--unpaced", "--headless", "--inject"};
    const auto refused = [&](const std::string& inject, const std::string& hint) {
        auto words = unpaced;
        words.push_back(inject);
        expectRefusal(words, hint);
    };
    refused("gasp=5ms@1s", "gasp=5ms@1s: must be WHAT");
    refused("gap=5ms@1s", "leave out --unpaced");
    refused("late@1s", "leave out --unpaced");
    refused("stall-viewer@1s", "add --view or --pictures");
    refused("disk-full@1s", "add --record");
}

}  // namespace
}  // namespace palpate::apps
