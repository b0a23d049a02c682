#include <haptics/mouse.h>
#include <haptics/simulation.h>
#include <tests/allocations.h>
#include <tests/haptics/models.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <cmath>
#include <limits>
#include <random>

namespace palpate::haptics {
namespace {

constexpr int secondOfTicks = 1000;

// A viewer that writes every `frame` ticks, until it is dead.
struct Viewer {
    channel::Input now;
    int frame = 1;
    bool alive = true;

    std::optional<channel::Input> look()
    {
        if (alive && tick_++ % frame == 0) {
            ++now.beat;
            last_ = now;
        }
        return last_;
    }

private:
    int tick_ = 0;
    std::optional<channel::Input> last_;
};

MouseDevice deviceOf(Viewer& viewer, const DeviceParameters& device = {})
{
    return {device, [&viewer] { return viewer.look(); }, Vec3(0.0), {0, 1, 0}};
}

DeviceSample run(MouseDevice& device, int ticks, Vec3 force = Vec3(0.0))
{
    DeviceSample s;
    for (int i = 0; i < ticks; ++i) {
        s = device.read();
        device.write(force);
    }
    return s;
}

// A button that is pressed wherever the mouse is moves nothing; from then on the tool goes where the mouse goes.
TEST(Mouse, ToolMovesByWhatTheMouseMovesWhileTheSwitchIsHeld)
{
    Viewer viewer;
    MouseDevice device = deviceOf(viewer);
    viewer.now.target = {0.5, 0.5, 0.5};
    EXPECT_EQ(run(device, 100).position, Vec3(0.0));
    viewer.now.held = 1;
    EXPECT_LT(glm::length(run(device, 100).position), 1e-9);
    viewer.now.target = {0.51, 0.52, 0.47};
    EXPECT_LT(glm::distance(run(device, secondOfTicks).position, Vec3(0.01, 0.02, -0.03)), 1e-6);
    viewer.now.held = 0;
    run(device, 1);
    viewer.now.target = {0, 0, 0};
    const auto left = run(device, secondOfTicks);
    EXPECT_LT(glm::distance(left.position, Vec3(0.01, 0.02, -0.03)), 1e-6);
    EXPECT_EQ(left.buttons & buttonDeadMan, 0U);
}

TEST(Mouse, NothingThatTheMouseDoesMovesTheToolFasterThanAHand)
{
    std::mt19937 random(3);
    std::uniform_real_distribution<double> place(-0.3, 0.3);
    Viewer viewer;
    viewer.frame = 33;
    viewer.now.held = 1;
    MouseDevice device = deviceOf(viewer);
    Vec3 last = device.read().position, lastAxis(0, 1, 0);
    double fastest = 0.0, sharpest = 0.0, turned = 0.0, before = 0.0;
    for (int i = 0; i < 10 * secondOfTicks; ++i) {
        viewer.now.target = {place(random), place(random), place(random)};
        const Vec3 axis = glm::normalize(Vec3(place(random), place(random), place(random)));
        viewer.now.axis = {axis.x, axis.y, axis.z};
        const auto s = device.read();
        const double speed = glm::distance(s.position, last) / tickSeconds;
        fastest = std::max(fastest, speed);
        sharpest = std::max(sharpest, std::abs(speed - before) / tickSeconds);
        turned = std::max(turned, glm::distance(s.axis, lastAxis) / tickSeconds);
        EXPECT_NEAR(glm::length(s.axis), 1.0, 1e-12);
        last = s.position;
        lastAxis = s.axis;
        before = speed;
    }
    EXPECT_GT(fastest, 0.5 * MouseDevice::fastest);
    EXPECT_LT(fastest, 1.02 * MouseDevice::fastest) << "critically damped: hardly an overshoot";
    EXPECT_LT(turned, 1.001 * MouseDevice::fastestTurn);
    // The force of the grip is k (goal - x) - b v with |goal - x| no more than the lag of a steady motion, b v / k.
    const double mass = DeviceParameters{}.mass + MouseDevice::grip.mass;
    EXPECT_LT(sharpest, 4.0 * MouseDevice::grip.damping * MouseDevice::fastest / mass);
}

// What is felt is seen: under a force F the tool stays F / grip behind the mouse.
TEST(Mouse, ToolLagsBehindTheMouseByForceOverStiffness)
{
    Viewer viewer;
    viewer.now.held = 1;
    MouseDevice device = deviceOf(viewer);
    run(device, 10);
    viewer.now.target = {0, 0.02, 0};
    const auto s = run(device, 2 * secondOfTicks, {0, -3.0, 0});
    EXPECT_NEAR(s.position.y, 0.02 - 3.0 / MouseDevice::grip.stiffness, 1e-6);
}

// Two looks may be further apart than a press and its release.
TEST(Mouse, EveryPressFiresOnceAndEndsOnce)
{
    Viewer viewer;
    viewer.now.fires = 7;  // another viewer's, before this one
    MouseDevice device = deviceOf(viewer);
    run(device, 10);
    for (int press = 0; press < 3; ++press) {
        ++viewer.now.fires;
        ++viewer.now.marks;
        ++viewer.now.unmarks;
        int fired = 0, marked = 0, takenBack = 0;
        std::uint32_t before = 0;
        for (int i = 0; i < 200; ++i) {
            const auto s = device.read();
            fired += (s.buttons & ~before & buttonFire) != 0 ? 1 : 0;
            marked += (s.buttons & ~before & buttonMark) != 0 ? 1 : 0;
            takenBack += (s.buttons & ~before & buttonUnmark) != 0 ? 1 : 0;
            before = s.buttons;
        }
        EXPECT_EQ(fired, 1);
        EXPECT_EQ(marked, 1);
        EXPECT_EQ(takenBack, 1);
        EXPECT_EQ(before, 0U);
    }
    EXPECT_FALSE(device.finished());
    viewer.now.ended = 1;
    run(device, 1);
    EXPECT_TRUE(device.finished());
}

// A viewer that could not read what the one before it, which died, had counted.
TEST(Mouse, CountsThatBeginAnewAreNoPress)
{
    Viewer viewer;
    viewer.now.fires = 3;
    MouseDevice device = deviceOf(viewer);
    run(device, 10);
    viewer.now.fires = 0;
    for (int i = 0; i < 200; ++i) {
        EXPECT_EQ(device.read().buttons & buttonFire, 0U);
    }
    viewer.now.fires = 1;
    EXPECT_EQ(device.read().buttons & buttonFire, buttonFire);
}

TEST(Mouse, WhatIsNoPoseIsNotFollowed)
{
    Viewer viewer;
    viewer.now.held = 1;
    MouseDevice device = deviceOf(viewer);
    run(device, 10);
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    for (const auto& [target, axis] : {std::pair<channel::Triple, channel::Triple>{{nan, 0, 0}, {0, 1, 0}},
                                       {{1e300, 0, 0}, {0, 1, 0}},
                                       {{0, 0, 0}, {0, 3, 0}}}) {
        viewer.now.target = target;
        viewer.now.axis = axis;
        const auto s = run(device, 100);
        EXPECT_LT(glm::length(s.position), 1e-6);
        EXPECT_EQ(s.axis, Vec3(0, 1, 0));
    }
}

// The other hand needs no dead-man switch. It gets where the viewer has it, at a hand's speed; nonsense moves nothing, and
// a stored picture is one press.
TEST(Mouse, TheOtherHandMovesTheProbe)
{
    Viewer viewer;
    MouseDevice device = deviceOf(viewer);
    run(device, 10);
    viewer.now.probe = {5e-3, -20e-3, 0, 0.4, 0, -0.2};
    datasets::ProbeMove before;
    for (int i = 0; i < secondOfTicks; ++i) {
        const auto now = run(device, 1).probe;
        EXPECT_LE(std::abs(now.slide - before.slide), ProbeFollower::fastest * tickSeconds * 1.0001);
        EXPECT_LE(std::abs(now.rock - before.rock), ProbeFollower::fastestTurn * tickSeconds * 1.0001);
        before = now;
    }
    EXPECT_NEAR(before.press, 5e-3, 1e-6);
    EXPECT_NEAR(before.slide, -20e-3, 1e-6);
    EXPECT_NEAR(before.rock, 0.4, 1e-6);
    EXPECT_NEAR(before.turn, -0.2, 1e-6);
    viewer.now.probe[0] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_NEAR(run(device, 100).probe.press, 5e-3, 1e-6);
    viewer.now.probe[0] = 5e-3;
    viewer.now.pictures = 1;
    int presses = 0;
    bool down = false;
    for (int i = 0; i < secondOfTicks; ++i) {
        const bool now = (run(device, 1).buttons & buttonPicture) != 0;
        presses += now && !down ? 1 : 0;
        down = now;
    }
    EXPECT_EQ(presses, 1);
}

TEST(Mouse, ReadingAllocatesNothing)
{
    Viewer viewer;
    viewer.now.held = 1;
    MouseDevice device = deviceOf(viewer, deviceParameters("premium"));
    const auto before = tests::allocations();
    run(device, secondOfTicks);
    EXPECT_EQ(tests::allocations(), before);
}

// A viewer dies while its hand presses: the force fades within the watchdog's time and stays away, the tool does not move
// on, and a new viewer's hand takes the tool where it is.
TEST(Mouse, ADeadViewersHandFadesToZero)
{
    const auto& model = tests::blockSphere();
    Simulation simulation(model);
    Viewer viewer;
    viewer.frame = 33;
    MouseDevice device({}, [&viewer] { return viewer.look(); }, {0, -11e-3, 0}, {0, 1, 0});
    const auto tick = [&] {
        const auto& record = simulation.tick(device.read());
        device.write(record.total);
        return glm::length(record.total);
    };
    viewer.now.held = 1;
    tick();
    viewer.now.target = {0, 6e-3, 0};
    double force = 0.0;
    for (int i = 0; i < 800; ++i) {
        force = tick();
    }
    EXPECT_GT(force, 0.1);
    viewer.alive = false;
    const int silent = static_cast<int>(std::lround(MouseDevice::longestSilence / tickSeconds));
    for (int i = 0; i < silent - 1; ++i) {
        force = tick();
    }
    EXPECT_GT(force, 0.1) << "a slow picture is no dead viewer";
    for (int i = 0; i < 60 + viewer.frame; ++i) {
        force = tick();
    }
    const Vec3 resting = device.read().position;
    for (int i = 0; i < 300; ++i) {
        EXPECT_EQ(tick(), 0.0);
    }
    EXPECT_LT(glm::distance(device.read().position, resting), 1e-4);
    viewer.alive = true;
    viewer.now.target = {0.2, 0.2, 0.2};
    for (int i = 0; i < 800; ++i) {
        force = tick();
    }
    EXPECT_GT(force, 0.05);
    EXPECT_LT(glm::distance(device.read().position, resting), 5e-3);
}

// In a test the tool waits beside the plan and oblique to it, its line past the target; the seed says where.
TEST(Mouse, InATestTheToolBeginsBesideThePlan)
{
    const auto& model = tests::layeredNeedle();
    const auto& [entry, aim, planned] = model.approach;
    constexpr double distance = 30e-3;
    Vec3 sum(0.0);
    for (std::uint64_t seed = 0; seed < 50; ++seed) {
        const Start start = startOffPlan(model, distance, seed);
        const Vec3 off = start.tip - entry;
        const double aside = std::hypot(off.x, off.z);
        const double degrees = std::acos(start.axis.y) * 180.0 / 3.14159265358979;
        EXPECT_TRUE(aside > 14.9e-3 && aside < 25.1e-3) << aside;
        EXPECT_TRUE(degrees > 9.9 && degrees < 20.1) << degrees;
        EXPECT_NEAR(off.y, -distance, 1e-3);
        const Vec3 way = aim - start.tip;
        EXPECT_GT(glm::length(way - glm::dot(way, start.axis) * start.axis), 14.9e-3);
        EXPECT_EQ(startOffPlan(model, distance, seed).tip, start.tip);
        MouseDevice device = mouseOffPlan(
            model, [] { return std::nullopt; }, distance, seed);
        EXPECT_LT(glm::distance(run(device, 10).position, start.tip), 0.1e-3) << "to the steps of its encoders";
        sum += off / 50.0;
    }
    EXPECT_LT(std::hypot(sum.x, sum.z), 8e-3) << "to no side more often";
}

}  // namespace
}  // namespace palpate::haptics
