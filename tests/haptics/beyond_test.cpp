// What the score says of the way of a needle beyond its target.
#include "synthetic_session.h"

#include <haptics/score.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

namespace palpate::haptics {
namespace {

// The tissue goes back and forth with the needle: a capsule that gives way in front of the target, or a shaft that is let
// go when the gun has fired, is not beyond it.
TEST(Score, WhatIsStillAheadOfTheTipIsNotBehindIt)
{
    const auto beyond = [](double distance, double ahead) {
        Scorer scorer(synthetic::info());
        TickRecord tick;
        tick.phase = Phase::inserted;
        tick.distance.fill(1);
        for (const auto& [inserted, from, on] : {std::tuple(53.4, 2.0, 2.0), {57.4, distance, ahead}}) {
            tick.inserted = inserted * 1e-3;
            tick.device.position = {0, 0, -inserted * 1e-3};
            tick.distance[0] = from * 1e-3;
            tick.ahead.structure[0] = on * 1e-3;
            scorer.add(tick);
            ++tick.tick;
        }
        return scorer.score().beyondTarget / 1e-3;
    };
    // After a shot the shaft slides on by 4 mm, and is pushed by another 20.
    const auto afterShot = [](double targetLength, double pushed) {
        Scorer scorer(synthetic::info());
        TickRecord tick;
        tick.phase = Phase::inserted;
        tick.fired = true;
        tick.core.targetLength = targetLength * 1e-3;
        tick.distance.fill(1);
        for (const auto& [inserted, hand] : {std::pair(43.0, 0.0), {47.0, 0.0}, {47.0 + pushed, pushed}}) {
            tick.inserted = inserted * 1e-3;
            tick.distance[0] = (inserted - 36.0) * 1e-3;
            tick.device.position = {0, 0, -hand * 1e-3};
            scorer.add(tick);
            ++tick.tick;
            tick.fired = false;
        }
        return scorer.score().beyondTarget / 1e-3;
    };
    EXPECT_NEAR(afterShot(11.0, 0.0), 0.0, 1e-9);
    EXPECT_NEAR(afterShot(11.0, 20.0), 13.0, 1e-9);
    EXPECT_NEAR(afterShot(0.0, 0.0), 0.0, 1e-9) << "a miss";
    EXPECT_NEAR(afterShot(0.0, 20.0), 20.0, 1e-9) << "a miss";

    // A miss, after which the shaft slides on by 4 mm; a second shot, and the hand has stood still since the first.
    Scorer twice(synthetic::info());
    TickRecord shot;
    shot.phase = Phase::inserted;
    shot.distance.fill(1);
    for (const auto& [inserted, fired] :
         {std::pair(38.0, false), {43.0, true}, {47.0, false}, {47.0, true}, {51.0, false}}) {
        shot.inserted = inserted * 1e-3;
        shot.device.position = {0, 0, -std::min(inserted, 43.0) * 1e-3};
        shot.distance[0] = (inserted - 36.0) * 1e-3;
        shot.fired = fired;
        twice.add(shot);
        ++shot.tick;
    }
    EXPECT_NEAR(twice.score().beyondTarget, 5.0 * 1e-3, 1e-9) << "a slide that the first shot has excused";

    constexpr double nowhere = std::numeric_limits<double>::infinity();
    EXPECT_NEAR(beyond(3.8, 3.0), 0.0, 1e-9);
    EXPECT_NEAR(beyond(2.5, nowhere), 2.5, 1e-9);
    EXPECT_NEAR(beyond(9.0, nowhere), 4.0, 1e-9);
}

// Skin gives way under the needle, 62 mm before a target that its line meets beyond what it looks ahead: the tissue springs
// back over the shaft by 5 mm, away from a hand that goes on by 0.2 mm. That is no depth beyond the target.
TEST(Score, TissueThatSpringsBackOverTheShaftIsNoPush)
{
    Scorer scorer(synthetic::info());
    TickRecord tick;
    tick.ahead.structure.fill(std::numeric_limits<double>::infinity());
    tick.distance.fill(1);
    for (int i = 0; i < 40; ++i, ++tick.tick) {
        tick.phase = Phase::inserted;
        tick.device.position = Vec3(0.0, 0.02e-3 * i, 0.0);
        tick.inserted = 0.02e-3 * i + (i < 20 ? 0.0 : 5e-3);
        tick.distance[0] = 62e-3 - 0.02e-3 * i + (i < 20 ? 0.0 : 0.3e-3);
        scorer.add(tick);
    }
    EXPECT_LT(scorer.score().beyondTarget, 0.4e-3);
}

}  // namespace
}  // namespace palpate::haptics
