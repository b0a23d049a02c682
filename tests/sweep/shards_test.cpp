#include <sweep/folder.h>
#include <sweep/plan.h>
#include <sweep/run.h>

#include <tests/error_of.h>
#include <tests/folder.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

namespace {

using namespace palpate::sweep;

// Whatever the numbers: every case is in one part, in order, and no part has two cases more than another.
TEST(Shards, AreAPartitionIntoEvenRuns)
{
    std::mt19937 random(1);
    for (int trial = 0; trial < 200; ++trial) {
        const std::size_t cases = random() % 500, parts = 1 + random() % 60;
        std::vector<std::size_t> all;
        std::size_t least = cases, most = 0;
        for (std::size_t k = 1; k <= parts; ++k) {
            const auto part = casesOfShard(std::to_string(k) + "/" + std::to_string(parts), cases);
            all.insert(all.end(), part.begin(), part.end());
            least = std::min(least, part.size());
            most = std::max(most, part.size());
        }
        ASSERT_EQ(all.size(), cases);
        for (std::size_t i = 0; i < cases; ++i) {
            ASSERT_EQ(all[i], i);
        }
        EXPECT_LE(most - std::min(least, most), 1U);
    }
}

TEST(Shards, ATextOfCasesGivesTheCasesAgain)
{
    std::mt19937 random(2);
    for (int trial = 0; trial < 200; ++trial) {
        std::vector<std::size_t> cases;
        for (std::size_t i = 0; i < 60; ++i) {
            if (random() % 3 != 0) {
                cases.push_back(i);
            }
        }
        EXPECT_EQ(casesOfList(listOfCases(cases), 60), cases);
    }
    EXPECT_EQ(listOfCases({0, 1, 2, 7, 9, 10}), "0-2,7,9-10");
}

// The folder of two cases with records, case 0 of build "one" and case 1 of `build` in two shards.
void makeShards(const std::filesystem::path& folder, const std::string& build)
{
    std::ofstream(folder / "p.toml") << "scene = \"block\"\nrecords = true\noutputs = [\"seconds\"]\n"
                                        "[[axis]]\nkey = \"dffb.gain\"\nvalues = [0.1, 0.5]\n";
    for (const std::size_t i : {0U, 1U}) {
        const SweepFolder shard(folder / "s/shards" / std::to_string(i), folder / "p.toml", true);
        SweepRow row;
        row.index = i;
        row.outputs = {1.0};
        row.build = i == 0 ? "one" : build;
        row.machine = "here";
        shard.write(row);
        std::ofstream(shard.record(i)) << "record of case " << i;
    }
}

TEST(Shards, AreMergedWithTheirRecords)
{
    const palpate::tests::Folder home;
    makeShards(home.path(), "one");
    EXPECT_EQ(mergeShards(home / "s", {}), 2U);
    EXPECT_TRUE(SweepFolder(home / "s", "", false).has(1));
    EXPECT_TRUE(std::filesystem::exists(home / "s/records/0.db"));
    EXPECT_TRUE(std::filesystem::exists(home / "s/records/1.db"));
    EXPECT_EQ(mergeShards(home / "s", {}), 0U);
}

// Two plans in one folder would be refused at the merge, after hours.
TEST(Shards, OfAnotherPlanAreRefusedBeforeTheyBegin)
{
    const palpate::tests::Folder home;
    makeShards(home.path(), "one");
    const auto refusal = [&](const std::string& text) {
        return palpate::tests::errorOf([&] { checkPlanOfParts(home / "s", text, "q.toml"); });
    };
    EXPECT_EQ(refusal(planText(home / "p.toml").first), "");
    EXPECT_NE(refusal("scene = \"block\"\n").find("holds another plan than q.toml: choose another folder"),
              std::string::npos);
}

// Shards that were begun only: there would be a table without rows, and a folder that says it is this sweep.
TEST(Shards, WithoutACaseAreNotMerged)
{
    const palpate::tests::Folder home;
    makeShards(home.path(), "one");
    for (const char* const shard : {"0", "1"})
        std::filesystem::remove_all(home / "s/shards" / shard / "cases");
    const std::string error = palpate::tests::errorOf([&] { mergeShards(home / "s", {}); });
    EXPECT_NE(error.find("no case of its 2 shards is done"), std::string::npos) << error;
    EXPECT_FALSE(std::filesystem::exists(home / "s/plan.toml"));
}

// A record that cannot be copied: its row does not come either, so that merging again brings both.
TEST(Shards, ARowComesAfterItsRecord)
{
    const palpate::tests::Folder home;
    makeShards(home.path(), "one");
    const auto record = home / "s/shards/1/records/1.db";
    std::filesystem::remove(record);
    std::filesystem::create_directories(record / "no file");
    EXPECT_ANY_THROW(mergeShards(home / "s", {}));
    EXPECT_FALSE(SweepFolder(home / "s", "", false).has(1));
    std::filesystem::remove_all(record);
    std::ofstream(record) << "record";
    EXPECT_EQ(mergeShards(home / "s", {}), 1U);
    EXPECT_TRUE(std::filesystem::exists(home / "s/records/1.db"));
}

TEST(Shards, OfDifferentBuildsAreMergedOnRequestOnly)
{
    const palpate::tests::Folder home;
    makeShards(home.path(), "two");
    const std::string error = palpate::tests::errorOf([&] { mergeShards(home / "s", {}); });
    EXPECT_NE(error.find("different builds, one and two"), std::string::npos) << error;
    EXPECT_FALSE(SweepFolder(home / "s", "", false).has(0));
    EXPECT_EQ(mergeShards(home / "s", {}, true), 2U);
}

// Point i has value i of every axis.
TEST(SweepPlan, AListHasItsRowsAsPoints)
{
    const SweepPlan plan = parsePlan(
        "scene = \"block\"\nrepeats = 2\n[design]\nkind = \"list\"\n"
        "[[axis]]\nkey = \"dffb.gain\"\nvalues = [0.1, 0.5, 0.1]\n"
        "[[axis]]\nkey = \"model.setting\"\nvalues = [\"fast\", \"fine\", \"fine\"]\n",
        "list.toml", namedScene);
    ASSERT_EQ(plan.cases(), 6U);
    const std::vector<std::pair<double, std::string>> rows{{0.1, "fast"}, {0.5, "fine"}, {0.1, "fine"}};
    for (std::size_t i = 0; i < plan.cases(); ++i) {
        const SweepCase c = sweepCase(plan, i);
        EXPECT_EQ(c.scene.dffb.gain, rows[i / 2].first);
        EXPECT_EQ(c.scene.model.setting, rows[i / 2].second);
    }
}

TEST(SweepPlan, AListNeedsAValueForEachPoint)
{
    const std::string list = "scene = \"block\"\n[design]\nkind = \"list\"\n", gain = "[[axis]]\nkey = \"dffb.gain\"\n";
    const auto errorOf = [](const std::string& text) {
        return palpate::tests::errorOf([&] { parsePlan(text, "list.toml", namedScene); });
    };
    EXPECT_NE(errorOf(list + gain + "values = [0, 1]\n[[axis]]\nkey = \"dffb.range_mm\"\nvalues = [5]\n")
                  .find("in a list every axis has one for each point"),
              std::string::npos);
    EXPECT_NE(errorOf(list + gain + "range = [0, 1]\n").find("in a list every axis"), std::string::npos);
    EXPECT_NE(errorOf(list + "samples = 4\n" + gain + "values = [0, 1]\n").find("a list has none"), std::string::npos);
}

}  // namespace
