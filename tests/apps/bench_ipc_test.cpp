#include <tests/apps/program.h>
#include <tests/installed.h>

#include <gtest/gtest.h>

#include <algorithm>

namespace palpate::apps {
namespace {

using tests::installed;

// What the thesis saw: whoever comes late has all that was sent in the meantime before it. In shared memory there is
// nothing before the newest.
TEST(BenchIpc, ALateViewerGetsTheNewestPositionFromMemoryAndTheOldestFromAPipe)
{
    const auto json = figures({"bench", "ipc", "--seconds", "0.5"});
    for (const char* transport : {"shm_us", "pipe_us"}) {
        const auto& f = json[transport];
        EXPECT_GT(f["p50"], 0.0) << transport;
        EXPECT_LE(f["p50"], f["p99"]) << transport;
        EXPECT_LE(f["p99"], f["max"]) << transport;
        EXPECT_LE(f["first"], f["max"]) << transport;
        EXPECT_GT(f["received"], 100) << transport;
    }
    const double setUp = 0.15e6;  // [us], of 200 ms
    EXPECT_GT(json["pipe_us"]["late_viewer_first"], setUp);
    EXPECT_LT(json["shm_us"]["late_viewer_first"], setUp);
    EXPECT_GT(json["pipe_us"]["late_viewer_stale"], 100);
    EXPECT_LT(json["shm_us"]["late_viewer_stale"], 20);
    EXPECT_LT(json["shm_us"]["p50"], json["pipe_us"]["p50"]);
}

TEST(BenchSync, TellsHowFarApartTwoViewersShowTheSameTick)
{
    if (!built("palpate-view"))
        GTEST_SKIP() << "palpate-view has not been built";
    const auto json = figures({"bench", "sync", "--seconds", "4", "--size", "320x320"});
    const auto &skew = json["skew_ms"], &state = json["state_ms"];
    EXPECT_GE(skew["p50"], 0.0);
    EXPECT_LE(skew["p50"], skew["p99"]);
    EXPECT_LE(skew["p99"], skew["max"]);
    // A viewer shows a tick with the picture in work or the one after it, however long a picture takes.
    const auto& rates = json["frames_per_second"];
    const double longest = 1e3 / std::min(rates[0].get<double>(), rates[1].get<double>());
    EXPECT_LT(skew["p50"], 3.0 * longest) << "pictures of the same session, not of its beginning and its end";
    EXPECT_GE(state["p50"], 0.0);
    EXPECT_GT(json["frames"], 5);
    EXPECT_EQ(json["frame_ms"], 33.0);
}

TEST(BenchView, MeasuresPicturesOfWhatMovesBesideAServoLoop)
{
    if (!built("palpate-view") || !installed("Xvfb"))
        GTEST_SKIP() << "needs palpate-view and Xvfb (package xvfb)";
    const auto json = figures({"bench", "view", "layered", "--voxels", "48", "--layout", "instructor", "--frames", "12",
                               "--width", "320", "--height", "320"});
    ASSERT_EQ(json["cases"].size(), 1U);
    for (const auto& c : json["cases"]) {
        EXPECT_EQ(c["frames"], 12) << c;
        EXPECT_GT(c["frame_ms_p50"], 0.0) << c;
        EXPECT_LE(c["frame_ms_p50"], c["frame_ms_p90"]) << c;
        EXPECT_GT(c["moving_share"], 0.0) << c;
        EXPECT_GE(c["lateness_us_p99"], 0.0) << c;
    }
}

}  // namespace
}  // namespace palpate::apps
