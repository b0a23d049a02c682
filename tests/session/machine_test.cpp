#include <session/machine.h>

#include <datasets/scene.h>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <tests/folder.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <map>
#include <string>
#include <vector>

namespace palpate::session {
namespace {

// Of a machine whose ticks at the settings take these times [ms].
struct Machine {
    std::map<std::string, double> p99;
    std::vector<std::string> asked = {};

    std::string fits()
    {
        return fittingSetting([&](const std::string& setting) {
                   asked.push_back(setting);
                   return TickTime{0.5e-3 * p99.at(setting), 1e-3 * p99.at(setting)};
               })
            .setting;
    }
};

TEST(FittingSetting, IsTheFinestWhoseTicksFit)
{
    EXPECT_EQ((Machine{{{"default", 0.69}}}.fits()), "default");
    EXPECT_EQ((Machine{{{"default", 0.71}}}.fits()), "fast");
    EXPECT_EQ((Machine{{{"default", 20.0}}}.fits()), "fast");
    EXPECT_EQ((Machine{{{"default", 0.2}, {"fine", 0.69}}}.fits()), "fine");
    EXPECT_EQ((Machine{{{"default", 0.2}, {"fine", 0.71}}}.fits()), "default");
}

// Fine takes three times as long and its measurement is for nothing where default leaves no such room.
TEST(FittingSetting, AsksForFineOnlyWhereThereIsRoom)
{
    Machine slow{{{"default", 0.4}}};
    EXPECT_EQ(slow.fits(), "default");
    EXPECT_EQ(slow.asked, std::vector<std::string>{"default"});
}

TEST(FittingSetting, MeasuresPositiveTimes)
{
    const TickTime time = measureSetting("fast");
    EXPECT_GT(time.p50, 0.0);
    EXPECT_GE(time.slow, time.p50);
}

TEST(FittingSetting, IsKeptAndACacheThatIsDamagedIsMeasuredAnew)
{
    const tests::Folder folder;
    const std::filesystem::path cache = folder / "below/machine.json";
    const FittingSetting first = fittingHere(cache);
    const auto names = datasets::elasticSettings();
    EXPECT_NE(std::ranges::find(names, first.setting), names.end());
    ASSERT_TRUE(std::filesystem::exists(cache));
    const FittingSetting again = fittingHere(cache);
    EXPECT_EQ(again.setting, first.setting);
    EXPECT_EQ(again.reason, first.reason) << "it was measured again";
    for (const std::string text : {"", "{", "[1]", R"({"machine": 3})"}) {
        std::ofstream(cache) << text;
        EXPECT_NO_THROW(fittingHere(cache)) << text;
    }
}

// A probe beside the tool asks for more and a needle for less than a ball, and each has its own entry.
TEST(FittingSetting, IsMeasuredWithTheToolsOfTheScene)
{
    const tests::Folder folder;
    const std::filesystem::path cache = folder / "machine.json";
    const std::vector<TissueLoad> loads{{false, false}, {false, true}, {true, false}, {true, true}};
    std::vector<std::string> reasons;
    for (const TissueLoad& load : loads) {
        reasons.push_back(fittingHere(cache, load).reason);
        EXPECT_EQ(reasons.back().find("probe") != std::string::npos, load.probe) << reasons.back();
        EXPECT_EQ(reasons.back().find("needle") != std::string::npos, load.needle) << reasons.back();
    }
    for (std::size_t i = 0; i < loads.size(); ++i) {
        EXPECT_EQ(fittingHere(cache, loads[i]).reason, reasons[i]) << "it was measured again";
        EXPECT_GT(measureSetting("fast", loads[i]).p50, 0.0);
    }
    EXPECT_TRUE(loadOf(*datasets::builtInScene("us-core-biopsy")).needle);
    EXPECT_TRUE(loadOf(*datasets::builtInScene("us-core-biopsy")).probe);
    EXPECT_FALSE(loadOf(*datasets::builtInScene("find-lump")).needle);
    EXPECT_FALSE(loadOf(*datasets::builtInScene("breast")).probe);
}

// A laptop on its battery, a virtual machine with new neighbours.
TEST(FittingSetting, IsMeasuredAnewAfterAnHour)
{
    const tests::Folder folder;
    const std::filesystem::path cache = folder / "machine.json";
    const auto noon = std::chrono::system_clock::time_point(std::chrono::hours(500000));
    fittingHere(cache, {}, noon);
    const auto ask = [&](std::chrono::seconds later) {
        auto text = nlohmann::json::parse(std::ifstream(cache));
        text["tool"]["reason"] = "kept";
        std::ofstream(cache) << text;
        return fittingHere(cache, {}, noon + later).reason == "kept";
    };
    EXPECT_TRUE(ask(std::chrono::seconds(3600)));
    EXPECT_FALSE(ask(std::chrono::seconds(3601)));
    EXPECT_FALSE(ask(std::chrono::seconds(-1))) << "the clock was set back";
}

TEST(FittingSetting, LearnsFromASessionThatWasTooSlow)
{
    const tests::Folder folder;
    const std::filesystem::path cache = folder / "machine.json";
    const auto noon = std::chrono::system_clock::time_point(std::chrono::hours(500000));
    datasets::Scene scene = *datasets::builtInScene("find-lump");
    std::uint64_t ticks = 1000;
    bool paced = true;
    const auto learn = [&](const std::filesystem::path& file, const char* setting, std::uint64_t overruns) {
        scene.model.setting = setting;
        haptics::ServoTiming timing;
        timing.paced = paced;
        timing.ticks = ticks;
        timing.overruns = overruns;
        return learnFrom(file, scene, timing, noon);
    };
    EXPECT_EQ(learn(cache, "default", 5), "") << "bearable";
    EXPECT_FALSE(std::filesystem::exists(cache));
    EXPECT_EQ(learn(cache, "default", 37), "fast");
    const FittingSetting next = fittingHere(cache, loadOf(scene), noon + std::chrono::minutes(5));
    EXPECT_EQ(next.setting, "fast");
    EXPECT_EQ(next.reason, "in the session before, 3.7 % of the ticks of default took over 1 ms");
    EXPECT_EQ(fittingHere(cache, {true, false}, noon).reason.find("session before"), std::string::npos)
        << "nothing is known of needles";
    EXPECT_EQ(learn(cache, "fine", 20), "default");
    EXPECT_EQ(learn(cache, "fast", 500), "") << "nothing is faster";
    paced = false;
    EXPECT_EQ(learn(cache, "default", 500), "") << "nobody felt that it was slow";
    paced = true;
    EXPECT_EQ(learn({}, "default", 500), "") << "there is no cache to write to";
    ticks = 999;
    EXPECT_EQ(learn(cache, "default", 500), "") << "under a second";
    EXPECT_NE(fittingHere(cache, loadOf(scene), noon + std::chrono::hours(2)).reason.find("a tick of"), std::string::npos);
}

TEST(FittingSetting, NeedsNoCache)
{
    EXPECT_FALSE(fittingHere({}).setting.empty());
    EXPECT_FALSE(fittingHere("/proc/none/machine.json").setting.empty());
}

}  // namespace
}  // namespace palpate::session
