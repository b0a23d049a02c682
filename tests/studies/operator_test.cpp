#include <chainmail/window.h>
#include <studies/kernel/bench_operator.h>
#include <studies/kernel/machine_rates_sets.h>
#include <studies/kernel/plain_operator.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string_view>
#include <vector>

namespace palpate::studies {
namespace {

using chainmail::Floats;
using chainmail::Layout;

// The baseline does what the operator does, on cells of random stiffness.
TEST(PlainOperator, AgreesWithTheKernel)
{
    if (__builtin_cpu_supports("avx2") == 0) {
        GTEST_SKIP() << "needs AVX2";
    }
    const Layout l = Layout::of(9, 7, 5);
    std::mt19937 random(1);
    std::uniform_real_distribution<float> value(0.5F, 2.0F);
    Floats mu(l.count + Layout::lanes, 0.0F), lambda = mu, u(l.fieldSize(), 0.0F), plain = u, kernel = u;
    volume::forEachIndex(Index3(0), Index3(8, 6, 4), [&](Index3 n) {
        const std::size_t at = l.at(n.x, n.y, n.z);
        if (n.x < 8 && n.y < 6 && n.z < 4) {
            mu[at] = value(random);
            lambda[at] = 10.0F * value(random);
        }
        for (std::size_t c = 0; c < 3; ++c) {
            u[c * l.count + at] = value(random) - 1.0F;
        }
    });
    Floats scratch(std::max(l.scratchSize(), plainScratch(l)), 0.0F);
    plainApply(l, {mu.data(), lambda.data()}, u.data(), plain.data(), scratch.data());
    chainmail::kernels().apply(l, {mu.data(), lambda.data()}, u.data(), kernel.data(), scratch.data());
    double most = 0.0;
    volume::forEachIndex(Index3(0), Index3(8, 6, 4), [&](Index3 n) {
        for (std::size_t c = 0; c < 3; ++c) {
            const std::size_t at = c * l.count + l.at(n.x, n.y, n.z);
            EXPECT_NEAR(plain[at], kernel[at], 2e-3F);
            most = std::max(most, std::abs(static_cast<double>(kernel[at])));
        }
    });
    EXPECT_GT(most, 100.0);
}

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
