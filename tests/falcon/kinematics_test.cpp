#include <haptics/falcon/kinematics.h>
#include <haptics/motion.h>
#include <tests/allocations.h>
#include <tests/falcon/inverse.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace palpate::falcon {
namespace {

constexpr double workspaceNear = 0.08, workspaceFar = 0.172;  // along z [m]
constexpr double workspaceRadius = 0.05;                      // [m]
constexpr double workspaceApex = 0.182;                       // of the cone towards the user [m]

// Whether the legs are known to hold the grip well there: a cylinder about z, with a cone towards the user, where they are
// near stretched.
bool inWorkspace(Vec3 p)
{
    return p.z >= workspaceNear && p.z <= workspaceFar &&
           std::hypot(p.x, p.y) <= std::min(workspaceRadius, workspaceApex - p.z);
}

// Every place of a grid that lies in the workspace.
std::vector<Vec3> placesOf(double spacing)
{
    const int across = static_cast<int>(workspaceRadius / spacing);
    const int along = static_cast<int>((workspaceFar - workspaceNear) / spacing);
    std::vector<Vec3> places;
    for (int i = 0; i < (2 * across + 1) * (2 * across + 1) * (along + 1); ++i) {
        const int x = i % (2 * across + 1) - across;
        const int y = i / (2 * across + 1) % (2 * across + 1) - across;
        const int z = i / (2 * across + 1) / (2 * across + 1);
        const Vec3 place(spacing * x, spacing * y, workspaceNear + spacing * z);
        if (inWorkspace(place)) {
            places.push_back(place);
        }
    }
    return places;
}

Vec3 anyPlace(std::mt19937& random)
{
    std::uniform_real_distribution<double> side(-workspaceRadius, workspaceRadius), depth(workspaceNear, workspaceFar);
    for (;;) {
        const Vec3 p(side(random), side(random), depth(random));
        if (inWorkspace(p)) {
            return p;
        }
    }
}

// Also from the start that knows nothing of the place.
TEST(FalconKinematics, InverseOfForwardOverTheWorkspace)
{
    double worst = 0.0;
    const auto places = placesOf(4e-3);
    for (const Vec3 p : places) {
        const auto angles = anglesAt(p);
        ASSERT_TRUE(angles);
        const auto back = positionAt(*angles);
        ASSERT_TRUE(back);
        worst = std::max(worst, glm::distance(*back, p));
    }
    EXPECT_GT(places.size(), 5000U);
    EXPECT_LT(worst, 1e-9);
}

// On the axis the three legs see the same, so they turn by the same angle; with it the grip is on the axis.
TEST(FalconKinematics, LegsAgreeOnTheAxis)
{
    for (double z = workspaceNear; z <= workspaceFar; z += 5e-3) {
        const auto angles = anglesAt({0, 0, z});
        ASSERT_TRUE(angles);
        EXPECT_NEAR((*angles)[0], (*angles)[1], 1e-14);
        EXPECT_NEAR((*angles)[0], (*angles)[2], 1e-14);
    }
}

// The encoders' zero is at about 35 degrees, and that is in the middle of the workspace's depth.
TEST(FalconKinematics, EncoderZeroLiesInTheMiddle)
{
    const auto middle = positionAt({zeroAngle, zeroAngle, zeroAngle});
    ASSERT_TRUE(middle);
    EXPECT_LT(std::hypot(middle->x, middle->y), 1e-12);
    EXPECT_GT(middle->z, 0.11);
    EXPECT_LT(middle->z, 0.15);
}

TEST(FalconKinematics, JacobianIsTheDerivativeOfThePosition)
{
    constexpr double h = 1e-6;
    for (const Vec3 p : placesOf(12e-3)) {
        const auto angles = anglesAt(p);
        const auto posture = postureAt(*angles);
        ASSERT_TRUE(posture);
        for (std::size_t i = 0; i < 3; ++i) {
            Angles up = *angles, down = *angles;
            up[i] += h;
            down[i] -= h;
            const Vec3 slope = (*positionAt(up, p) - *positionAt(down, p)) / (2.0 * h);
            EXPECT_LT(glm::distance(slope, posture->jacobian[static_cast<int>(i)]), 1e-8);
        }
    }
}

// Virtual work: t . dq = F . dx for every small motion.
TEST(FalconKinematics, TorquesDoTheWorkOfTheForce)
{
    std::mt19937 random(5);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    for (int i = 0; i < 200; ++i) {
        const Vec3 p = anyPlace(random);
        const Vec3 force(unit(random), unit(random), unit(random));
        const Vec3 move = 1e-7 * Vec3(unit(random), unit(random), unit(random));
        const Angles before = *anglesAt(p - move), after = *anglesAt(p + move);
        const auto posture = postureAt(*anglesAt(p));
        const Torques torques = torquesFor(*posture, force);
        double work = 0.0;
        for (std::size_t leg = 0; leg < 3; ++leg) {
            work += torques[leg] * (after[leg] - before[leg]);
        }
        EXPECT_NEAR(work, 2.0 * glm::dot(force, move), 1e-12);
        EXPECT_LT(glm::distance(forceOf(*posture, torques), force), 1e-12);
    }
}

TEST(FalconKinematics, WorkspaceIsWellPosedAndItsEdgesAreNot)
{
    double least = 1.0;
    for (const Vec3 p : placesOf(4e-3)) {
        least = std::min(least, postureAt(*anglesAt(p))->margin);
    }
    EXPECT_GT(least, wellPosed);
    // Towards the stretched legs the margin falls to nothing, and beyond there is no pose.
    const auto stretched = anglesAt({0.0, 0.0, 0.183});
    ASSERT_TRUE(stretched);
    EXPECT_LT(postureAt(*stretched, {0, 0, 0.18})->margin, singular);
    EXPECT_FALSE(anglesAt({0.0, 0.0, 0.2}));
    EXPECT_FALSE(anglesAt({0.0, 0.2, 0.1}));
    EXPECT_FALSE(anglesAt({std::numeric_limits<double>::quiet_NaN(), 0.0, 0.1}));
    EXPECT_FALSE(positionAt({std::numeric_limits<double>::quiet_NaN(), 0.0, 0.1}));
}

// Whatever counts a broken wire brings: a pose, or none; never a wrong one.
TEST(FalconKinematics, AnyAnglesGiveAPoseThatClosesOrNone)
{
    std::mt19937 random(6);
    int some = 0;
    for (int i = 0; i < 20000; ++i) {
        const Triple count{static_cast<std::int16_t>(random()), static_cast<std::int16_t>(random()),
                           static_cast<std::int16_t>(random())};
        const Angles angles = anglesOf(count);
        const auto posture = postureAt(angles);
        if (!posture) {
            continue;
        }
        ++some;
        const auto& j = posture->jacobian;
        EXPECT_TRUE(std::isfinite(glm::length(posture->position)));
        EXPECT_TRUE(std::isfinite(glm::length(j[0]) + glm::length(j[1]) + glm::length(j[2])));
    }
    EXPECT_GT(some, 0);
}

TEST(FalconTorque, SaturationKeepsTheDirection)
{
    std::mt19937 random(7);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    int saturated = 0;
    for (int i = 0; i < 2000; ++i) {
        const auto posture = postureAt(*anglesAt(anyPlace(random)));
        const Vec3 force = 60.0 * Vec3(unit(random), unit(random), unit(random));
        const Triple motor = motorCommand(torquesFor(*posture, force));
        const int most = std::max({std::abs(motor[0]), std::abs(motor[1]), std::abs(motor[2])});
        EXPECT_LE(most, largestCommand);
        const Vec3 felt = forceOf(*posture, torquesOf(motor));
        // Half a step in each torque.
        EXPECT_LT(glm::length(glm::cross(glm::normalize(felt), glm::normalize(force))), 0.01);
        EXPECT_GT(glm::dot(felt, force), 0.0) << "the sign is turned once on the way out and once in the motors";
        if (most == largestCommand) {
            ++saturated;
            EXPECT_LE(glm::length(felt), glm::length(force) * 1.001);
        } else {
            EXPECT_LT(glm::distance(felt, force), 0.01);
        }
    }
    EXPECT_GT(saturated, 500);
}

TEST(FalconTorque, NothingNotFiniteReachesTheMotors)
{
    for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
        EXPECT_EQ(motorCommand({0.1, bad, 0.1}), Triple{});
    }
    EXPECT_EQ(motorCommand({1e300, -1e300, 0.0}), (Triple{-largestCommand, largestCommand, 0}));
}

// One count at 1 kHz reads as 20 to 60 mm/s. The estimate of the loop (adaptive window, position between two steps) is that
// of a slow hand within a few millimetres per second.
TEST(FalconEncoders, SlowMotionIsFeltAsMotion)
{
    constexpr double speed = 20e-3, period = 1e-3, encoder = 60e-6;
    const Vec3 direction = glm::normalize(Vec3(0.2, 0.3, -1.0));
    const Vec3 start(-0.01, 0.005, 0.14);
    haptics::EncoderState state;
    haptics::PositionWindow estimates;
    Vec3 raw(0.0);
    double worst = 0.0, worstRaw = 0.0;
    for (int i = 0; i < 1000; ++i) {
        const Vec3 p = start + speed * period * i * direction;
        const auto read = positionAt(anglesOf(countsAt(*anglesAt(p))));
        ASSERT_TRUE(read);
        estimates.add(haptics::betweenSteps(*read, encoder, period, state));
        if (i > 50) {
            const std::size_t n = 16;
            const Vec3 velocity =
                (estimates.position[estimates.newest] - estimates.position[estimates.back(n)]) / (n * period);
            worst = std::max(worst, glm::distance(velocity, speed * direction));
            worstRaw = std::max(worstRaw, glm::distance((*read - raw) / period, speed * direction));
        }
        raw = *read;
    }
    EXPECT_GT(worstRaw, 1.0 * speed) << "what differencing alone makes of it";
    EXPECT_LT(worst, 0.25 * speed);
}

TEST(FalconKinematics, AllocatesNothing)
{
    const auto angles = *anglesAt({0.01, 0.02, 0.12});
    EXPECT_EQ(tests::heapCallsIn([&] {
                  const auto posture = postureAt(angles);
                  motorCommand(torquesFor(*posture, {1, 2, 3}));
              }),
              0U);
}

}  // namespace
}  // namespace palpate::falcon
