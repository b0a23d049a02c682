#include <tests/apps/desktop.h>

#include <base/png.h>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <chrono>
#include <string>
#include <thread>

namespace palpate::apps {
namespace {

// A scripted trainee's scans and their dose are in the score, and a record gives the scan of any moment, the same twice.
TEST(Ct, ATraineeScansAndTheRecordGivesTheScansAgain)
{
    const Folder folder;
    const std::string record = folder / "c.db";
    const auto played = figures({"train", "ct-core-biopsy", "--trainee", "expert", "--model", "spring", "--unpaced",
                                 "--no-view", "--seed", "2", "--record", record});
    const auto& score = played.at("score");
    EXPECT_GE(score.at("ct_scans").get<int>(), 4);
    EXPECT_NEAR(score.at("ct_dose_mgy_cm").get<double>(), 7.5 * score.at("ct_scans").get<double>(), 1e-6);
    EXPECT_TRUE(score.at("probe_s").is_null());
    const auto make = [&](const std::string& name, const std::string& at, const std::string& window) {
        const Outcome outcome = palpate({"export", "--record", record, "--at", at, "--what", "ct", "--window", window,
                                         "--height", "200", "-o", folder / name});
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return readText(folder / name);
    };
    const std::string first = make("a.png", "2s", "soft-tissue");
    EXPECT_NE(base::textInPng(first, "palpate-ct").find("\"tick\":2000"), std::string::npos);
    EXPECT_EQ(make("b.png", "2s", "soft-tissue"), first);
    EXPECT_NE(make("c.png", "2s", "lung"), first);
    EXPECT_NE(make("d.png", "0.1s", "soft-tissue"), first);
    EXPECT_EQ(palpate({"replay", record}).status, 0);
    expectRefusal({"export", "--record", record, "--at", "2s", "--what", "ct", "-o", folder / "e.nrrd"},
                  "are written as .png");
    figures(
        {"train", "layered", "--model", "spring", "--unpaced", "--no-view", "--seconds", "1", "--record", folder / "s.db"});
    expectRefusal({"export", "--record", folder / "s.db", "--at", "0.5s", "--what", "ct", "-o", folder / "f.png"},
                  "its scene has no CT");
}

// P in the window of who holds the tool is a scan: the session counts it, and the score has its dose.
TEST(Ct, AKeyOfTheWindowTakesAScan)
{
    if (!built("palpate-view") || !installed("Xvfb") || !installed("xdotool"))
        GTEST_SKIP() << "needs palpate-view, Xvfb and xdotool";
    const Folder folder;
    const std::string json = folder / "figures.json";
    const Desktop desktop;
    const auto session = desktop.start(
        "palpate", {"train", "ct-core-biopsy", "--model", "spring", "--device", "mouse", "--close-at-end", "--json", json});
    const std::string window = desktop.window("Palpate");
    ASSERT_NE(window, "");
    desktop.xdotool({"windowfocus", window});
    for (int i = 0; i < 3; ++i) {
        std::this_thread::sleep_for(std::chrono::seconds(2));
        desktop.xdotool({"key", "p"});
    }
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(120);
    while (!std::filesystem::exists(json) && std::chrono::steady_clock::now() < end) {
        std::this_thread::sleep_for(std::chrono::seconds(1));
        desktop.xdotool({"key", "e"});
    }
    const auto score = nlohmann::json::parse(readText(json)).at("score");
    // The first key may come before the window takes keys.
    EXPECT_GE(score.at("ct_scans").get<int>(), 2);
    EXPECT_LE(score.at("ct_scans").get<int>(), 3);
}

}  // namespace
}  // namespace palpate::apps
