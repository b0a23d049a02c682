#include <haptics/stabiliser.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <cmath>
#include <limits>
#include <random>

namespace palpate::haptics {
namespace {

constexpr double dt = 1e-3;
constexpr double cap = 8.5;

DeviceSample held()
{
    DeviceSample s;
    s.buttons = buttonDeadMan;
    return s;
}

// Whatever is asked for: never over the cap, never a larger step than both channels' slew, and the sum is the sum.
TEST(Stabiliser, RandomForcesStayUnderCapAndSlew)
{
    std::mt19937 random(11);
    std::normal_distribution<double> size(0.0, 20.0);
    StabiliserState state;
    Vec3 before(0.0);
    for (int i = 0; i < 20000; ++i) {
        const auto pick = [&] { return Vec3(size(random), size(random), size(random)); };
        const auto sent = stabilise(pick(), pick(), held(), cap, dt, state);
        const Vec3 total = sent.basic + sent.additional;
        ASSERT_LE(glm::length(total), cap * (1 + 1e-12));
        ASSERT_LE(glm::length(total - before), 2 * 0.05 * cap + dt / 0.5 * cap + 1e-9);
        before = total;
    }
}

// A force far over the cap leaves nothing behind: when it ends, the hand is free within the slew from the cap to zero.
TEST(Stabiliser, OverloadDoesNotWindUp)
{
    StabiliserState state;
    for (int i = 0; i < 2000; ++i) {
        stabilise(Vec3(0, 1000, 0), Vec3(30, 0, 0), held(), cap, dt, state);
    }
    SentForce sent;
    for (int i = 0; i < 20; ++i) {
        sent = stabilise(Vec3(0.0), Vec3(0.0), held(), cap, dt, state);
    }
    EXPECT_LT(glm::length(sent.basic + sent.additional), 1e-12);
}

// Below the limits, and once the ramp is up, the force passes unchanged.
TEST(Stabiliser, SteadyForcePassesUnchanged)
{
    StabiliserState state;
    SentForce sent;
    for (int i = 0; i < 1000; ++i) {
        sent = stabilise(Vec3(1.5, -2.0, 0.25), Vec3(0.5, 0, 0), held(), cap, dt, state);
    }
    EXPECT_EQ(sent.basic, Vec3(1.5, -2.0, 0.25));
    EXPECT_EQ(sent.additional, Vec3(0.5, 0, 0));
}

TEST(Stabiliser, LiftedDeadManSwitchZeroesTheForceAtOnce)
{
    StabiliserState state;
    for (int i = 0; i < 1000; ++i) {
        stabilise(Vec3(5, 0, 0), Vec3(0.0), held(), cap, dt, state);
    }
    const auto sent = stabilise(Vec3(5, 0, 0), Vec3(0.0), DeviceSample{}, cap, dt, state);
    EXPECT_EQ(sent.basic, Vec3(0.0));
}

TEST(Stabiliser, StalePosesFadeTheForceInFiftyMilliseconds)
{
    StabiliserState state;
    for (int i = 0; i < 1000; ++i) {
        stabilise(Vec3(5, 0, 0), Vec3(0.0), held(), cap, dt, state);
    }
    auto stale = held();
    stale.fresh = false;
    SentForce sent;
    double before = 5.0;
    for (int i = 0; i < 51; ++i) {
        sent = stabilise(Vec3(5, 0, 0), Vec3(0.0), stale, cap, dt, state);
        EXPECT_LE(sent.basic.x, before);
        EXPECT_GT(sent.basic.x, before - 0.2);
        before = sent.basic.x;
    }
    EXPECT_NEAR(sent.basic.x, 0.0, 1e-9);
}

TEST(Stabiliser, NonFiniteForceIsNeverSentAndLatches)
{
    for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
        StabiliserState state;
        stabilise(Vec3(1, 0, 0), Vec3(0.0), held(), cap, dt, state);
        EXPECT_TRUE(stabilise(Vec3(0, bad, 0), Vec3(0.0), held(), cap, dt, state).faulted);
        const auto later = stabilise(Vec3(1, 0, 0), Vec3(0.0), held(), cap, dt, state);
        EXPECT_TRUE(later.faulted);
        EXPECT_EQ(later.basic + later.additional, Vec3(0.0));
    }
}

}  // namespace
}  // namespace palpate::haptics
