#include <studies/kernel/kernel_work.h>

#include <studies/kernel/bench_operator.h>

#include <gtest/gtest.h>

#include <cstring>
#include <random>
#include <string_view>
#include <vector>

namespace palpate::studies {
namespace {

using chainmail::Kernels;
using chainmail::Layout;

const KernelWork* of(const std::vector<KernelWork>& work, std::string_view operation)
{
    for (const KernelWork& w : work) {
        if (w.operation == operation) {
            return &w;
        }
    }
    return nullptr;
}

std::vector<float> random(std::size_t n)
{
    std::mt19937 bits(7);
    std::uniform_real_distribution<float> value(-1, 1);
    std::vector<float> out(n);
    for (float& v : out) {
        v = value(bits);
    }
    return out;
}

// An operator on 9 x 5 x 7 nodes is 16 x 5 x 7 slots of eight floats, and its arithmetic that of the formulas.
TEST(KernelWork, CountsSlotsBytesAndArithmetic)
{
    const Layout l = Layout::of(9, 5, 7);
    const CountedKernels counting;
    const auto mu = random(l.count + Layout::lanes), u = random(l.fieldSize());
    std::vector<float> out(l.fieldSize()), plain = out, scratch(l.scratchSize());
    counting.kernels().apply(l, {mu.data(), mu.data()}, u.data(), out.data(), scratch.data());
    counting.kernels().apply(l, {mu.data(), mu.data()}, u.data(), out.data(), scratch.data());
    counting.kernels().combine(u.data(), 2.0F, out.data(), out.data(), 3 * l.count);
    const auto work = counting.work(2.0);
    ASSERT_EQ(work.size(), 2U);
    const KernelWork *apply = of(work, "apply"), *combine = of(work, "combine");
    ASSERT_TRUE(apply != nullptr && combine != nullptr);
    const double slots = 16 * 5 * 7;
    EXPECT_EQ(apply->calls, 1.0);
    EXPECT_EQ(apply->nodes, slots);
    EXPECT_EQ(apply->bytes, 32 * slots);
    EXPECT_EQ(apply->additions, slots * operatorCost(false).additions);
    EXPECT_EQ(apply->multiplications, slots * operatorCost(false).multiplications);
    EXPECT_EQ(combine->calls, 0.5);
    EXPECT_EQ(combine->bytes, 0.5 * 3 * 3 * 4 * slots);
    // The same bits as without counting.
    chainmail::kernels().apply(l, {mu.data(), mu.data()}, u.data(), plain.data(), scratch.data());
    chainmail::kernels().combine(u.data(), 2.0F, plain.data(), plain.data(), 3 * l.count);
    EXPECT_EQ(std::memcmp(plain.data(), out.data(), 3 * l.count * sizeof(float)), 0);
    // A new count begins at nothing.
    EXPECT_TRUE(CountedKernels().work(1.0).empty());
}

// Rates of one thing per second: the slowest of an operator's parts, added up over operations.
TEST(KernelWork, ItsBoundIsTheSumOfTheOperations)
{
    const MachineRates rates{.additions = 10, .multiplications = 10, .both = 20, .bytes = 100};
    const std::vector<KernelWork> work{{.operation = "apply", .additions = 40, .multiplications = 10, .bytes = 100},
                                       {.operation = "combine", .bytes = 300}};
    EXPECT_DOUBLE_EQ(minTime(work, rates), 4.0 + 3.0);
}

}  // namespace
}  // namespace palpate::studies
