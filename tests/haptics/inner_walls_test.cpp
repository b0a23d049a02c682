#include "slabs.h"

#include <haptics/inner_walls.h>
#include <haptics/needle.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <vector>

namespace palpate::haptics {
namespace {

using tests::LoneNeedle;

Vec3 randomIn(std::mt19937& random, double side)
{
    std::uniform_real_distribution<double> u(-0.5 * side, 0.5 * side);
    const double x = u(random), y = u(random);
    return {x, y, u(random)};
}

// Walls on the way from `from` along `axis`.
int wallsAlong(Vec3 from, Vec3 axis, double length, double spacing)
{
    const double step = 0.005 * spacing;
    int walls = 0;
    std::uint64_t before = lobeAt(from, spacing);
    for (double at = step; at < length; at += step) {
        const std::uint64_t here = lobeAt(from + at * axis, spacing);
        walls += here != before ? 1 : 0;
        before = here;
    }
    return walls;
}

TEST(InnerWalls, StandAsFarApartAsAsked)
{
    std::mt19937 random(7);
    for (const double spacing : {2e-3, 15e-3}) {
        int walls = 0;
        double length = 0.0;
        for (int i = 0; i < 120; ++i) {
            const Vec3 from = randomIn(random, 0.3), axis = glm::normalize(randomIn(random, 1.0));
            walls += wallsAlong(from, axis, 30.0 * spacing, spacing);
            length += 30.0 * spacing;
        }
        EXPECT_NEAR(length / walls, spacing, 0.04 * spacing) << walls;  // one part in the root of 3,600
    }
}

// Cells of a Voronoi diagram are convex.
TEST(InnerWalls, WhatLiesBetweenTwoPlacesOfALobeLiesInIt)
{
    std::mt19937 random(11);
    std::uniform_real_distribution<double> between(0.0, 1.0);
    constexpr double spacing = 5e-3;
    int pairs = 0;
    for (int i = 0; i < 40000; ++i) {
        const Vec3 one = randomIn(random, 0.2), other = one + randomIn(random, 2.0 * spacing);
        if (const std::uint64_t lobe = lobeAt(one, spacing); lobe == lobeAt(other, spacing)) {
            ASSERT_EQ(lobeAt(glm::mix(one, other, between(random)), spacing), lobe);
            ++pairs;
        }
    }
    EXPECT_GT(pairs, 5000);
}

TEST(InnerWalls, ForcesAreExponentialAndTheSameFromBothSides)
{
    std::mt19937_64 random(3);
    constexpr int count = 20000;
    constexpr double mean = 0.2;
    double sum = 0.0;
    int over = 0;
    for (int i = 0; i < count; ++i) {
        const std::uint64_t one = random(), other = random();
        const double force = wallForce(one, other, mean);
        ASSERT_EQ(force, wallForce(other, one, mean));
        ASSERT_GE(force, 0.0);
        ASSERT_LT(force, 40.0 * mean);
        sum += force;
        over += force > 2.0 * mean ? 1 : 0;
    }
    EXPECT_NEAR(sum / count, mean, 0.03 * mean);
    EXPECT_NEAR(over, count * std::exp(-2.0), 0.06 * count * std::exp(-2.0));
}

constexpr double cutting = 0.4, spacing = 6e-3, meanForce = 0.3;

// Gland with walls and a frictionless shaft.
SessionModel gland(bool walls, bool inTable = true)
{
    auto table = datasets::defaultTissues();
    auto& row = table.rows[*table.find("gland")];
    row.cuttingForce = row.punctureForce = cutting;
    row.frictionPerMetre = row.stictionPerMetre = row.frictionDamping = 0.0;
    row.wallSpacing = inTable ? spacing : 0.0;
    row.wallForce = inTable ? meanForce : 0.0;
    return tests::boxOf(
        [](Vec3 p) { return p.x > 20e-3 && p.y > 50e-3 ? std::string("bone") : std::string("gland"); }, "bone",
        std::string("[dffb]\nmode = \"off\"\n[model]\nlevel = \"chainmail\"\n") + (walls ? "walls = true\n" : ""), table);
}

// The tip carries the cutting force and what the wall holds when it breaks through, and the cutting force afterwards.
TEST(InnerWalls, EachHoldsTheTipUntilItsForceIsReached)
{
    const SessionModel model = gland(true);
    LoneNeedle needle(model);
    Vec3 proxy(0.0);
    double before = 0.0;
    std::set<std::uint64_t> lobes;
    int walls = 0;
    needle.go({0, -2e-3, 0}, {0, 48e-3, 0}, 0.005, [&](Vec3, Vec3 force) {
        const Vec3 now = needle.tip.proxy;
        const double along = -force.y;
        if (needle.tip.phase == Phase::inserted && now.y > 2e-3) {
            // Half a step behind a wall the tip stands in the cell that it has broken into.
            const std::uint64_t from = lobeAt(proxy, spacing), to = lobeAt(proxy + Vec3(0, cutStep, 0), spacing);
            const double holds = cutting + (from != to ? wallForce(from, to, meanForce) : 0.0);
            if (from != to && now.y - proxy.y > 0.9 * cutStep) {
                EXPECT_NEAR(before, holds, 0.03 * holds) << now.y;
                ++walls;
            }
            lobes.insert(from);
        }
        proxy = now;
        before = along;
    });
    EXPECT_GE(walls, 4);
    EXPECT_GE(lobes.size(), 5U);
}

// Out and in again at the same place: nothing is left to break.
TEST(InnerWalls, WhatWasBrokenHoldsNothing)
{
    const SessionModel model = gland(true);
    LoneNeedle needle(model);
    needle.go({0, -2e-3, 0}, {0, 40e-3, 0}, 0.01, [](Vec3, Vec3) {});
    needle.go({0, 40e-3, 0}, {0, -5e-3, 0}, 0.01, [](Vec3, Vec3) {});
    double most = 0.0;
    needle.go({0, -5e-3, 0}, {0, 30e-3, 0}, 0.01, [&](Vec3, Vec3 force) { most = std::max(most, -force.y); });
    EXPECT_LT(most, 0.1 * cutting);
}

// A table may have walls: forces are the same bits where the scene does not ask for them.
TEST(InnerWalls, AreThereWhereTheSceneAsksForThem)
{
    const SessionModel without = gland(false, false), silent = gland(false, true);
    LoneNeedle one(without), other(silent);
    std::vector<Vec3> forces;
    one.go({0, -2e-3, 0}, {0, 40e-3, 0}, 0.02, [&](Vec3, Vec3 force) { forces.push_back(force); });
    std::size_t at = 0;
    other.go({0, -2e-3, 0}, {0, 40e-3, 0}, 0.02, [&](Vec3, Vec3 force) { ASSERT_EQ(force, forces[at++]); });
    EXPECT_THROW(gland(true, false), std::runtime_error);
}

}  // namespace
}  // namespace palpate::haptics
