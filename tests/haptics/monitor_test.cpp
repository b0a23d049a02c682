#include "slabs.h"

#include <haptics/monitor.h>
#include <haptics/simulation.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <vector>

namespace palpate::haptics {
namespace {

using tests::LoneNeedle;

constexpr double radius = 4e-3;       // of the artery, a ball
const Vec3 middle(1.5e-3, 30e-3, 0);  // of it

// Fat behind 10 mm of gland, with a ball of artery 30 mm deep, a little beside the needle's line.
const SessionModel& withArtery()
{
    static const auto model = tests::boxOf(
        [](Vec3 p) -> std::string {
            if (glm::distance(p, middle) < radius) {
                return "artery";
            }
            return p.x > 20e-3 ? "bone" : p.y < 10e-3 ? "gland" : "fat";
        },
        "bone", tests::chainmailOnly + "[[vital]]\nname = \"artery\"\nwarn_mm = 6\n");
    return model;
}

LookAhead aheadOf(LoneNeedle& needle, MonitorState& state)
{
    return lookAhead(needle.model, needle.reader, needle.body, needle.tip, needle.tool, LoneNeedle::dt, state);
}

// On the needle's line the next tissue begins at its plane, and a ball of radius R is touched by a needle of radius r where
// the line is R + r from its middle: D - sqrt((R + r)^2 - b^2). At a steady speed the time is distance over speed.
TEST(LookAhead, FindsTissueAndStructureOnTheLineInClosedForm)
{
    LoneNeedle needle(withArtery());
    MonitorState state;
    const auto& table = withArtery().tissue->table();
    const double reach = radius + withArtery().scene.tool.radius;
    int looked = 0;
    needle.go({0, -30e-3, 0}, {0, -0.1e-3, 0}, 0.02, [&](Vec3 p, Vec3) {
        const LookAhead found = aheadOf(needle, state);
        EXPECT_NEAR(found.tissueDistance, -p.y, 0.1e-3);
        EXPECT_EQ(found.tissue, *table.find("gland"));
        const double touch = middle.y - p.y - std::sqrt(reach * reach - middle.x * middle.x);
        if (std::abs(touch - channel::lookAheadReach) < 0.3e-3) {
            return;
        }
        if (touch < channel::lookAheadReach) {
            EXPECT_NEAR(found.structure[1], touch, 0.25e-3) << p.y;
            EXPECT_NEAR(found.seconds(found.structure[1]), touch / 0.02, 0.05 * touch / 0.02 + 0.01);
            ++looked;
        } else {
            EXPECT_TRUE(std::isinf(found.structure[1]));
        }
    });
    EXPECT_GT(looked, 300);
    // Inside: from gland into fat. Drawn back nothing comes nearer.
    needle.go({0, -0.1e-3, 0}, {0, 15e-3, 0}, 0.02);
    needle.go({0, 15e-3, 0}, {0, 6e-3, 0}, 0.02, [&](Vec3, Vec3) { aheadOf(needle, state); });
    const LookAhead inside = aheadOf(needle, state);
    EXPECT_EQ(inside.tissue, *table.find("fat"));
    EXPECT_NEAR(inside.tissueDistance, 4e-3, 0.1e-3);
    EXPECT_TRUE(std::isinf(inside.seconds(1e-3)));
}

// A gun of 50 mm reaches farther than what is looked at without it: a coach and a hand must see what it would hit.
TEST(LookAhead, CoversTheThrowOfTheGun)
{
    SessionModel model = withArtery();
    const double reach = radius + model.scene.tool.radius;
    const double touch = middle.y - std::sqrt(reach * reach - middle.x * middle.x);
    for (const double length : {22e-3, 50e-3}) {
        model.scene.tool.throwLength = length;
        LoneNeedle needle(model);
        MonitorState state;
        needle.at({0, -20e-3, 0});
        const double found = aheadOf(needle, state).structure[1];
        if (length < touch) {
            EXPECT_TRUE(std::isinf(found)) << found;
        } else {
            EXPECT_NEAR(found, touch + 20e-3, lookAheadStep);
        }
    }
}

// A hole that a core left from 1 mm outside gland to the middle of fat: the next tissue begins where it ends. One that
// leads into the ball: the ball is touched at its end, inside.
TEST(LookAhead, HolesAreNoTissue)
{
    const auto& table = withArtery().tissue->table();
    for (const double end : {16e-3, 30e-3}) {
        LoneNeedle needle(withArtery());
        MonitorState state;
        needle.tip.needle.cuts.cores.add({{0, -1e-3, 0}, {0, 1, 0}, end + 1e-3, 0.8e-3});
        needle.at({0, -5e-3, 0});
        const LookAhead found = aheadOf(needle, state);
        EXPECT_NEAR(found.tissueDistance, end + 5e-3, 0.1e-3);
        EXPECT_EQ(found.tissue, *table.find(end < 20e-3 ? "fat" : "artery"));
        const double reach = radius + withArtery().scene.tool.radius;
        const double touch = middle.y - std::sqrt(reach * reach - middle.x * middle.x);
        EXPECT_NEAR(found.structure[1], std::max(touch, end) + 5e-3, lookAheadStep);
    }
}

// A line that passes the ball by more than both radii never touches it.
TEST(LookAhead, DoesNotSeeWhatTheLinePasses)
{
    LoneNeedle needle(withArtery());
    MonitorState state;
    const double aside = middle.x - radius - withArtery().scene.tool.radius - 0.5e-3;
    needle.at({aside, -2e-3, 0});
    EXPECT_TRUE(std::isinf(aheadOf(needle, state).structure[1]));
}

int count(const TickRecord& r, EventKind kind)
{
    int n = 0;
    for (std::uint32_t i = 0; i < r.eventCount; ++i) {
        n += r.events[i].kind == kind ? 1 : 0;
    }
    return n;
}

// Near, very near, touch: in this order, each with one event on the way in, at its own distance; and none of them flickers
// when the tip shakes about its limit by less than a tenth.
TEST(Monitor, WarningsComeInOrderAndDoNotFlicker)
{
    LoneNeedle needle(withArtery());
    MonitorState state;
    std::vector<EventKind> kinds;
    std::vector<double> values;
    WarningLevel last = WarningLevel::none;
    const auto look = [&](Vec3 p) {
        needle.at(p);
        monitor(withArtery(), needle.body, needle.tip, needle.tool.position, state, needle.record);
        for (std::uint32_t i = 0; i < needle.record.eventCount; ++i) {
            const Event& e = needle.record.events[i];
            if (e.kind == EventKind::warning || e.kind == EventKind::veryNear || e.kind == EventKind::vitalTouch) {
                kinds.push_back(e.kind);
                values.push_back(e.value);
            }
        }
        EXPECT_GE(needle.record.warning, last);
        last = needle.record.warning;
        EXPECT_EQ(needle.record.warned, last == WarningLevel::none ? 0xFF : 1);
    };
    for (double y = -5e-3; y < 32e-3; y += 2e-5) {
        look({0, y, 0});
    }
    EXPECT_EQ(kinds, (std::vector<EventKind>{EventKind::warning, EventKind::veryNear, EventKind::vitalTouch}));
    EXPECT_EQ(last, WarningLevel::touch);
    EXPECT_NEAR(values.at(0), 6e-3, 0.05e-3);
    EXPECT_NEAR(values.at(1), 2.4e-3, 0.05e-3);

    LoneNeedle shaking(withArtery());
    MonitorState calm;
    int warnings = 0;
    for (int i = 0; i < 4000; ++i) {
        // In the air above it the distance is that of the place.
        TickRecord r;
        TipState tip;
        const double d = 6e-3 * (1.0 + 0.04 * std::sin(0.7 * i) - 1e-5 * i);
        tip.proxy = middle - Vec3(0, radius + d, 0);
        monitor(withArtery(), shaking.body, tip, tip.proxy, calm, r);
        warnings += count(r, EventKind::warning);
    }
    EXPECT_EQ(warnings, 1);
}

// A ball pressed into fat beside a stiff vessel carries the vessel along.
struct Pressed {
    double depth = 0;     // of the tool
    double deformed = 0;  // distance as recorded [m]
    double rest = 0;      // distance where nothing had moved [m]
    double moved = 0;     // how far the vessel went [m]
    double truth = 0;     // smallest distance to the vessel's voxels, each where it is now [m]
};

std::vector<Pressed> pressBesideVessel()
{
    const Vec3 vessel(0, 14e-3, 0);
    const double r = 3e-3;
    const auto model = tests::boxOf(
        [&](Vec3 p) -> std::string {
            return std::hypot(p.x - vessel.x, p.y - vessel.y) < r ? "artery" : p.y > 56e-3 ? "bone" : "fat";
        },
        "bone",
        "[tool]\nkind = \"sphere\"\nradius_mm = 14\n[dffb]\nmode = \"off\"\n[[vital]]\nname = \"artery\"\nwarn_mm = 19\n");
    Simulation simulation(model);
    const auto body = simulation.shape().body(model.surface);
    std::vector<Pressed> out;
    const Vec3 above(2e-3, 0, 0);
    for (int i = 0; i <= 1350; ++i) {
        DeviceSample s;
        s.position = above + Vec3(0, -15e-3 + 1e-5 * i, 0);
        s.buttons = buttonDeadMan;
        const TickRecord& record = simulation.tick(s);
        if (i % 20 != 0) {
            continue;
        }
        Pressed p;
        p.depth = s.position.y + 14e-3;
        p.deformed = record.distance[1];
        p.rest = model.structures[1].distance.distance(s.position);
        p.moved = occupancy::displacementAt(body, vessel).y;
        p.truth = std::numeric_limits<double>::infinity();
        for (double z = -4e-3; z <= 4e-3; z += 0.25e-3) {
            for (int k = 0; k < 180; ++k) {
                const double a = 2 * std::numbers::pi * k / 180;
                const Vec3 at = vessel + Vec3(r * std::cos(a), r * std::sin(a), z);
                p.truth = std::min(p.truth, glm::distance(s.position, at + occupancy::displacementAt(body, at)));
            }
        }
        out.push_back(p);
    }
    return out;
}

// Distances are those of the deformed tissue: against the vessel's surface carried along point by point. So the warning
// comes later than distances at rest would have it, by what the vessel gave way.
TEST(Monitor, WarningMovesWithTheVessel)
{
    const auto pressed = pressBesideVessel();
    double deformedOnset = -1, restOnset = -1;
    for (const Pressed& p : pressed) {
        EXPECT_NEAR(p.deformed, p.truth, 0.1 * p.truth) << p.depth;
        deformedOnset = deformedOnset < 0 && p.deformed < 20e-3 ? p.depth : deformedOnset;
        restOnset = restOnset < 0 && p.rest < 20e-3 ? p.depth : restOnset;
    }
    const Pressed& last = pressed.back();
    std::printf(
        "pressed %.1f mm: vessel moved %.2f mm; distance %.2f mm, point by point %.2f mm, at rest %.2f mm; "
        "20 mm reached %.2f mm deep, at rest %.2f mm\n",
        1e3 * last.depth, 1e3 * last.moved, 1e3 * last.deformed, 1e3 * last.truth, 1e3 * last.rest, 1e3 * deformedOnset,
        1e3 * restOnset);
    EXPECT_GT(last.moved, 3e-3);
    EXPECT_GT(deformedOnset, restOnset + 1e-3);
}

// Into the vessel and through it: the distance goes through zero without a jump.
TEST(Monitor, DistanceIsContinuousThroughTheStructure)
{
    const auto model = tests::boxOf(
        [](Vec3 p) -> std::string {
            return glm::distance(p, middle) < radius ? "fibroadenoma" : p.y > 56e-3 ? "bone" : "fat";
        },
        "bone", "[dffb]\nmode = \"off\"\n[[vital]]\nname = \"fibroadenoma\"\n");
    Simulation simulation(model);
    double before = 0, most = 0;
    bool inside = false;
    for (int i = 0; i < 2400; ++i) {
        DeviceSample s;
        s.position = {1.5e-3, -5e-3 + 2e-5 * i, 0};
        s.buttons = buttonDeadMan;
        const TickRecord& r = simulation.tick(s);
        if (i > 0) {
            most = std::max(most, std::abs(r.distance[1] - before));
        }
        before = r.distance[1];
        inside = inside || before < -1e-3;
    }
    EXPECT_TRUE(inside);
    // The way of a tick, and the half millimetre and more by which a rupture of the wall lets the tip catch up.
    EXPECT_LT(most, 1.2e-3);
}

// Across the middle of a structure the side that is nearer changes: the way out shrinks and grows again, over the cells of
// the distance field and not from one place to the next.
TEST(Proximity, TurnsRoundSmoothlyAcrossTheMiddleOfAStructure)
{
    const SessionModel& model = withArtery();
    LoneNeedle needle(model);
    TipState tip;
    MonitorState state;
    TickRecord record;
    tip.phase = Phase::inserted;
    Vec3 before(0.0);
    double largest = 0.0, longest = 0.0;
    for (double y = -3e-3; y <= 3e-3; y += 0.02e-3) {
        tip.proxy = middle + Vec3(0.1e-3, y, 0.0);
        const Vec3 away = monitor(model, needle.body, tip, tip.proxy, state, record)[1].away;
        largest = y > -3e-3 ? std::max(largest, glm::distance(away, before)) : 0.0;
        longest = std::max(longest, glm::length(away));
        before = away;
    }
    EXPECT_LE(longest, 1.0 + 1e-12);
    EXPECT_GT(longest, 0.9);
    EXPECT_LT(largest, 0.1);
}

}  // namespace
}  // namespace palpate::haptics
