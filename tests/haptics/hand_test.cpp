#include <haptics/hand.h>
#include <haptics/simulation.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <cmath>

namespace palpate::haptics {
namespace {

using datasets::TraineeStep;

TraineeStep moveTo(Vec3 to, double seconds = 5)
{
    TraineeStep s;
    s.to = to;
    s.speed = 0.05;
    s.seconds = seconds;
    return s;
}

TEST(Hand, FollowsItsScriptInFreeSpace)
{
    HandDevice hand({}, {moveTo({0.05, 0, 0}), moveTo({0.05, 0.02, 0})}, Vec3(0.0), {0, 1, 0});
    DeviceSample s;
    int ticks = 0;
    for (; !hand.finished() && ticks < 10000; ++ticks) {
        s = hand.read();
        hand.write(Vec3(0.0));
    }
    EXPECT_LT(glm::distance(s.position, Vec3(0.05, 0.02, 0)), 1.5e-3);
    // 70 mm at 50 mm/s, and the grip's lag.
    EXPECT_NEAR(ticks * tickSeconds, 1.4, 0.15);
}

// Under a constant force F the tip settles F / grip away from the hand's goal.
TEST(Hand, GripYieldsByForceOverStiffness)
{
    TraineeStep wait;
    wait.kind = TraineeStep::Kind::wait;
    wait.seconds = 10;
    const HandParameters p;
    HandDevice hand(p, {wait}, Vec3(0.0), {0, 1, 0});
    DeviceSample s;
    for (int i = 0; i < 2000; ++i) {
        s = hand.read();
        hand.write(Vec3(0, -2.0, 0));
    }
    EXPECT_NEAR(s.position.y, -2.0 / p.grip.stiffness, p.device.encoder + p.device.coulomb / p.grip.stiffness);
}

TEST(Hand, PositionsAreWholeEncoderSteps)
{
    const HandParameters p;
    HandDevice hand(p, {moveTo({0.03, 0.01, 0})}, Vec3(0.0), {0, 1, 0});
    for (int i = 0; i < 300; ++i) {
        const auto s = hand.read();
        const double steps = s.position.x / p.device.encoder;
        EXPECT_NEAR(steps, std::round(steps), 1e-6);
    }
}

TraineeStep pierceAlongY()
{
    TraineeStep pierce;
    pierce.kind = TraineeStep::Kind::pierce;
    pierce.to = {0, 0.05, 0};
    pierce.speed = 0.02;
    pierce.seconds = 20;
    return pierce;
}

TEST(Hand, PiercesUntilTheForceDrops)
{
    HandDevice hand({}, {pierceAlongY()}, Vec3(0.0), {0, 1, 0});
    double held = 0.0;
    while (!hand.finished()) {
        const auto s = hand.read();
        // A wall at 5 mm that gives way at 10 mm.
        const double depth = std::max(0.0, s.position.y - 5e-3);
        const bool through = depth > 5e-3 || held < 0.0;
        held = through ? -1.0 : depth;
        hand.write(Vec3(0, through ? -0.1 : -200.0 * depth, 0));
    }
    const auto s = hand.read();
    EXPECT_GT(s.position.y, 10e-3);
    EXPECT_LT(s.position.y, 20e-3);
}

// Missed ticks fade the force, and the hand that only felt took that for tissue that gives way. Seeing that the needle is
// not in, it goes on.
TEST(Hand, SeesThatAForceThatFadesIsNoPuncture)
{
    HandDevice hand({}, {pierceAlongY()}, Vec3(0.0), {0, 1, 0});
    TickRecord seen;
    double last = 0;
    for (int tick = 0; !hand.finished(); ++tick) {
        last = hand.read().position.y;
        hand.write(Vec3(0, tick > 300 && tick < 350 ? 0.0 : -100.0 * last, 0));  // a gap of 50 ms
        seen.phase = last > 12e-3 ? Phase::inserted : Phase::contact;
        hand.observe(seen);
    }
    EXPECT_GT(last, 12e-3);
}

// A needle that is in as deep as it is to be stops there, though the tip has not come to the place that was meant: the
// tissue has gone along with it.
TEST(Hand, StopsWhereTheNeedleIsDeepEnough)
{
    TraineeStep press = moveTo({0, 0.04, 0});
    press.kind = TraineeStep::Kind::press;
    press.depth = 10e-3;
    HandDevice hand({}, {press}, Vec3(0.0), {0, 1, 0});
    TickRecord seen;
    seen.phase = Phase::inserted;
    while (!hand.finished()) {
        const double at = hand.read().position.y;
        hand.write(Vec3(0.0));
        seen.inserted = at;
        hand.observe(seen);
    }
    double furthest = 0;
    for (int i = 0; i < 500; ++i) {
        furthest = std::max(furthest, hand.read().position.y);
        hand.write(Vec3(0.0));
    }
    EXPECT_LT(furthest, 13e-3);
}

}  // namespace
}  // namespace palpate::haptics
