#include "stabilised.h"

#include <tests/allocations.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

namespace palpate::haptics {
namespace {

using namespace stabilised;

// Whatever is asked for and however the pose moves: never over the cap, and never a larger change than the slew, save that
// a force may fall by the stable stiffness times the motion and ends at once with the dead-man switch.
TEST(Stabiliser, HostileInputStaysUnderCapAndSlew)
{
    std::mt19937 random(11);
    std::normal_distribution<double> normal(0.0, 1.0);
    std::uniform_real_distribution<double> chance(0.0, 1.0);
    for (const auto& name : deviceNames()) {
        for (const double rate : {500.0, 1000.0, 4000.0}) {
            const StabiliserOptions o{deviceParameters(name), 1.0 / rate, 8.5};
            const double cap = std::min(8.5, o.device.peakForce);
            StabiliserState state;
            DeviceSample sample = heldAt(Vec3(0.0));
            Vec3 before(0.0), velocity(0.0);
            // In short periods the motion is known from the last milliseconds.
            const auto periods = static_cast<std::size_t>(rate > 1000.0 ? longestStraight * rate : 1.0);
            std::vector<double> ways(periods, 0.0);
            for (std::size_t i = 0; i < 10000; ++i) {
                const auto pick = [&] { return Vec3(normal(random), normal(random), normal(random)); };
                velocity = 0.9 * velocity + 0.1 * pick();
                const Vec3 way = chance(random) < 1e-3 ? 0.05 * pick() : velocity * o.period;
                sample.position += way;
                sample.fresh = chance(random) > 0.02;
                sample.buttons = chance(random) > 1e-3 ? buttonDeadMan : 0U;
                const Vec3 total = stabilise(10.0 * pick(), 3.0 * pick(), sample, o, state).total();
                ASSERT_LE(glm::length(total), cap * (1 + 1e-12));
                const bool falls = glm::length(total) < glm::length(before);
                ways[i % periods] = glm::length(way);
                const double most = *std::max_element(ways.begin(), ways.end());
                const double fall = falls ? stableLimits(o).stiffness * most : 0.0;
                if (sample.buttons != 0) {
                    ASSERT_LE(glm::length(total - before), 50.0 * cap * o.period + fall + 1e-9);
                }
                before = total;
            }
        }
    }
}

// A force far over the cap leaves nothing behind: when it ends, the hand is free within the slew from the cap to zero.
TEST(Stabiliser, OverloadDoesNotWindUp)
{
    StabiliserState state;
    sendFor(2, {0, 1000, 0}, heldAt(Vec3(0.0)), premium, state);
    const auto sent = sendFor(0.021, Vec3(0.0), heldAt(Vec3(0.0)), premium, state);
    EXPECT_LT(glm::length(sent.total()), 1e-12);
}

// Below the limits, and once the ramp is up, the force passes unchanged.
TEST(Stabiliser, SteadyForcePassesUnchanged)
{
    StabiliserState state;
    SentForce sent;
    for (int i = 0; i < 1000; ++i) {
        sent = stabilise(Vec3(1.5, -2.0, 0.25), Vec3(0.5, 0, 0), heldAt(Vec3(0.0)), premium, state);
    }
    EXPECT_EQ(sent.basic, Vec3(1.5, -2.0, 0.25));
    EXPECT_EQ(sent.additional, Vec3(0.5, 0, 0));
}

// A slow press of 20 mm/s into tissue and out again passes within 1 % of the force, tick by tick.
TEST(Stabiliser, SlowPressIsNotDulled)
{
    for (const auto& name : deviceNames()) {
        for (const double rate : {1000.0, 4000.0}) {
            const StabiliserOptions o{deviceParameters(name), 1.0 / rate, 8.5};
            for (const double stiffness : {100.0, 300.0, 600.0, 800.0}) {
                if (stiffness * o.device.encoder > 0.9 * 50.0 * o.period * std::min(8.5, o.device.peakForce)) {
                    continue;  // one step of the encoder is more than the slew
                }
                StabiliserState state;
                sendFor(0.6, Vec3(0.0), heldAt(Vec3(0.0)), o, state);
                const double deepest = 0.9 * std::min(8.5, o.device.peakForce) / stiffness;
                for (double way = 0.0; way < 2 * deepest; way += 0.02 * o.period) {
                    const double x = way < deepest ? way : 2 * deepest - way;
                    const double read = std::round(x / o.device.encoder) * o.device.encoder;
                    const double force = -stiffness * read;
                    const auto sent = stabilise({force, 0, 0}, Vec3(0.0), heldAt({read, 0, 0}), o, state);
                    ASSERT_LE(std::abs(sent.total().x - force), 0.01 * std::abs(force)) << name << rate << " " << stiffness;
                }
            }
        }
    }
}

// The ramp: g(t) = t / 0.5 s, whatever the rate.
TEST(Stabiliser, RampRisesInHalfASecond)
{
    for (const double rate : {500.0, 1000.0, 4000.0}) {
        const StabiliserOptions o{deviceParameters("premium"), 1.0 / rate, 8.5};
        StabiliserState state;
        EXPECT_NEAR(sendFor(0.25, {4, 0, 0}, heldAt(Vec3(0.0)), o, state).total().x, 2.0, 1e-6);
        EXPECT_NEAR(sendFor(0.25, {4, 0, 0}, heldAt(Vec3(0.0)), o, state).total().x, 4.0, 1e-6);
    }
}

TEST(Stabiliser, LiftedDeadManSwitchZeroesTheForceAtOnce)
{
    StabiliserState state;
    sendFor(1, {5, 0, 0}, heldAt(Vec3(0.0)), premium, state);
    EXPECT_EQ(stabilise(Vec3(5, 0, 0), Vec3(0.0), DeviceSample{}, premium, state).total(), Vec3(0.0));
    // And back it ramps.
    EXPECT_NEAR(sendFor(0.1, {5, 0, 0}, heldAt(Vec3(0.0)), premium, state).total().x, 5 * 0.1 / 0.5, 1e-6);
}

// The watchdog: g falls by t / 50 ms while poses are stale, and rises by t / 0.5 s when they are back.
TEST(Stabiliser, StalePosesFadeTheForceInFiftyMilliseconds)
{
    for (const double rate : {500.0, 1000.0, 4000.0}) {
        const StabiliserOptions o{deviceParameters("premium"), 1.0 / rate, 8.5};
        StabiliserState state;
        sendFor(1, {5, 0, 0}, heldAt(Vec3(0.0)), o, state);
        auto stale = heldAt(Vec3(0.0));
        stale.fresh = false;
        EXPECT_NEAR(sendFor(0.02, {5, 0, 0}, stale, o, state).total().x, 5 * (1 - 0.02 / 0.05), 1e-6);
        EXPECT_NEAR(sendFor(0.03, {5, 0, 0}, stale, o, state).total().x, 0.0, 1e-6);
        EXPECT_NEAR(sendFor(0.1, {5, 0, 0}, heldAt(Vec3(0.0)), o, state).total().x, 5 * 0.1 / 0.5, 1e-6);
    }
}

// No hand moves at 10 m/s: such a pose is stale until it has held still for 20 ms.
TEST(Stabiliser, PoseThatJumpsIsStaleUntilItHoldsStill)
{
    StabiliserState state;
    sendFor(1, {5, 0, 0}, heldAt(Vec3(0.0)), premium, state);
    EXPECT_NEAR(sendFor(0.001, {5, 0, 0}, heldAt({0.011, 0, 0}), premium, state).total().x, 5 * (1 - 0.02), 1e-6);
    EXPECT_NEAR(sendFor(0.019, {5, 0, 0}, heldAt({0.011, 0, 0}), premium, state).total().x, 5 * (1 - 0.4), 1e-6);
    EXPECT_NEAR(sendFor(0.02, {5, 0, 0}, heldAt({0.011, 0, 0}), premium, state).total().x, 5 * (1 - 0.4 + 0.04), 0.02);
}

TEST(Stabiliser, NonFiniteForceIsNeverSentAndLatches)
{
    for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
        StabiliserState state;
        stabilise(Vec3(1, 0, 0), Vec3(0.0), heldAt(Vec3(0.0)), premium, state);
        EXPECT_TRUE(stabilise(Vec3(0, bad, 0), Vec3(0.0), heldAt(Vec3(0.0)), premium, state).faulted);
        const auto later = stabilise(Vec3(1, 0, 0), Vec3(0.0), heldAt(Vec3(0.0)), premium, state);
        EXPECT_TRUE(later.faulted);
        EXPECT_EQ(later.total(), Vec3(0.0));
    }
}

// Each of these let the force through, or made it no number.
TEST(Stabiliser, WithoutALimitNothingIsSent)
{
    const double nan = std::numeric_limits<double>::quiet_NaN(), infinite = std::numeric_limits<double>::infinity();
    std::vector<StabiliserOptions> options;
    for (const double cap : {nan, -1.0, -1e-9, -infinite}) {
        options.push_back({premium.device, premium.period, cap});
    }
    for (const double period : {nan, 0.0, -1e-3, infinite}) {
        options.push_back({premium.device, period, premium.cap});
    }
    for (const double delay : {nan, -1e-3, infinite}) {
        options.push_back(premium);
        options.back().device.delay = delay;
    }
    for (const StabiliserOptions& o : options) {
        StabiliserState state;
        for (int i = 0; i < 100; ++i) {
            const SentForce sent = stabilise(Vec3(200, 0, 0), Vec3(0.0), heldAt({-1e-4 * i, 0, 0}), o, state);
            ASSERT_EQ(sent.total(), Vec3(0.0)) << o.cap << " N, " << o.period << " s, " << o.device.delay << " s";
            ASSERT_TRUE(sent.faulted);
        }
    }
}

// Of a device whose parameters are no numbers: what came in was finite.
TEST(Stabiliser, ASumThatIsNotFiniteIsNeverSent)
{
    for (const auto parameter : {&DeviceParameters::mass, &DeviceParameters::viscous, &DeviceParameters::coulomb}) {
        StabiliserOptions o = premium;
        o.device.*parameter = std::numeric_limits<double>::quiet_NaN();
        StabiliserState state;
        SentForce sent;
        for (int i = 0; i < 100; ++i) {
            sent = stabilise(Vec3(-1 - 0.1 * i, 0, 0), Vec3(0.0), heldAt({1e-4 * i, 0, 0}), o, state);
            ASSERT_TRUE(std::isfinite(glm::length(sent.total())));
        }
        EXPECT_TRUE(sent.faulted);
    }
}

// With an ideal device the ledger is the work of its motors, to the last bit of rounding, whole periods of delay or none.
TEST(Stabiliser, LedgerIsTheWorkOfTheMotors)
{
    for (const double delay : {0.0, 3e-3}) {
        DeviceParameters device;
        device.delay = delay;
        const StabiliserOptions o{device, tickSeconds, 8.5};
        StabiliserState state;
        Arm arm(device, Grip{}, Vec3(0.0));
        for (int i = 0; i < 3000; ++i) {
            arm.pull({0.03 * std::sin(0.004 * i), 0.02 * std::sin(0.007 * i), 0});
            const Vec3 x = arm.read();
            const auto sent = stabilise(-150.0 * x, {0, 0.2, 0}, heldAt(x), o, state);
            ASSERT_NEAR(state.ledger.given, arm.work(), 1e-9);
            arm.write(sent.total());
        }
        EXPECT_GT(std::abs(arm.work()), 1e-3);
    }
}

// A steady motion read in encoder steps: the window gives its speed within a step over its own length, and the stiffness.
TEST(Stabiliser, WindowFindsSpeedAndStiffness)
{
    constexpr double encoder = 0.03e-3;
    for (const double speed : {0.02, 0.1, 0.5}) {
        MotionWindow window;
        for (int i = 0; i < 40; ++i) {
            const double x = std::round(speed * 1e-3 * i / encoder) * encoder;
            window.read.add({x, 0, 0});
            window.force[window.read.newest] = {-700 * x, 0, 0};
        }
        const auto motion = motionIn(window, encoder, 1e-3);
        EXPECT_NEAR(motion.velocity.x, speed, encoder / 4e-3);
        EXPECT_NEAR(motion.stiffness, 700, 1e-6);
    }
}

// A wall at x = 0 (or a spring about it), pressed by the hand with up to 4 N, and held or let go after two seconds.
struct Loop {
    std::string device;
    double rate;
    double stiffness;
    bool letGo;
    bool bothWays;
};

struct Course {
    double made = 0;   // most that the loop ever gave beyond what it got and its friction took [J]
    double early = 0;  // peak to peak, just after two seconds [m]
    double late = 0;   // and in the last half second [m]
};

Course run(const Loop& loop, bool stabilised)
{
    const auto& device = deviceParameters(loop.device);
    const StabiliserOptions o{device, 1.0 / loop.rate, 8.5};
    StabiliserState state;
    const double start = loop.bothWays ? 0.0 : -2e-3;
    Arm arm(device, Grip{}, {start, 0, 0}, o.period);
    Course course;
    double low[2] = {1, 1}, high[2] = {-1, -1};
    const int ticks = static_cast<int>(4 * loop.rate);
    for (int i = 0; i < ticks; ++i) {
        const double t = i * o.period;
        arm.pull({std::clamp(start + 0.05 * (t - 0.6), start, 10e-3), 0, 0});
        if (loop.letGo && 2 * i == ticks) {
            arm.letGo();
        }
        const Vec3 x = arm.read();
        const Vec3 wall = {-loop.stiffness * (loop.bothWays ? x.x : std::max(0.0, x.x)), 0, 0};
        arm.write(stabilised ? stabilise(wall, Vec3(0.0), heldAt(x), o, state).total() : wall);
        course.made = std::max(course.made, arm.work() - arm.friction());
        const int part = t > 3.5 ? 1 : 0;
        if (t > 3.5 || (t > 2.05 && t < 2.3)) {
            low[part] = std::min(low[part], arm.position().x);
            high[part] = std::max(high[part], arm.position().x);
        }
    }
    course.early = high[0] - low[0];
    course.late = high[1] - low[1];
    return course;
}

// Walls of 100 to 5000 N/m, gripped and let go at full load, on every device and at every rate: what moves decays, and no
// energy comes out of the loop.
TEST(Stabiliser, NoWallGivesEnergy)
{
    for (const auto& device : deviceNames()) {
        for (const double rate : {500.0, 1000.0, 4000.0}) {
            for (const double stiffness : {100.0, 600.0, 1000.0, 2000.0, 5000.0}) {
                for (const bool letGo : {false, true}) {
                    const auto course = run({device, rate, stiffness, letGo, false}, true);
                    const auto what = device + " " + std::to_string(rate) + " " + std::to_string(stiffness) +
                                      (letGo ? " let go" : " gripped");
                    EXPECT_LT(course.made, 1e-3) << what;
                    // At 4 kHz a step of the Falcon's encoder on such a wall is more than may change in a tick: it shakes
                    // on.
                    const bool shakes = device == "falcon" && rate > 1000.0 && stiffness > 2000.0;
                    EXPECT_LT(course.late, shakes ? 1e-3 : std::max(0.1e-3, 0.5 * course.early)) << what;
                }
            }
        }
    }
}

// Soft tissue pressed to three times what the device can do, and left at 20 mm/s: all the way out the force is that of the
// tissue, or the cap, less at most what the tissue has on 2 mm. It is not gone as soon as the hand turns round.
TEST(Stabiliser, TissueBeyondTheCapIsFeltOnTheWayOut)
{
    constexpr double speed = 20e-3;
    for (const auto& name : deviceNames()) {
        const StabiliserOptions o{deviceParameters(name), tickSeconds, 8.5};
        const double cap = std::min(8.5, o.device.peakForce);
        constexpr double stiffness = 800.0;
        const double deepest = 3.0 * cap / stiffness;
        StabiliserState state;
        sendFor(1.0, Vec3(0.0), heldAt(Vec3(0.0)), o, state);
        double depth = 0.0;
        const auto send = [&](double by) {
            depth += by;
            return -stabilise(Vec3(-stiffness * depth, 0, 0), Vec3(0.0), heldAt({depth, 0, 0}), o, state).total().x;
        };
        while (depth < deepest) {
            send(speed * tickSeconds);
        }
        while (depth > 1e-3) {
            const double sent = send(-speed * tickSeconds), asked = std::min(stiffness * depth, cap);
            EXPECT_GT(sent, 0.98 * asked - stiffness * 2e-3) << name << " " << depth;
            EXPECT_LT(sent, asked + 1e-6) << name << " " << depth;
        }
    }
}

// A pose that jumps out of the tissue and back says nothing of where the force was at the cap. Where the switch is let go,
// and taken again in another place beyond the cap, that is not known: then the whole force is what it falls by on the way
// out, so that the hand gains nothing.
TEST(Stabiliser, WhatLiesBeyondTheCapIsOfThePlaceWhereTheHandIs)
{
    constexpr double stiffness = 800.0, step = 20e-6;
    const StabiliserOptions o{deviceParameters("touch"), tickSeconds, 8.5};
    const double cap = o.device.peakForce, deepest = 3.0 * cap / stiffness;
    for (const bool jumps : {false, true}) {
        StabiliserState state;
        const auto send = [&](double x, double depth, bool held) {
            DeviceSample sample = heldAt({x, depth, 0});
            sample.buttons = held ? sample.buttons : 0;
            return -stabilise(Vec3(0, -stiffness * std::max(depth, 0.0), 0), Vec3(0.0), sample, o, state).total().y;
        };
        for (int i = 0; i < 1000; ++i) {
            send(0.0, 0.0, true);
        }
        for (double depth = 0.0; depth < deepest; depth += step) {
            send(0.0, depth, true);
        }
        for (int i = 0; i < 1000; ++i) {
            jumps ? send(0.0, i == 0 ? -0.5 : deepest, true) : send(1e-4 * i, deepest, false);
        }
        const double x = jumps ? 0.0 : 0.1;
        for (int i = 0; i < 1500; ++i) {
            send(x, deepest, true);
        }
        for (double depth = deepest; depth > 1e-3; depth -= step) {
            const double sent = send(x, depth, true), asked = std::min(stiffness * depth, cap);
            EXPECT_GT(sent, jumps ? 0.98 * asked - stiffness * 2e-3 : -1e-9) << jumps << " " << depth;
            EXPECT_LT(sent, asked + 1e-6) << jumps << " " << depth;
            EXPECT_TRUE(jumps || depth > deepest - cap / stiffness || sent < 1e-6) << depth;
        }
    }
}

// A spring that nobody holds has nothing but the controller to calm it.
TEST(Stabiliser, SpringsLetGoAtFullLoadDecay)
{
    for (const auto& device : deviceNames()) {
        for (const double rate : {1000.0, 4000.0}) {
            for (const double stiffness : {100.0, 600.0, 1000.0, 2000.0, 5000.0}) {
                const auto course = run({device, rate, stiffness, true, true}, true);
                EXPECT_LT(course.made, 1e-3) << device << rate << " " << stiffness;
                EXPECT_LT(course.late, std::max(0.05e-3, 0.5 * course.early)) << device << rate << " " << stiffness;
            }
        }
    }
}

// The same loops without the stabiliser give energy by the joule: the tests above can fail.
TEST(Stabiliser, WithoutItTheSameLoopsGrow)
{
    EXPECT_GT(run({"premium", 1000, 600, true, true}, false).made, 0.1);
    EXPECT_GT(run({"premium", 500, 5000, false, false}, false).made, 0.1);
    EXPECT_GT(run({"falcon", 1000, 5000, true, false}, false).made, 0.05);
    EXPECT_GT(run({"falcon", 500, 5000, false, false}, false).made, 0.1);
    EXPECT_GT(run({"touch", 500, 1000, true, true}, false).made, 0.03);
}

// What friction takes of the energy that a held force leaves behind is not owed: the twentieth press passes as the first.
TEST(Stabiliser, ManySlowPressesAreNotDulled)
{
    for (const auto& name : deviceNames()) {
        const StabiliserOptions o{deviceParameters(name), tickSeconds, 8.5};
        StabiliserState state;
        sendFor(0.6, Vec3(0.0), heldAt(Vec3(0.0)), o, state);
        for (int i = 0; i < 20000; ++i) {
            const double phase = std::fmod(20e-6 * i, 6e-3);
            const double x = std::min(phase, 6e-3 - phase);
            const double read = std::round(x / o.device.encoder) * o.device.encoder;
            const auto sent = stabilise({-600 * read, 0, 0}, Vec3(0.0), heldAt({read, 0, 0}), o, state);
            ASSERT_NEAR(sent.total().x, -600 * read, 6 * read + 1e-12) << name << i;
        }
    }
}

TEST(Stabiliser, AllocatesNothing)
{
    StabiliserState state;
    EXPECT_EQ(tests::heapCallsIn([&] { sendFor(1, {1, 2, 3}, heldAt(Vec3(0.0)), premium, state); }), 0U);
}

}  // namespace
}  // namespace palpate::haptics
