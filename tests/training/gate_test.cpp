#include <training/gate.h>

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace palpate::training {
namespace {

Gate gateOf(int pass, int of)
{
    return {.levels = {{.measure = "total", .atLeast = 50, .atMost = {}}}, .pass = pass, .of = of, .testOnly = false};
}

TEST(Gate, WhatIsNotThereMeetsNothing)
{
    const Gate gate{.levels = {{.measure = "passes", .atLeast = 1, .atMost = 3}}, .pass = 1, .of = 1, .testOnly = false};
    EXPECT_TRUE(meets(gate, {{"passes", 3}}));
    EXPECT_FALSE(meets(gate, {{"passes", 4}}));
    EXPECT_FALSE(meets(gate, {{"passes", std::nan("")}}));
    EXPECT_FALSE(meets(gate, {{"total", 3}}));
    // Never near a vital structure: infinitely far is far enough, and no small error.
    EXPECT_TRUE((Level{.measure = "m", .atLeast = 3, .atMost = {}}.met(INFINITY)));
    EXPECT_FALSE((Level{.measure = "m", .atLeast = {}, .atMost = 3}.met(INFINITY)));
}

// Opens in the first session at which `pass` of the last `of` were met, and not before; counted anew here.
TEST(Gate, OpensWithTheFirstWindowThatHasEnough)
{
    std::mt19937 random(1);
    for (int round = 0; round < 500; ++round) {
        const int of = 1 + static_cast<int>(random() % 6), pass = 1 + static_cast<int>(random() % of);
        std::vector<Trial> trials(random() % 20);
        std::vector<int> met;
        int expected = -1;
        for (std::size_t i = 0; i < trials.size(); ++i) {
            const bool good = random() % 2 == 0;
            trials[i].values["total"] = good ? 50 : 49.9;
            met.push_back(good ? 1 : 0);
            int sum = 0;
            for (std::size_t k = met.size() > static_cast<std::size_t>(of) ? met.size() - of : 0; k < met.size(); ++k) {
                sum += met[k];
            }
            expected = expected < 0 && sum >= pass ? static_cast<int>(i) : expected;
        }
        const GateState state = stateOf(gateOf(pass, of), trials);
        EXPECT_EQ(state.openedAt, expected);
        EXPECT_EQ(state.open, expected >= 0);
    }
}

TEST(Gate, OfTestsCountsTestsOnly)
{
    Gate gate = gateOf(2, 2);
    gate.testOnly = true;
    const Values good{{"total", 90}}, bad{{"total", 10}};
    const std::vector<Trial> practised{{good, false}, {good, false}, {good, false}};
    EXPECT_FALSE(stateOf(gate, practised).open);
    // A failed practice between two tests does not part them.
    const std::vector<Trial> tested{{good, true}, {bad, false}, {good, true}};
    EXPECT_EQ(stateOf(gate, tested).openedAt, 2);
}

}  // namespace
}  // namespace palpate::training
