#include "slabs.h"

#include <haptics/biopsy.h>
#include <haptics/needle.h>
#include <haptics/simulation.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <random>
#include <vector>

namespace palpate::haptics {
namespace {

using tests::LoneNeedle;
using tests::rowOf;

const SessionModel& layered()
{
    static const auto model = tests::boxOf(
        tests::layers(
            {{"skin", 2e-3}, {"fat", 12e-3}, {"gland", 10e-3}, {"idc_high_grade", 8e-3}, {"gland", 10e-3}, {"muscle", 1}}),
        "idc_high_grade", tests::chainmailOnly);
    return model;
}

// Homogeneous, with a target out of the way.
SessionModel blockOf(const std::string& tissue, const volume::TissueTable& table = datasets::defaultTissues(),
                     const std::string& tool = {})
{
    return tests::boxOf([&](Vec3 p) { return p.x > 20e-3 && p.y > 50e-3 ? std::string("bone") : tissue; }, "bone",
                        tool + tests::chainmailOnly, table);
}

struct Peak {
    std::string tissue;
    double force = 0;
};

// Every boundary on the way in: the tip carries max(cutting force behind it, puncture force ahead) there.
TEST(Needle, ForceAgainstDepthShowsEveryBoundary)
{
    LoneNeedle needle(layered());
    std::vector<Peak> peaks;
    std::uint8_t before = 0;
    needle.go({0, -2e-3, 0}, {0, 55e-3, 0}, 0.01, [&](Vec3, Vec3) {
        for (std::uint32_t i = 0; i < needle.record.eventCount; ++i) {
            const Event& e = needle.record.events[i];
            if (e.kind == EventKind::puncture) {
                const auto& rows = layered().tissue->table().rows;
                const double holds = std::max(rows[e.tissue].punctureForce, before != 0 ? rows[before].cuttingForce : 0.0);
                EXPECT_GE(e.value, 0.96 * holds) << rows[e.tissue].name;
                // 2 mm of skin: its rupture runs on into the fat.
                if (rows[e.tissue].name != "fat") {
                    EXPECT_NEAR(e.value, holds, 0.04 * holds + 0.01) << rows[e.tissue].name;
                }
                peaks.push_back({rows[e.tissue].name, e.value});
                before = e.tissue;
            }
        }
    });
    std::vector<std::string> names;
    for (const auto& peak : peaks) {
        names.push_back(peak.tissue);
    }
    EXPECT_EQ(names, (std::vector<std::string>{"skin", "fat", "gland", "idc_high_grade", "gland", "muscle"}));
}

// The surface of a body is smooth, its voxels are not: wherever the needle touches skin that lies turned in the grid, it
// has to pierce the skin, and no voxel of air under the surface.
TEST(Needle, TurnedSkinIsPiercedEverywhere)
{
    const auto model = tests::boxOf(
        [](Vec3 p) {
            const double depth = p.y - 12e-3 - 0.4 * p.x - 0.3 * p.z;
            return std::string(p.x > 20e-3 && p.y > 50e-3 ? "bone" : depth < 0 ? "air" : depth < 2e-3 ? "skin" : "fat");
        },
        "bone", tests::chainmailOnly);
    const auto skin = *model.tissue->table().find("skin");
    for (int i = 0; i < 100; ++i) {
        const double x = 1e-3 * (0.17 * i - 8.5), z = 1e-3 * (7.0 - 0.13 * i);
        LoneNeedle needle(model);
        std::vector<Event> pierced;
        needle.go({x, -5e-3, z}, {x, 25e-3, z}, 0.05, [&](Vec3, Vec3) {
            const auto* const events = needle.record.events.data();
            std::copy_if(events, events + needle.record.eventCount, std::back_inserter(pierced),
                         [](const Event& e) { return e.kind == EventKind::puncture; });
        });
        ASSERT_FALSE(pierced.empty()) << x << ' ' << z;
        EXPECT_EQ(pierced[0].tissue, skin) << x << ' ' << z;
        EXPECT_GE(pierced[0].value, model.tissue->table().rows[skin].punctureForce) << x << ' ' << z;
    }
}

// Two slabs of fat of 10 mm with 20 mm of air between: beyond the first only friction holds, over what is in it, and the
// second is pierced like the first.
TEST(Needle, BeyondTheFarSideOnlyTheShaftIsHeld)
{
    const auto model = tests::boxOf(
        [](Vec3 p) {
            const bool target = p.x > 20e-3 && p.y > 50e-3;
            return std::string(target ? "bone" : p.y < 10e-3 || (p.y > 30e-3 && p.y < 40e-3) ? "fat" : "air");
        },
        "bone", tests::chainmailOnly);
    const auto& fat = rowOf(model, "fat");
    constexpr double speed = 20e-3, slab = 10e-3;
    LoneNeedle needle(model);
    int punctures = 0;
    const auto count = [&](Vec3, Vec3) { punctures += needle.punctures(); };
    needle.go({0, -2e-3, 0}, {0, 26e-3, 0}, speed, count);
    EXPECT_EQ(punctures, 1);
    EXPECT_EQ(needle.tip.tissue, 0);
    EXPECT_NEAR(needle.tip.needle.inTissue(), slab, 0.5e-3);
    const double held = slab * (fat.frictionPerMetre + fat.frictionDamping * speed);
    EXPECT_NEAR(-needle.at({0, 26.02e-3, 0}).y, held, 0.15 * held);
    needle.go({0, 26e-3, 0}, {0, 48e-3, 0}, speed, count);
    EXPECT_EQ(punctures, 2);
    EXPECT_NEAR(needle.tip.needle.inTissue(), 2.0 * slab, 0.8e-3);
    needle.go({0, 48e-3, 0}, {0, 5e-3, 0}, speed, count);
    EXPECT_EQ(punctures, 2);
    EXPECT_EQ(needle.tip.tissue, *model.tissue->table().find("fat"));
    EXPECT_NEAR(needle.tip.needle.inTissue(), needle.tip.proxy.y, 0.3e-3);
}

// The gun opens the way out of the body; a needle that is pushed on there is in air, as one that has cut its way.
TEST(Needle, OutByAWayThatTheGunHasOpenedItIsInAir)
{
    const auto model = tests::boxOf([](Vec3 p) { return std::string(p.x > 20e-3   ? "bone"
                                                                    : p.y < 20e-3 ? "fat"
                                                                                  : "air"); },
                                    "bone", tests::chainmailOnly);
    LoneNeedle needle(model);
    constexpr double speed = 20e-3;
    needle.go({0, -2e-3, 0}, {0, 14e-3, 0}, speed, [](Vec3, Vec3) {});
    const auto core = takeCore(model, needle.reader, needle.body, {}, {0, 14e-3, 0}, {0, 1, 0});
    removeCore(model, needle.body, core, {0, 14e-3, 0}, needle.tip.needle.cuts);
    needle.go({0, 14e-3, 0}, {0, 32e-3, 0}, speed, [](Vec3, Vec3) {});
    EXPECT_EQ(needle.tip.tissue, 0);
    EXPECT_NEAR(needle.tip.needle.inserted, 32e-3, 0.5e-3);
    EXPECT_NEAR(needle.tip.needle.inTissue(), 20e-3, 0.6e-3);
}

// A needle that turns about its resting tip is as deep as before, and nothing pulls at its shaft. The tip's own push turns
// with it.
TEST(Needle, ATurnAboutTheTipMovesNothingAlongTheShaft)
{
    const auto model = blockOf("fat");
    LoneNeedle needle(model);
    const Vec3 deep(0, 30e-3, 0);
    needle.go({0, -2e-3, 0}, deep, 0.02);
    const double inserted = needle.tip.needle.inserted, before = needle.at(deep).y;
    double most = 0.0;
    for (int i = 0; i <= 1000; ++i) {
        const double angle = std::numbers::pi / 6.0 * i / 1000.0;
        const Vec3 axis(std::sin(angle), std::cos(angle), 0.0);
        most = std::max(most, std::abs(glm::dot(needle.at(deep, axis), axis) - before));
        EXPECT_NEAR(needle.tip.needle.inserted, inserted, 0.02e-3) << angle;
    }
    EXPECT_LT(most, 0.1 * std::abs(before));
}

// Bovine liver as Simone and Okamura (2002) and Okamura et al. (2004) found it, in the figures of docs/score.md's sources:
// 0.0020 z + 0.0023 z^2 N before the capsule breaks, then about 0.94 N and 10 to 19 N per metre; a model is good when it is
// within 0.2 N (Barnett 2015). Their liver is 2 kPa under the depth law for a needle 1 mm across.
TEST(Needle, LiverLiesWithinTheSpreadOfThePublishedCurve)
{
    auto table = datasets::defaultTissues();
    table.rows[*table.find("liver")].youngsModulus = 2e3;
    const auto model = blockOf("liver", table, "[tool]\nkind = \"needle\"\nradius_mm = 0.5\nnotch_radius_mm = 0.4\n");
    LoneNeedle needle(model);
    double pierced = 0.0;
    needle.go({0, -2e-3, 0}, {0, 50e-3, 0}, 0.003, [&](Vec3 p, Vec3 force) {
        const double z = 1e3 * p.y;
        if (needle.tip.phase == Phase::contact) {
            EXPECT_NEAR(-force.y, 0.0020 * z + 0.0023 * z * z, 0.2) << z;
        }
        pierced = needle.punctures() > 0 ? p.y : pierced;
        if (pierced > 0.0 && p.y > pierced + 6e-3) {
            const double shaft = needle.tip.needle.inserted;
            EXPECT_GT(-force.y, 0.94 + 10.0 * shaft - 0.2) << z;
            EXPECT_LT(-force.y, 0.94 + 19.0 * shaft + 0.2) << z;
        }
    });
    EXPECT_GT(pierced, 5e-3);
}

// A rupture lets go towards the tissue: at any speed and angle the force along the needle never changes sign on the way in,
// and from a puncture to the cutting force it only falls.
TEST(Needle, RuptureNeverPushesTheHandOn)
{
    for (const double speed : {0.005, 0.05, 0.2}) {
        for (const double slant : {0.0, 0.3}) {
            const Vec3 axis = glm::normalize(Vec3(slant, 1.0, 0.0));
            LoneNeedle needle(layered());
            double before = 0.0;
            bool falling = false;
            needle.go(
                -3e-3 * axis, 45e-3 * axis, speed,
                [&](Vec3, Vec3 force) {
                    EXPECT_GE(-glm::dot(force, axis), -1e-12);
                    const double tip = -glm::dot(force, axis) - needle.tip.needle.shaftForce;
                    const auto& here = layered().tissue->table().rows[needle.tip.tissue];
                    if (falling && needle.punctures() == 0) {
                        EXPECT_LE(tip, before + 1e-3) << speed;
                    }
                    falling = needle.punctures() > 0 || (falling && tip > here.cuttingForce + 1e-9);
                    before = tip;
                },
                axis);
        }
    }
}

// The needle only takes energy: over any path of the hand, what it has given back in all never exceeds what was put in.
TEST(Needle, GivesNoMoreEnergyThanItGot)
{
    for (const unsigned seed : {1U, 2U, 3U, 4U, 5U, 6U}) {
        std::mt19937 random(seed);
        std::uniform_real_distribution<double> pick(0.0, 1.0);
        LoneNeedle needle(layered());
        Vec3 p(0, -3e-3, 0), lastForce(0.0);
        double given = 0.0, most = 0.0;
        for (int stroke = 0; stroke < 60; ++stroke) {
            const Vec3 to(6e-3 * (pick(random) - 0.5), -3e-3 + 45e-3 * pick(random), 6e-3 * (pick(random) - 0.5));
            needle.go(p, to, 0.01 + 0.2 * pick(random), [&](Vec3 x, Vec3 force) {
                given += 0.5 * glm::dot(force + lastForce, x - p);
                p = x;
                lastForce = force;
                most = std::max(most, given);
            });
        }
        EXPECT_LT(given, -1e-2);
        EXPECT_LT(most, 2e-5) << seed;
    }
}

// The same in and out of fat that holds a shaft a hundred times as much: where the tip breaks in, the shaft is loaded no
// more than the tissue is stretched along it. With the whole friction at once the hand was given 0.2 J.
TEST(Needle, RoughTissueGivesNoMoreEnergyThanItGot)
{
    auto table = datasets::defaultTissues();
    auto& fat = table.rows[*table.find("fat")];
    fat.frictionPerMetre *= 100.0;
    fat.stictionPerMetre *= 100.0;
    const auto model = blockOf("fat", table);
    LoneNeedle needle(model);
    double given = 0.0, most = 0.0;
    Vec3 p(0, -3e-3, 0), lastForce(0.0);
    for (const double deep : {40e-3, -5e-3}) {
        needle.go(p, {0, deep, 0}, 0.02, [&](Vec3 x, Vec3 force) {
            given += 0.5 * glm::dot(force + lastForce, x - p);
            p = x;
            lastForce = force;
            most = std::max(most, given);
        });
    }
    EXPECT_LT(given, -1e-3);
    EXPECT_LT(most, 2e-5);
}

struct Slip {
    double place = 0;         // of the tip [m]
    double length = 0;        // of the shaft inside [m]
    double from = 0, to = 0;  // friction [N]
};

// Where the friction drops on the way back. What the proxy gives with it counts as the same slip.
std::vector<Slip> slipsOnTheWay(LoneNeedle& needle, double from, double to, double speed)
{
    std::vector<Slip> slips;
    double before = 0.0, length = 0.0;
    needle.go({0, from, 0}, {0, to, 0}, speed, [&](Vec3 p, Vec3 force) {
        const bool again = !slips.empty() && slips.back().place - p.y < 1e-3;
        if (before > 0.0 && force.y < before - 0.02 && !again) {
            slips.push_back({p.y, length, before, force.y});
        }
        before = force.y;
        length = needle.tip.needle.inserted;
    });
    return slips;
}

// Pulled back slowly, the shaft sticks: the force changes by the tissue's stiffness times the way, tissue in tow, up to the
// stiction of the inserted length, then breaks loose to the sliding friction. Below the window it sticks again and again,
// with a period of (stiction - friction) / stiffness.
TEST(Needle, ShaftSticksAndSlips)
{
    const auto model = blockOf("fat");
    const auto& fat = rowOf(model, "fat");
    LoneNeedle needle(model);
    needle.go({0, -2e-3, 0}, {0, 40e-3, 0}, 0.02);
    std::vector<Slip> slips = slipsOnTheWay(needle, 40e-3, 15e-3, 0.001);
    ASSERT_GE(slips.size(), 3U);
    for (const Slip& slip : slips) {
        EXPECT_NEAR(slip.from, fat.stictionPerMetre * slip.length, 0.01 * slip.from);
        EXPECT_NEAR(slip.to, fat.frictionPerMetre * slip.length, 0.01 * slip.from);
    }
    constexpr double nu = 0.49;
    const double length = slips[1].length;
    const double g = fat.youngsModulus / (2 * (1 + nu));
    const double k = 2 * std::numbers::pi * g * length / std::log(2.5 * length * (1 - nu) / 1.05e-3);
    const double period = (fat.stictionPerMetre - fat.frictionPerMetre) * length / k;
    EXPECT_NEAR(slips[0].place - slips[1].place, period, 0.1 * period);

    LoneNeedle fast(model);
    fast.go({0, -2e-3, 0}, {0, 40e-3, 0}, 0.02);
    EXPECT_EQ(slipsOnTheWay(fast, 40e-3, 15e-3, 0.02).size(), 1U);
}

// Nothing to be felt at 1 kHz while a needle rests: the hand's tremor of a tenth of a millimetre stays within stiction.
TEST(Needle, RestingShaftSticks)
{
    const auto model = blockOf("fat");
    LoneNeedle needle(model);
    needle.go({0, -2e-3, 0}, {0, 30e-3, 0}, 0.02);
    needle.go({0, 30e-3, 0}, {0, 25e-3, 0}, 0.002);
    for (int i = 0; i < 500; ++i) {
        needle.at({0, 25e-3, 0});
    }
    const double k = needle.tip.needle.shaftStiffness;
    const double held = needle.at({0, 25e-3, 0}).y;
    for (int i = 0; i < 200; ++i) {
        const double way = 5e-5 * std::sin(0.05 * i);
        EXPECT_NEAR(needle.at({0, 25e-3 + way, 0}).y, held - k * way, 0.02 * k * 5e-5 + 1e-9);
    }
}

// The tissue around a shaft that sticks goes with it: the deformation sees it.
TEST(Needle, ShaftCarriesTheTissueAlong)
{
    const auto model =
        tests::boxOf([](Vec3 p) { return p.x > 20e-3 && p.y > 50e-3 ? std::string("bone") : std::string("fat"); }, "bone",
                     "[dffb]\nmode = \"off\"\n");
    Simulation simulation(model);
    const auto go = [&](double from, double to, double speed) {
        const int ticks = static_cast<int>(std::abs(to - from) / (speed * 1e-3));
        for (int i = 0; i <= ticks; ++i) {
            DeviceSample s;
            s.position = {0, from + (to - from) * i / ticks, 0};
            s.buttons = buttonDeadMan;
            simulation.tick(s);
        }
    };
    const auto besideShaft = [&](double depth) {
        const auto& grid = model.lattice.grid;
        const Index3 n(glm::round((Vec3(0, depth, 0) - grid.origin) / grid.spacing));
        return static_cast<double>(simulation.shape().u()[grid.offset(n)].y);
    };
    go(-2e-3, 30e-3, 0.02);
    const double pushed = besideShaft(15e-3);
    go(30e-3, 19e-3, 0.002);
    EXPECT_GT(pushed, 1e-3);
    EXPECT_LT(besideShaft(15e-3), -1e-3);
}

// In, all the way out, and in again: the same path meets no cutting force and no puncture, 3 mm beside it is as the first
// time.
TEST(Needle, PathStaysCutAndTissueBesideItIsWhole)
{
    LoneNeedle needle(layered());
    struct Way {
        int punctures = 0;
        double tip = 0;
    };
    const auto insert = [&](Vec3 entry, double depth) {
        Way way;
        needle.go(entry + Vec3(0, -5e-3, 0), entry + Vec3(0, depth, 0), 0.02, [&](Vec3, Vec3 force) {
            way.punctures += needle.punctures();
            way.tip = std::max(way.tip, -force.y - std::abs(needle.tip.needle.shaftForce));
        });
        needle.go(entry + Vec3(0, depth, 0), entry + Vec3(0, -5e-3, 0), 0.02);
        EXPECT_EQ(needle.tip.phase, Phase::free);
        return way;
    };
    const Way first = insert({0, 0, 0}, 35e-3);
    const Way again = insert({0.3e-3, 0, 0.2e-3}, 25e-3);
    const Way beside = insert({3e-3, 0, 0}, 35e-3);
    EXPECT_EQ(first.punctures, 4);
    EXPECT_EQ(again.punctures, 0);
    EXPECT_LT(again.tip, 0.05 * first.tip);
    EXPECT_EQ(beside.punctures, first.punctures);
    EXPECT_NEAR(beside.tip, first.tip, 0.02 * first.tip);
}

// A tip that is led sideways to bone stays beside it, and the force goes on growing where fat would give way.
TEST(Needle, BoneBesideTheTipHoldsIt)
{
    const auto model = tests::boxOf([](Vec3 p) { return std::string(p.x > 8e-3 && p.y > 5e-3 ? "bone" : "fat"); }, "bone",
                                    tests::chainmailOnly);
    const auto bone = *model.tissue->table().find("bone");
    LoneNeedle needle(model);
    needle.go({0, -2e-3, 0}, {0, 20e-3, 0}, 0.02);
    double most = 0.0;
    needle.go({0, 20e-3, 0}, {7e-3, 20e-3, 0}, 0.02, [&](Vec3, Vec3 force) { most = std::max(most, std::abs(force.x)); });
    double before = most;
    needle.go({7e-3, 20e-3, 0}, {20e-3, 20e-3, 0}, 0.02, [&](Vec3, Vec3 force) {
        ASSERT_NE(needle.reader.tissue(needle.tip.proxy), bone);
        EXPECT_GT(-force.x, 0.9 * before);
        before = -force.x;
    });
    EXPECT_GT(before, 1.5 * most);
}

// The ends of what is open ahead, in closed form: along a path to its end, across it to its wall, and from one into the
// next.
TEST(Needle, OpenLengthAheadInClosedForm)
{
    Cuts cuts;
    cuts.cores.add({{0, 0, 0}, {0, 1, 0}, 20e-3, 1e-3});
    EXPECT_NEAR(openAhead(cuts, {0.5e-3, 5e-3, 0}, {0, 1, 0}), 15e-3, 1e-12);
    EXPECT_NEAR(openAhead(cuts, {0.5e-3, 5e-3, 0}, {0, -1, 0}), 5e-3, 1e-12);
    EXPECT_NEAR(openAhead(cuts, {0.6e-3, 5e-3, 0}, {0, 0, 1}), 0.8e-3, 1e-12);
    EXPECT_EQ(openAhead(cuts, {1.1e-3, 5e-3, 0}, {0, 1, 0}), 0.0);
    cutPath(cuts, {0, 20e-3, 0}, {0, 25e-3, 0}, 0.5e-3);
    cutPath(cuts, {0, 25e-3, 0}, {0, 30e-3, 0}, 0.5e-3);
    EXPECT_EQ(cuts.paths.all().size(), 1U);
    EXPECT_NEAR(openAhead(cuts, {0, 5e-3, 0}, {0, 1, 0}), 25e-3, 1e-12);
}

// A bevelled needle follows an arc: its tip is off the device's line by curvature inserted^2 / 2, into any direction across
// it, and back on it when withdrawn. Without a bevel it is the device's pose, to the bit.
TEST(Needle, BevelledNeedleFollowsAnArc)
{
    for (const double turn : {0.0, 90.0}) {
        const auto model = blockOf("fat", datasets::defaultTissues(),
                                   "[tool]\nkind = \"needle\"\nradius_mm = 0.36\nnotch_radius_mm = 0.3\nbevel_deg = 20\n"
                                   "bevel_turn_deg = " +
                                       std::to_string(turn) + "\n");
        const double curvature = bendCurvature(model.scene.tool, rowOf(model, "fat"));
        EXPECT_GT(curvature, 0.5);
        LoneNeedle needle(model);
        needle.go({0, -2e-3, 0}, {0, 50e-3, 0}, 0.02, [&](Vec3 p, Vec3) {
            const double s = std::max(needle.tip.needle.inserted, 0.0);
            EXPECT_NEAR(glm::distance(needle.tool.position, p), 0.5 * curvature * s * s, 0.02 * curvature * s * s + 2e-5);
        });
        const Vec3 off = needle.tool.position - Vec3(0, 50e-3, 0);
        EXPECT_LT(std::abs(off.y), 1e-12);
        EXPECT_NEAR(std::abs(turn == 0.0 ? off.x : off.z), 0.0, 1e-12);
        EXPECT_GT(glm::length(off), 1e-3);
        needle.go({0, 50e-3, 0}, {0, -2e-3, 0}, 0.02);
        EXPECT_EQ(needle.tip.needle.curvature, 0.0);
    }
    LoneNeedle straight(layered());
    straight.go({0, -2e-3, 0}, {0, 40e-3, 0}, 0.02, [&](Vec3 p, Vec3) {
        EXPECT_EQ(straight.tool.position, p);
        EXPECT_EQ(straight.tool.axis, Vec3(0, 1, 0));
    });
}

// The curvature in closed form, 2 P / k (k / 4 B)^(3/4): over 5 cm of fat with a bevel of 20 degrees a needle of 14 G is
// 0.16 mm aside, one of 22 G 3.9 mm.
TEST(Needle, ThinNeedlesBendFarMore)
{
    const auto fat = datasets::defaultTissues().rows[*datasets::defaultTissues().find("fat")];
    const auto aside = [&](double radius) {
        datasets::ToolSpec tool;
        tool.radius = radius;
        tool.bevel = std::numbers::pi / 9;
        return 0.5 * bendCurvature(tool, fat) * 0.05 * 0.05;
    };
    EXPECT_NEAR(aside(1.05e-3), 0.16e-3, 0.005e-3);
    EXPECT_NEAR(aside(0.36e-3), 3.9e-3, 0.05e-3);
    // P and k are the tissue's, B goes as the fourth power of the radius.
    EXPECT_NEAR(aside(0.5e-3) / aside(1e-3), 8.0, 1e-9);
}

// Through puncture, firing and withdrawal at hostile speeds the force stays under the cap and changes by no more than 5 %
// of it per tick and channel.
TEST(Needle, CapAndSlewHoldThroughPunctureFiringAndWithdrawal)
{
    for (const double speed : {0.02, 0.3, 3.0}) {
        Simulation simulation(layered());
        Vec3 before(0.0);
        bool fired = false;
        const auto go = [&](double from, double to, std::uint32_t buttons) {
            const int ticks = std::max(20, static_cast<int>(std::abs(to - from) / (speed * 1e-3)));
            for (int i = 0; i <= ticks; ++i) {
                DeviceSample s;
                s.position = {0, from + (to - from) * i / ticks, 0};
                s.buttons = buttonDeadMan | buttons;
                const TickRecord& r = simulation.tick(s);
                fired = fired || r.fired;
                ASSERT_LE(glm::length(r.total), 8.5 * (1 + 1e-12));
                ASSERT_LE(glm::length(r.basic - before), 0.05 * 8.5 * (1 + 1e-9));
                before = r.basic;
            }
        };
        go(-10e-3, -9e-3, 0);
        for (int i = 0; i < 3; ++i) {
            go(-9e-3, 20e-3, 0);
            go(20e-3, 20e-3, buttonFire);
            go(20e-3, -9e-3, 0);
        }
        EXPECT_TRUE(fired);
    }
}

}  // namespace
}  // namespace palpate::haptics
