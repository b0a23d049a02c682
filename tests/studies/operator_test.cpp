#include <chainmail/window.h>
#include <studies/kernel/bench_operator.h>
#include <studies/kernel/plain_operator.h>

#include <gtest/gtest.h>

#include <cmath>
#include <random>

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
    EXPECT_DOUBLE_EQ(leastTime({10, 0, 0}, rates), 5.0);
    EXPECT_DOUBLE_EQ(leastTime({0, 12, 0}, rates), 3.0);
    EXPECT_DOUBLE_EQ(leastTime({6, 12, 0}, rates), 4.5);
    EXPECT_DOUBLE_EQ(leastTime({1, 1, 80}, rates), 10.0);
}

// More lanes do more; no loop is optimised away (a core does not add 100 vectors per nanosecond).
TEST(MachineRates, GrowWithTheWidthAndAreNoFancy)
{
    double before = 0.0;
    for (const chainmail::Kernels* k : chainmail::supportedKernels()) {
        const MachineRates rates = machineRates(k->name);
        EXPECT_GT(rates.additions, before) << k->name;
        EXPECT_LT(rates.additions, 40e9 * k->width) << k->name;
        EXPECT_GT(rates.multiplications, 0.0);
        EXPECT_LT(rates.both, rates.additions + rates.multiplications + 1.0);
        EXPECT_GT(rates.bytes, 1e9);
        before = 0.8 * rates.additions;
    }
    EXPECT_THROW(machineRates("abacus"), std::runtime_error);
}

TEST(BenchOperator, NoOperatorIsFasterThanItsBound)
{
    const OperatorBench bench = benchOperator({15});
    ASSERT_FALSE(bench.cases.empty());
    for (const OperatorCase& c : bench.cases) {
        EXPECT_GT(c.boundFraction(), 0.0) << c.set;
        EXPECT_LT(c.boundFraction(), 1.0) << c.set;
    }
    EXPECT_EQ(&caseOf(bench, bench.sets.back().name, true, 15), &bench.cases.back());
}

}  // namespace
}  // namespace palpate::studies
