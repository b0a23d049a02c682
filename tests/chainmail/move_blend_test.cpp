// The force of a tool over moves of the windows.
#include <chainmail/move_blend.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::chainmail {
namespace {

// A tool that is led along x, under a force that the windows give it.
struct Slid {
    MoveBlend blend;
    Vec3 at{0.0}, last{0.0};
    double step = 0;  // largest change of the force that is felt, in a tick [N]

    Vec3 tick(Vec3 force, double way, bool moved = false)
    {
        at.x += way;
        blend.count(force, at, moved);
        const Vec3 felt = force + blend.offset();
        step = last == Vec3(0.0) ? 0.0 : std::max(step, glm::distance(felt, last));
        return last = felt;
    }
};

constexpr double atTwenty = 20e-6;  // way of a tick at 20 mm/s [m]

// Windows whose force is 5 % more when they have moved, in parts over three ticks: no tick changes what is felt by over 0.3
// %, and after a tenth of a second it is theirs.
TEST(MoveBlend, AMoveOfTheWindowsComesByAndBy)
{
    Slid tool;
    for (int i = 0; i < 50; ++i) {
        tool.tick(Vec3(0, -1, 0), atTwenty);
    }
    tool.step = 0.0;
    tool.tick(Vec3(0, -1.03, 0), atTwenty, true);
    tool.tick(Vec3(0, -1.06, 0), atTwenty);
    for (int i = 0; i < 150; ++i) {
        tool.tick(Vec3(0, -1.05, 0), atTwenty);
    }
    EXPECT_LT(tool.step, 3e-3);
    EXPECT_NEAR(tool.last.y, -1.05, 1e-3);
}

// A force that grows evenly with the way is felt as it is, when the windows move too, and when the tool turns back.
TEST(MoveBlend, AnEvenSlopeIsLeftAsItIs)
{
    Slid tool;
    double x = 0.0;
    for (int i = 0; i < 400; ++i) {
        const double way = i < 203 ? atTwenty : -atTwenty;
        x += way;
        const Vec3 force(0.0, -1.0 - 100.0 * x, 0.0);
        EXPECT_NEAR(glm::distance(tool.tick(force, way, i % 100 == 99), force), 0.0, 2e-4) << i;
    }
}

// What changes by more than a tenth of the force is felt at once, and without a move everything is.
TEST(MoveBlend, WhatIsLargeOrNoMoveIsFelt)
{
    Slid tool;
    for (int i = 0; i < 50; ++i) {
        tool.tick(Vec3(0, -1, 0), atTwenty);
    }
    EXPECT_EQ(tool.tick(Vec3(0, -3, 0), atTwenty).y, -3.0);
    EXPECT_LE(tool.tick(Vec3(0, -6, 0), atTwenty, true).y, -0.9 * 6.0);
    EXPECT_EQ(tool.tick(Vec3(0.0), atTwenty, true), Vec3(0.0));
    EXPECT_EQ(tool.tick(Vec3(0, -2, 0), atTwenty).y, -2.0);
}

// A tool five times as fast is through the blend in a fifth of the ticks.
TEST(MoveBlend, CountsByTheWay)
{
    for (const int speed : {1, 5}) {
        Slid tool;
        for (int i = 0; i < 50; ++i) {
            tool.tick(Vec3(0, -1, 0), speed * atTwenty);
        }
        tool.tick(Vec3(0, -1.05, 0), speed * atTwenty, true);
        int ticks = 1;
        while (std::abs(tool.tick(Vec3(0, -1.05, 0), speed * atTwenty).y + 1.05) > 0.05 * std::exp(-1.0)) {
            ++ticks;
        }
        EXPECT_NEAR(ticks * speed, 32, 5) << speed;
    }
}

}  // namespace
}  // namespace palpate::chainmail
