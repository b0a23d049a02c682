#include <sweep/case.h>
#include <sweep/plan.h>
#include <sweep/pool.h>

#include <tests/error_of.h>

#include <gtest/gtest.h>

#include <signal.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <string>

namespace palpate::sweep {
namespace {

// A spring, whose ticks take nothing beside the model of the body: with `more` at its end.
SweepPlan springPlan(const std::string& more)
{
    return parsePlan(
        "scene = \"block\"\noutputs = [\"force_n\"]\n"
        "[[axis]]\nkey = \"procedure.depth_mm\"\nvalues = [1, 2]\n"
        "[procedure]\nkind = \"press\"\nspeed_mm_s = 500\nhold_ms = 1\n"
        "[set]\nvolume.voxel_mm = 2\nmodel.level = \"spring\"\n" +
            more,
        "plan.toml", namedScene);
}

double secondsOf(CaseRunner& runner)
{
    const auto begin = std::chrono::steady_clock::now();
    runner.run(0);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

// The session alone is far within the limit, whether its model is new or that of the reference is.
TEST(CaseLimit, TakesInTheModelAndTheReference)
{
    for (const char* const reference : {"", "[reference]\nvolume.voxel_mm = 2.01\n"}) {
        SweepPlan plan = springPlan(reference);
        CaseRunner first(plan, "one");
        const double cold = secondsOf(first);
        const double warm =
            std::min({secondsOf(first), secondsOf(first), secondsOf(first)});  // other processes interrupt some
        ASSERT_LT(warm, cold / 4);
        plan.caseLimit = std::sqrt(cold * warm);
        CaseRunner runner(plan, "one");
        EXPECT_NE(tests::errorOf([&] { runner.run(0); }).find(" s and was aborted (case_limit_s in the plan)"),
                  std::string::npos);
        plan.caseLimit = 3600;
        EXPECT_FALSE(runner.run(0).outputs.empty());
    }
}

// Item 1 stops its process, which then looks at no clock: it is killed and the item lost, once. The others are done.
TEST(CaseLimit, OfAProcessThatStandsStillIsThatOfThePool)
{
    PoolWork work;
    work.start = [] {
        return [](std::size_t item) {
            if (item == 1) {
                raise(SIGSTOP);
            }
        };
    };
    std::map<std::size_t, std::string> lost;
    work.lost = [&](std::size_t item, const std::string& why) { lost[item] += why; };
    work.told = [](std::size_t, std::size_t) { return true; };
    work.abandoned = [] { return false; };
    work.limit = 0.25;
    EXPECT_EQ(runPool(5, 2, work).done, 5U);
    EXPECT_EQ(
        lost,
        (std::map<std::size_t, std::string>{{1, "took over 0.25 s and its process was ended (case_limit_s in the plan)"}}));
}

}  // namespace
}  // namespace palpate::sweep
