#include <tests/allocations.h>
#include <tests/error_of.h>

#include <haptics/arm.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace palpate::haptics {
namespace {

DeviceParameters massOf(double kilograms)
{
    DeviceParameters device;
    device.mass = kilograms;
    return device;
}

void live(Arm& arm, int samples)
{
    for (int i = 0; i < samples; ++i) {
        arm.read();
    }
}

// x = F t^2 / 2 m, at any rate.
TEST(Arm, FreeMassUnderAConstantForceFollowsTheParabola)
{
    for (const double rate : {500.0, 1000.0, 4000.0}) {
        Arm arm(massOf(0.08), released, Vec3(0.0), 1.0 / rate);
        arm.write({0.5, 0, 0});
        live(arm, static_cast<int>(0.1 * rate));
        EXPECT_NEAR(arm.position().x, 0.5 * 0.5 / 0.08 * 0.01, 1e-12);
    }
}

// v = v0 exp(-b t / m).
TEST(Arm, ViscousFrictionDecaysExponentially)
{
    DeviceParameters device = massOf(0.1);
    device.viscous = 2.0;
    Arm arm(device, released);
    arm.release(Vec3(0.0), {0, 0.3, 0});
    live(arm, 50);
    EXPECT_NEAR(arm.velocity().y, 0.3 * std::exp(-2.0 * 0.05 / 0.1), 1e-6);
}

// A mass on Coulomb friction alone stops after m v0^2 / 2 c and stays there.
TEST(Arm, CoulombFrictionStopsAMassWhereItsEnergyIsSpent)
{
    DeviceParameters device = massOf(0.072);
    device.coulomb = 0.038;
    Arm arm(device, released);
    arm.release(Vec3(0.0), {0.06, 0.08, 0});
    live(arm, 1000);
    EXPECT_NEAR(glm::length(arm.position()), 0.072 * 0.01 / (2 * 0.038), 1e-6);
    EXPECT_EQ(arm.velocity(), Vec3(0.0));
}

// What friction can hold does not creep, and what it cannot hold moves with the rest: x = (F - c) t^2 / 2 m.
TEST(Arm, CoulombFrictionHoldsWhatItCan)
{
    DeviceParameters device = massOf(0.072);
    device.coulomb = 0.038;
    Arm held(device, released), moved(device, released);
    held.write({0.0379, 0, 0});
    moved.write({0.138, 0, 0});
    live(held, 5000);
    live(moved, 100);
    EXPECT_EQ(held.position(), Vec3(0.0));
    EXPECT_NEAR(moved.position().x, 0.1 * 0.01 / (2 * 0.072), 1e-9);
}

// The force acts after the delay and no sooner, whole periods or not.
TEST(Arm, DelayedForceActsAfterItsDelay)
{
    for (const double delay : {1e-3, 2.3e-3, 16e-3}) {
        DeviceParameters device = massOf(0.1);
        device.delay = delay;
        Arm arm(device, released);
        for (int i = 0; i < 50; ++i) {
            arm.write({1, 0, 0});
            arm.read();
        }
        const double acted = 0.05 - delay;
        EXPECT_NEAR(arm.position().x, acted * acted / (2 * 0.1), 1e-12) << delay;
    }
}

TEST(Arm, AmplifierLagsByItsTimeConstant)
{
    DeviceParameters device = massOf(1e9);
    device.bandwidth = 200;
    Arm arm(device, released);
    arm.write({2, 0, 0});
    arm.read();
    EXPECT_NEAR(arm.force().x, 2.0 * (1.0 - std::exp(-2.0 * std::numbers::pi * 200 * 1e-3)), 1e-12);
}

TEST(Arm, ForceIsRoundedBoundedAndNeverNonFinite)
{
    DeviceParameters device = massOf(0.1);
    device.peakForce = 3.0;
    device.forceStep = 0.25;
    Arm arm(device, released);
    const auto put = [&](Vec3 f) {
        arm.write(f);
        arm.read();
        return arm.force();
    };
    EXPECT_EQ(put({0.4, -0.1, 0}), Vec3(0.5, 0, 0));
    EXPECT_NEAR(glm::length(put({0, 100, 0})), 3.0, 1e-12);
    EXPECT_EQ(put({0, std::numeric_limits<double>::quiet_NaN(), 1}), Vec3(0.0));
    EXPECT_EQ(put({std::numeric_limits<double>::infinity(), 0, 0}), Vec3(0.0));
}

TEST(Arm, ReadsTheNearestEncoderStep)
{
    DeviceParameters device = massOf(0.1);
    device.encoder = 0.06e-3;
    Arm arm(device, released);
    arm.release(Vec3(0.0), {0.05, -0.03, 0.011});
    for (int i = 0; i < 300; ++i) {
        const Vec3 read = arm.read();
        for (int axis = 0; axis < 3; ++axis) {
            EXPECT_LE(std::abs(read[axis] - arm.position()[axis]), 0.5 * device.encoder * (1 + 1e-9));
            const double steps = read[axis] / device.encoder;
            EXPECT_NEAR(steps, std::round(steps), 1e-9);
        }
    }
}

// Held, the hand's spring settles the tip at F / k; let go, its mass and its spring are gone at once.
TEST(Arm, LettingGoLeavesTheDeviceAlone)
{
    Arm arm(massOf(0.05), {0.15, 4.0, 200.0});
    arm.write({0, 0, 1.0});
    live(arm, 3000);
    EXPECT_NEAR(arm.position().z, 1.0 / 200, 1e-6);
    arm.letGo();
    const double before = arm.position().z;
    live(arm, 10);
    EXPECT_NEAR(arm.position().z - before, 1.0 * 1e-4 / (2 * 0.05), 1e-6);
}

// What the motors gave is kinetic energy or was lost to friction.
TEST(Arm, WorkIsKineticEnergyAndFriction)
{
    std::mt19937 random(3);
    std::normal_distribution<double> size(0.0, 1.0);
    DeviceParameters device = deviceParameters("touch");
    Arm arm(device, released);
    for (int i = 0; i < 2000; ++i) {
        arm.write({size(random), size(random), size(random)});
        arm.read();
    }
    const double kinetic = 0.5 * device.mass * glm::dot(arm.velocity(), arm.velocity());
    EXPECT_GT(arm.friction(), 1e-4);
    EXPECT_NEAR(arm.work(), kinetic + arm.friction(), 0.02 * arm.friction());
}

TEST(Arm, UnknownDevicesAndEndlessDelaysAreRefused)
{
    EXPECT_NE(tests::errorOf([] { deviceParameters("omega"); }).find("premium, touch, falcon"), std::string::npos);
    DeviceParameters slow = massOf(0.1);
    slow.delay = 0.3;
    EXPECT_NE(tests::errorOf([&] { Arm arm(slow); }).find("delay"), std::string::npos);
    for (const double delay : {-1e-3, std::numeric_limits<double>::quiet_NaN()}) {
        slow.delay = delay;
        EXPECT_NE(tests::errorOf([&] { Arm arm(slow); }).find("must be 0 or more"), std::string::npos);
    }
}

TEST(Arm, AllocatesNothing)
{
    DeviceParameters device = deviceParameters("falcon");
    Arm arm(device);
    EXPECT_EQ(tests::heapCallsIn([&] {
                  for (int i = 0; i < 1000; ++i) {
                      arm.pull(arm.read());
                      arm.write({1, 2, 3});
                  }
              }),
              0U);
}

}  // namespace
}  // namespace palpate::haptics
