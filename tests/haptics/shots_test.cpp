#include "models.h"
#include "slabs.h"

#include <haptics/broadcast.h>
#include <haptics/score.h>
#include <haptics/simulation.h>

#include <tests/haptics/synthetic_session.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

namespace palpate::haptics {
namespace {

// In the air and on the skin the gun takes no core: one event a press, and viewers know when.
TEST(Shots, AreRefusedOutsideTheBody)
{
    const auto& model = tests::layeredNeedle();
    Simulation simulation(model);
    channel::State shown;
    int refusals = 0;
    const auto tickAt = [&](double tip, std::uint32_t button) {
        const TickRecord& r = simulation.tick({.position = {0, tip, 0}, .buttons = buttonDeadMan | button});
        EXPECT_FALSE(r.fired);
        showTick(r, {}, shown);
        const auto events = std::span(r.events).first(r.eventCount);
        refusals += static_cast<int>(std::ranges::count(events, EventKind::fireRefused, &Event::kind));
    };
    const auto press = [&](double tip) {
        for (const std::uint32_t button : {0U, buttonFire, buttonFire}) {
            tickAt(tip, button);
        }
    };
    tickAt(-10e-3, 0);
    EXPECT_LT(shown.refused, 0);
    press(-10e-3);
    EXPECT_EQ(refusals, 1);
    EXPECT_NEAR(shown.refused, shown.time, 2 * tickSeconds);
    for (double tip = -10e-3; tip < 0.1e-3; tip += 20e-6) {
        tickAt(tip, 0);
    }
    press(0.1e-3);
    EXPECT_EQ(simulation.record().phase, Phase::contact);
    EXPECT_EQ(refusals, 2);
    EXPECT_EQ(shown.cores, 0U);
}

// Before a rib a throw ends, with one event that says how far it got; with the tip at the rib there is no shot.
TEST(Shots, EndAtBoneAndAreRefusedThere)
{
    const auto model = tests::boxOf(tests::layers({{"fat", 18e-3}, {"rib", 8e-3}, {"liver", 1}}), "liver");
    const auto rib = static_cast<std::uint8_t>(*model.tissue->table().find("rib"));
    for (const auto& [deepest, fires] : {std::pair{12e-3, true}, {24e-3, false}}) {
        Simulation simulation(model);
        channel::State shown;
        for (double tip = -5e-3; tip < deepest; tip += 20e-6) {
            simulation.tick({.position = {0, tip, 0}, .buttons = buttonDeadMan});
        }
        const TickRecord& r = simulation.tick({.position = {0, deepest, 0}, .buttons = buttonDeadMan | buttonFire});
        showTick(r, {}, shown);
        EXPECT_EQ(r.phase, Phase::inserted);
        EXPECT_EQ(r.fired, fires);
        EXPECT_EQ(shown.cores, fires ? 1U : 0U);
        const auto events = std::span(r.events).first(r.eventCount);
        const auto stop = std::ranges::find(events, EventKind::throwStopped, &Event::kind);
        const auto refusal = std::ranges::find(events, EventKind::fireRefused, &Event::kind);
        ASSERT_EQ(stop != events.end(), fires);
        ASSERT_EQ(refusal != events.end(), !fires);
        EXPECT_EQ(fires ? stop->tissue : refusal->tissue, rib);
        EXPECT_EQ(fires ? shown.stoppedBy : shown.refusedBy, rib);
        EXPECT_EQ(shown.stopped >= 0, fires);
        EXPECT_EQ(shown.refused >= 0, !fires);
        if (fires) {
            EXPECT_NEAR(stop->value, 6e-3, 1.5e-3);
            EXPECT_EQ(shown.thrown, stop->value);
            EXPECT_EQ(r.core.targetFraction, 0.0);
            EXPECT_NEAR(glm::distance(r.tip(), r.core.notchEnd), stop->value, 0.05e-3);
        }
    }
}

// The best core stays the best, whatever comes after it.
TEST(Shots, ViewersKnowTheBestCoreAndTheLast)
{
    channel::State shown;
    TickRecord r;
    r.fired = true;
    for (const double fraction : {0.0, 0.57, 0.2}) {
        r.core.targetFraction = fraction;
        showTick(r, {}, shown);
    }
    EXPECT_EQ(shown.cores, 3U);
    EXPECT_EQ(shown.coreTarget, 0.2);
    EXPECT_EQ(shown.bestCore, 2U);
    EXPECT_EQ(shown.bestTarget, 0.57);
}

// A second in the air and a second inside; an artery (structure 1) lies 0.8 mm from the tip for 0.2 s of that, and in the
// air 0.5 mm. With one event, `depth` deep.
Score scoreBesideArtery(const char* radius, double nearest, double depth)
{
    SessionInfo info = synthetic::info();
    info.extra.emplace_back(toolRadiusKey, radius);
    Scorer scorer(info);
    for (std::uint64_t n = 0; n < 2000; ++n) {
        TickRecord tick;
        tick.tick = n;
        tick.phase = n < 1000 ? Phase::free : Phase::inserted;
        tick.inserted = n < 1000 ? 0 : 0.02;
        tick.distance = {0.1, n == 500 ? 0.5e-3 : n >= 1500 && n < 1700 ? nearest : 0.1, 0.1};
        if (n == 1500) {
            synthetic::addEvent(tick, synthetic::event(EventKind::vitalTouch, 1, 0, depth));
        }
        scorer.add(tick);
    }
    return scorer.score();
}

// A needle of 1 mm whose axis passes an artery at 0.8 mm touches it with its surface, 0.2 mm deep: the touch, its time, its
// depth and the margin say the same. In the air only the tip touches.
TEST(Score, TouchTimeDepthAndMarginAreThoseOfTheNeedlesSurface)
{
    const Score s = scoreBesideArtery("1", 0.8e-3, 0.2e-3);
    EXPECT_EQ(s.vitalContacts, 1U);
    EXPECT_DOUBLE_EQ(s.vitalSeconds, 0.2);
    EXPECT_NEAR(s.vitalDepth, 0.2e-3, 1e-12);
    EXPECT_NEAR(s.vitalMargin, -0.2e-3, 1e-12);
    // Records from before say no radius: the tip's distance counts, and what the touch says of itself.
    const Score old = scoreBesideArtery("?", 0.8e-3, 0.2e-3);
    EXPECT_EQ(old.vitalSeconds, 0.0);
    EXPECT_DOUBLE_EQ(old.vitalMargin, -0.2e-3);
}

// The throw leaves the tip where it is: what it reaches is in its event alone.
TEST(Score, AThrowIntoAVesselLeavesNoMargin)
{
    const Score s = scoreBesideArtery("1", 5e-3, 1.3e-3);
    EXPECT_DOUBLE_EQ(s.vitalDepth, 1.3e-3);
    EXPECT_DOUBLE_EQ(s.vitalMargin, -1.3e-3);
    EXPECT_EQ(s.vitalSeconds, 0.0);
}

}  // namespace
}  // namespace palpate::haptics
