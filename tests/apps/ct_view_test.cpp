#include <tests/apps/desktop.h>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <chrono>
#include <string>
#include <thread>

namespace palpate::apps {
namespace {

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
        std::this_thread::sleep_for(std::chrono::milliseconds(1500));
        desktop.xdotool({"key", "p"});
    }
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(120);
    while (!std::filesystem::exists(json) && std::chrono::steady_clock::now() < end) {
        std::this_thread::sleep_for(std::chrono::milliseconds(500));
        desktop.xdotool({"key", "e"});
    }
    const auto score = nlohmann::json::parse(readText(json)).at("score");
    // The first key may come before the window takes keys.
    EXPECT_GE(score.at("ct_scans").get<int>(), 2);
    EXPECT_LE(score.at("ct_scans").get<int>(), 3);
}

}  // namespace
}  // namespace palpate::apps
