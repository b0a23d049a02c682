#include <tests/apps/program.h>

#include <gtest/gtest.h>

#include <set>

namespace palpate::apps {
namespace {

// Every event without graphics for every number of objects, a line for each, and the thesis's beside it.
TEST(BenchTasks, MeasuresEveryEventAndFitsLines)
{
    const Folder folder;
    const auto out = folder / "out";
    const auto json = figures({"bench", "tasks", "--no-view", "--model", "spring", "--objects", "25,200,600", "--frames",
                               "1", "-o", out.string()});
    std::set<std::pair<std::string, int>> seen;
    for (const auto& e : json["events"]) {
        seen.emplace(e["event"], e["objects"]);
        EXPECT_GT(e["process_us"], 0.0);
    }
    EXPECT_EQ(seen.size(), 7U * 3U);
    ASSERT_EQ(json["fits"].size(), 7U);
    for (const auto& f : json["fits"]) {
        EXPECT_EQ(f["points"], 3);
        EXPECT_GE(f["slope_error"], 0.0);
        EXPECT_GE(f["intercept_error"], 0.0);
    }
    EXPECT_EQ(json["graphics"], "left out: --no-view");
    EXPECT_TRUE(json["timing_model"].is_null()) << "it needs events with graphics";
    EXPECT_NEAR(json["thesis"]["fits"][0]["slope_us_per_object"], 1.009, 1e-9);
    EXPECT_EQ(json["loop"]["fits"].size(), 4U);
    for (const char* file : {"tasks.json", "tasks.html", "tasks.png"}) {
        EXPECT_TRUE(std::filesystem::exists(out / file)) << file;
    }
}

TEST(BenchTasks, RefusesWhatItCannotMeasure)
{
    expectRefusal({"bench", "tasks", "--objects", "25,600,25"}, "three different numbers");
    expectRefusal({"bench", "tasks", "--objects", "25,600,1000000", "--voxels", "399"}, "need 400");
}

TEST(BenchScale, RefusesAMemoryThatHoldsNoScene)
{
    expectRefusal({"bench", "scale", "--memory-gb", "0"}, "memory-gb");
}

}  // namespace
}  // namespace palpate::apps
