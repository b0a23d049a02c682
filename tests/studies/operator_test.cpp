#include <chainmail/kernels.h>
#include <studies/kernel/bench_operator.h>
#include <studies/kernel/machine_rates.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <vector>

namespace palpate::studies {
namespace {

// A machine that adds 2, multiplies 4, does 3 of both and moves 8 bytes per second.
TEST(LeastTime, IsTheSlowestOfArithmeticAndMemory)
{
    const MachineRates rates{2, 4, 3, 8};
    EXPECT_DOUBLE_EQ(minTime({10, 0, 0}, rates), 5.0);
    EXPECT_DOUBLE_EQ(minTime({0, 12, 0}, rates), 3.0);
    EXPECT_DOUBLE_EQ(minTime({6, 12, 0}, rates), 4.5);
    EXPECT_DOUBLE_EQ(minTime({1, 1, 80}, rates), 10.0);
}

// Twice the rounds are twice the operations, twice the lanes twice as many each round. Nothing of time but a bound that no
// core reaches: a loop that was optimised away would.
TEST(MachineRates, CountWhatTheLoopsDo)
{
    for (const RateLoops* loops : {&ratesV2, &ratesAvx2, &ratesAvx512}) {
        const auto sets = chainmail::supportedKernels();
        const auto found =
            std::ranges::find_if(sets, [&](const auto* k) { return std::string_view(k->name) == loops->name; });
        if (found == sets.end())
            continue;
        const auto lanes = static_cast<double>((*found)->width);
        EXPECT_DOUBLE_EQ(loops->add(20), 2 * loops->add(10));
        EXPECT_DOUBLE_EQ(loops->add(10) / lanes, ratesV2.add(10) / 4) << loops->name;
        EXPECT_DOUBLE_EQ(loops->multiply(10) / lanes, ratesV2.multiply(10) / 4) << loops->name;
        const std::vector<float> from(256, 1.0F);
        std::vector<float> to(256, 0.0F);
        EXPECT_DOUBLE_EQ(loops->copy(from.data(), to.data(), 256), 2.0 * 256 * sizeof(float));
        EXPECT_EQ(from, to);
        const MachineRates rates = machineRates(loops->name);
        EXPECT_GT(rates.additions, 0.0);
        EXPECT_LT(rates.additions, 40e9 * lanes) << loops->name;
        EXPECT_LT(rates.both, 80e9 * lanes) << loops->name;
    }
    EXPECT_THROW(machineRates("abacus"), std::runtime_error);
}

// How much of its bound an operator reaches is for the benchmark to say: a neighbour may slow down the one or the other.
TEST(BenchOperator, EveryOperatorHasItsCostAndItsBound)
{
    const OperatorBench bench = benchOperator({15});
    ASSERT_FALSE(bench.cases.empty());
    for (const OperatorCase& c : bench.cases) {
        EXPECT_GT(c.boundFraction(), 0.0) << c.set;
        EXPECT_TRUE(std::isfinite(c.boundFraction())) << c.set;
    }
    EXPECT_EQ(&caseOf(bench, bench.sets.back().name, true, 15), &bench.cases.back());
}

}  // namespace
}  // namespace palpate::studies
