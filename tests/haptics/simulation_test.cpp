#include "models.h"

#include <tests/allocations.h>

#include <haptics/contact_law.h>
#include <haptics/hand.h>
#include <haptics/replay.h>
#include <haptics/simulation.h>
#include <haptics/surface_proxy.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace palpate::haptics {
namespace {

DeviceSample at(Vec3 position)
{
    DeviceSample s;
    s.position = position;
    s.axis = {0, 1, 0};
    s.buttons = buttonDeadMan;
    return s;
}

// Runs the tip along y from `from` to `to` [m] at `speed` [m/s] and hands every tick to `visit`.
template <typename Visit>
void stroke(Simulation& simulation, double from, double to, double speed, Visit&& visit)
{
    const int ticks = static_cast<int>(std::abs(to - from) / (speed * tickSeconds));
    for (int i = 0; i <= ticks; ++i) {
        visit(simulation.tick(at({0, from + (to - from) * i / ticks, 0})));
    }
}

void settle(Simulation& simulation, double y, int ticks = 700)
{
    for (int i = 0; i < ticks; ++i) {
        simulation.tick(at({0, y, 0}));
    }
}

double puncturing(const SessionModel& model, const char* tissue)
{
    return model.tissue->table().rows[*model.tissue->table().find(tissue)].punctureForce;
}

// Level 1: a sphere pressed d into the block feels Hertz's force in the tissue under it, straight out of the surface.
TEST(Simulation, SphereOnTheBlockFeelsHertzAtLevelChainmail)
{
    auto model = tests::modelOf(tests::blockScene);
    model.scene.model.level = datasets::ModelLevel::chainmail;
    const volume::Tissue::Reader reader(*model.tissue);
    Simulation simulation(model);
    settle(simulation, -12e-3);
    stroke(simulation, -12e-3, -10e-3 + 6e-3, 0.02, [](const TickRecord&) {});
    settle(simulation, -4e-3);
    const TickRecord r = simulation.tick(at({0, -4e-3, 0}));
    const auto local = tissueUnder(model, reader, {0, 0, 0}, {0, 1, 0}, 10e-3);
    const double expected = sphereForce(model, local, 6e-3);
    EXPECT_NEAR(-r.total.y, expected, 0.03 * expected);
    EXPECT_LT(std::hypot(r.total.x, r.total.z), 0.05 * expected);
}

// End on, a capsule is a sphere: the rod behind it stays in the air.
TEST(Simulation, CapsuleEndOnFeelsLikeASphere)
{
    auto capsule = tests::modelOf(tests::blockScene);
    capsule.scene.tool.kind = datasets::ToolKind::capsule;
    Simulation round(tests::blockSphere()), rod(capsule);
    std::vector<Vec3> expected;
    stroke(round, -15e-3, -4e-3, 0.05, [&](const TickRecord& r) { expected.push_back(r.basic); });
    std::size_t i = 0;
    stroke(rod, -15e-3, -4e-3, 0.05, [&](const TickRecord& r) { EXPECT_EQ(r.basic, expected[i++]); });
    EXPECT_LT(expected.back().y, -0.1);
}

// On its side, a capsule of radius R pressed d deep touches one and the same section of the body all along: every column
// of elements adds as many, and at least those of the chord 2 sqrt(2 R d - d^2) on the surface.
TEST(Simulation, CapsuleOnItsSideTouchesAsManyElementsAsItIsLong)
{
    constexpr double radius = 10e-3, deep = 3e-3;
    auto model = tests::modelOf(tests::blockScene);
    model.scene.model.level = datasets::ModelLevel::spring;
    const double h = model.lattice.grid.spacing;
    std::vector<double> touched;
    for (const int columns : {0, 10, 20}) {
        model.scene.tool.kind = columns == 0 ? datasets::ToolKind::sphere : datasets::ToolKind::capsule;
        model.scene.tool.length = columns * h;
        Simulation simulation(model);
        DeviceSample device = at({columns * h / 2, deep - radius, 0});
        device.axis = {1, 0, 0};
        touched.push_back(simulation.tick(device).contacts);
    }
    EXPECT_EQ(touched[2] - touched[1], touched[1] - touched[0]);
    EXPECT_GT(touched[2] - touched[1], 10 * 2 * std::sqrt(2 * radius * deep - deep * deep) / h);
}

// A capsule that rolls over from its front to its back touches at places between them: none is left out.
TEST(SurfaceProxy, ThePlaceOfACapsuleDoesNotJumpAsItTurns)
{
    const auto& surface = tests::blockSphere().surface;
    ProxyTool tool{10e-3, 20e-3, Vec3(1, 0, 0), 0.0};
    const auto placeAt = [&](double tilt) {
        tool.axis = Vec3(std::cos(tilt), -std::sin(tilt), 0);
        return deepestPlace(surface, tool, 10e-3 * tool.axis + Vec3(0, -9e-3, 0)).at;
    };
    Vec3 last = placeAt(-0.4);
    EXPECT_GT(last.x, 9e-3 * std::cos(0.4));
    for (int i = -1999; i <= 2000; ++i) {
        const Vec3 place = placeAt(0.2e-3 * i);
        EXPECT_LT(glm::distance(place, last), 0.2e-3) << i;
        last = place;
    }
    EXPECT_LT(last.x, -9e-3 * std::cos(0.4));
}

// Level 1 deforms: the tissue under the sphere is where the sphere's lowest point is, level 0 leaves it.
TEST(Simulation, ChainMailFollowsTheSphereAndSpringDoesNot)
{
    for (const bool deforms : {true, false}) {
        auto model = tests::modelOf(tests::blockScene);
        model.scene.model.level = deforms ? datasets::ModelLevel::chainmail : datasets::ModelLevel::spring;
        Simulation simulation(model);
        double penetration = 0.0;
        stroke(simulation, -15e-3, -3e-3, 0.05, [&](const TickRecord& r) { penetration = r.penetration; });
        const auto& lattice = model.lattice;
        double deepest = 0.0;
        for (const auto n : simulation.shape().moved()) {
            deepest = std::max(deepest, static_cast<double>(simulation.shape().u()[n].y));
        }
        EXPECT_NEAR(deepest, deforms ? 7e-3 : 0.0, lattice.grid.spacing);
        EXPECT_NEAR(penetration, deforms ? 0.0 : 7e-3, deforms ? lattice.grid.spacing : 0.2e-3);
    }
}

// Load, drag aside, away at once: at every level the force is back at zero as soon as the slew lets it, in two ticks, and
// so is every node, at level 2 by turns.
TEST(Simulation, NothingIsLeftAfterRelease)
{
    using Level = datasets::ModelLevel;
    for (const Level level : {Level::spring, Level::chainmail, Level::elastic}) {
        auto model = tests::modelOf(tests::blockScene);
        model.scene.model.level = level;
        SCOPED_TRACE(name(level));
        Simulation simulation(model);
        stroke(simulation, -15e-3, -4e-3, 0.05, [](const TickRecord&) {});
        for (int i = 0; i < 200; ++i) {
            simulation.tick(at({i * 5e-5, -4e-3, 0}));
        }
        EXPECT_LT(simulation.tick(at({1e-2, -4e-3, 0})).total.y, -0.05);
        EXPECT_EQ(simulation.shape().moved().empty(), level == Level::spring);
        simulation.tick(at({1e-2, -20e-3, 0}));
        const auto r = simulation.tick(at({1e-2, -20e-3, 0}));
        EXPECT_EQ(r.total, Vec3(0.0));
        EXPECT_EQ(r.phase, Phase::free);
        settle(simulation, -20e-3, level == Level::elastic ? 200 : 1);
        EXPECT_TRUE(simulation.shape().moved().empty()) << simulation.shape().moved().size();
        for (const Vec3f u : simulation.shape().u()) {
            ASSERT_EQ(u, Vec3f(0.0F));
        }
    }
}

// The needle: the force rises to the skin's puncture force, drops, then stays at cutting plus friction; every boundary on
// the way is an event, in the order of the layers.
TEST(Simulation, NeedleFeelsEveryLayerInOrder)
{
    const auto& model = tests::layeredNeedle();
    Simulation simulation(model);
    settle(simulation, -10e-3);
    std::vector<std::string> entered;
    double beforeSkin = 0.0;
    stroke(simulation, -10e-3, 45e-3, 0.01, [&](const TickRecord& r) {
        if (entered.empty()) {
            beforeSkin = std::max(beforeSkin, glm::length(r.basic));
        }
        for (std::uint32_t i = 0; i < r.eventCount; ++i) {
            if (r.events[i].kind == EventKind::puncture) {
                entered.push_back(model.tissue->table().rows[r.events[i].tissue].name);
            }
        }
    });
    EXPECT_EQ(entered, (std::vector<std::string>{"skin", "fat", "gland", "idc_high_grade", "gland"}));
    EXPECT_NEAR(beforeSkin, puncturing(model, "skin"), 0.05 * puncturing(model, "skin"));
}

// Tissue that gave way takes force off the hand: from the puncture of the skin on the tip's force only falls, until it has
// come down to cutting.
TEST(Simulation, ForceFallsAfterThePuncture)
{
    const auto& model = tests::layeredNeedle();
    Simulation simulation(model);
    settle(simulation, -10e-3);
    double before = 0.0;
    bool pierced = false;
    bool cutting = false;
    stroke(simulation, -10e-3, 20e-3, 0.01, [&](const TickRecord& r) {
        const double force = glm::length(r.basic);
        if (pierced && !cutting) {
            EXPECT_LE(force, before + 1e-9) << r.tick;
            cutting = force < 0.5 * puncturing(model, "skin");
        }
        pierced = pierced || (r.eventCount > 0 && r.events[0].kind == EventKind::puncture);
        before = force;
    });
    EXPECT_TRUE(cutting);
}

// In, back and in again along the same path: what is cut stays cut. No puncture is felt again, the tip knows the tissue it
// passes, and the force stays under that of the first way.
TEST(Simulation, CutPathStaysOpen)
{
    const auto& model = tests::layeredNeedle();
    Simulation simulation(model);
    settle(simulation, -10e-3);
    struct Way {
        int punctures = 0;
        double most = 0.0;
        std::uint8_t lastTissue = 0;
    };
    const auto push = [&](double from, double to) {
        Way way;
        stroke(simulation, from, to, 0.02, [&](const TickRecord& r) {
            way.lastTissue = r.tissue;
            way.most = std::max(way.most, glm::length(r.basic));
            for (std::uint32_t i = 0; i < r.eventCount; ++i) {
                way.punctures += r.events[i].kind == EventKind::puncture ? 1 : 0;
            }
        });
        return way;
    };
    const Way first = push(-0.5e-3, 30e-3);
    EXPECT_GE(first.punctures, 3);
    stroke(simulation, 30e-3, 3e-3, 0.02, [](const TickRecord&) {});
    // To 25 mm: the first way cut as far as 30 mm less what the tissue gave at its end.
    const Way second = push(3e-3, 25e-3);
    EXPECT_EQ(second.punctures, 0);
    EXPECT_LT(second.most, first.most);
    EXPECT_EQ(second.lastTissue, first.lastTissue);
}

// Deep in one tissue the force is its cutting force plus friction times the inserted length: linear in depth.
TEST(Simulation, NeedleForceGrowsWithInsertedLengthByFriction)
{
    const auto model = tests::modelOf(R"(name = "fat"
[volume]
phantom = "block"
voxel_mm = 1.0
[volume.parameters]
tumour_diameter_mm = 4
tumour_centre_mm = 50
[dffb]
mode = "off"
[target]
structure = "tumour"
aim_mm = [0, 50, 0]
entry_mm = [0, 0, 0]
)");
    const auto& fat = model.tissue->table().rows[*model.tissue->table().find("fat")];
    Simulation simulation(model);
    settle(simulation, -10e-3);
    std::vector<std::pair<double, double>> curve;
    stroke(simulation, -10e-3, 40e-3, 0.02, [&](const TickRecord& r) {
        if (r.inserted > 10e-3) {
            curve.emplace_back(r.inserted, -r.basic.y);
        }
    });
    ASSERT_GT(curve.size(), 300U);
    for (std::size_t i = 0; i < curve.size(); i += 20) {
        const double expected = fat.cuttingForce + fat.frictionPerMetre * curve[i].first;
        EXPECT_NEAR(curve[i].second, expected, 0.05 * expected + 0.01) << curve[i].first;
    }
}

// Withdrawal: the force turns round, only friction is left, and outside nothing is.
TEST(Simulation, WithdrawalFeelsFrictionTheOtherWay)
{
    const auto& model = tests::layeredNeedle();
    Simulation simulation(model);
    settle(simulation, -10e-3);
    stroke(simulation, -10e-3, 25e-3, 0.02, [](const TickRecord&) {});
    double most = 0.0;
    stroke(simulation, 25e-3, -10e-3, 0.02, [&](const TickRecord& r) { most = std::max(most, r.basic.y); });
    EXPECT_GT(most, 0.05);
    // Friction and no more: 25 mm of shaft in skin, fat and gland.
    const auto& rows = model.tissue->table().rows;
    double friction = 0.0;
    for (const char* name : {"skin", "fat", "gland", "idc_high_grade"}) {
        friction = std::max(friction, rows[*model.tissue->table().find(name)].frictionPerMetre);
    }
    EXPECT_LT(most, friction * 25e-3);
    settle(simulation, -10e-3, 50);
    EXPECT_EQ(simulation.tick(at({0, -10e-3, 0})).total, Vec3(0.0));
}

// A stab at 5 m/s, 5 mm per tick, does not pass the skin without contact and puncture.
TEST(Simulation, FastStabCannotTunnelThroughTheSkin)
{
    const auto& model = tests::layeredNeedle();
    Simulation simulation(model);
    settle(simulation, -10.3e-3);
    std::vector<EventKind> kinds;
    stroke(simulation, -10.3e-3, 30e-3, 5.0, [&](const TickRecord& r) {
        for (std::uint32_t i = 0; i < r.eventCount; ++i) {
            kinds.push_back(r.events[i].kind);
        }
    });
    ASSERT_GE(kinds.size(), 2U);
    EXPECT_EQ(kinds[0], EventKind::contact);
    EXPECT_EQ(kinds[1], EventKind::puncture);
}

// The core is looked up where the notch is: fired inside the tumour it is tumour, beside it there is none.
TEST(Simulation, CoreHoldsTheTissueInTheNotch)
{
    const auto& model = tests::layeredNeedle();
    const auto& tool = model.scene.tool;
    const auto fireAt = [&](double tip) {
        Simulation simulation(model);
        settle(simulation, -10e-3);
        stroke(simulation, -10e-3, tip, 0.02, [](const TickRecord&) {});
        auto sample = at({0, tip, 0});
        sample.buttons |= buttonFire;
        const TickRecord r = simulation.tick(sample);
        EXPECT_TRUE(r.fired);
        EXPECT_FALSE(simulation.tick(sample).fired);  // once per press
        return r.core;
    };
    // The tumour lies 20 to 32 mm deep: the notch is to be around 26 mm.
    const double tip = 26e-3 - tool.throwLength + 0.5 * tool.notchLength;
    const auto hit = fireAt(tip);
    EXPECT_NEAR(hit.targetLength, 12e-3, 3.5e-3);
    double sum = 0.0;
    for (const double f : hit.fraction) {
        sum += f;
    }
    EXPECT_NEAR(sum, 1.0, 1e-9);
    EXPECT_NEAR(hit.targetFraction, 12.0 / 20.0, 0.2);
    const auto miss = fireAt(tip + 25e-3);
    EXPECT_LT(miss.targetFraction, 0.1);
}

// Recorded poses give the same bits again, of forces and of tissue; one bit in one pose gives others.
TEST(Simulation, SameSamplesGiveTheSameBits)
{
    for (const bool needle : {true, false}) {
        const double deepest = needle ? 40e-3 : -2e-3;
        const auto run = [&](double nudge) {
            Simulation simulation(needle ? tests::layeredNeedle() : tests::blockSphere());
            ForceHash hash;
            std::mt19937 random(3);
            std::normal_distribution<double> tremor(0.0, 2e-4);
            for (int i = 0; i < 2000; ++i) {
                const double y = -10e-3 + (deepest + 10e-3) * std::sin(i * 1e-3);
                auto s = at({tremor(random), y + (i == 1500 ? nudge : 0.0), tremor(random)});
                hash.add(simulation.tick(s));
            }
            const auto u = simulation.shape().u();
            return std::pair(hash.value(), std::vector(u.begin(), u.end()));
        };
        const auto once = run(0.0);
        EXPECT_EQ(once, run(0.0));
        EXPECT_NE(once.first, run(1e-5).first);
    }
}

// Poses that jump, shake, turn and go bad: the force stays finite, under the cap and its slew, and after a bad pose zero.
TEST(Simulation, HostilePosesNeverHurtTheHand)
{
    for (const auto* model : {&tests::layeredNeedle(), &tests::blockSphere()}) {
        Simulation simulation(*model);
        std::mt19937 random(5);
        std::uniform_real_distribution<double> place(-0.08, 0.08), chance(0.0, 1.0);
        std::normal_distribution<double> noise(0.0, 1.0);
        Vec3 p(0.0, -0.02, 0.0), before(0.0);
        for (int i = 0; i < 4000; ++i) {
            p = chance(random) < 0.02 ? Vec3(place(random), place(random), place(random))
                                      : p + 5e-4 * Vec3(noise(random), noise(random), noise(random));
            auto s = at(p);
            s.axis = glm::normalize(Vec3(noise(random), 3.0 + noise(random), noise(random)));
            s.buttons |= chance(random) < 0.01 ? buttonFire : 0;
            const TickRecord& r = simulation.tick(s);
            ASSERT_TRUE(std::isfinite(glm::length(r.total)));
            ASSERT_LE(glm::length(r.total), model->scene.forceCap * (1 + 1e-12));
            ASSERT_LE(glm::length(r.total - before), 0.12 * model->scene.forceCap);
            before = r.total;
        }
    }
}

// Ticks that came late have true poses, only no force to go with them: the tool follows, and none is caught up in a jump.
TEST(Simulation, LatePosesAreFollowed)
{
    Simulation simulation(tests::blockSphere());
    settle(simulation, -12e-3);
    double before = 0.0;
    for (int i = 1; i <= 100; ++i) {
        auto sample = at({0, -12e-3 + 80e-6 * i, 0});
        sample.fresh = i <= 10 || i > 80;
        const TickRecord& r = simulation.tick(sample);
        ASSERT_LE(r.penetration - before, 1e-3) << i;
        EXPECT_TRUE(i != 80 || r.phase == Phase::contact);
        before = r.penetration;
    }
}

// Not a number, infinite, absurd, or without a direction: such a pose is never followed, and the force stays off.
TEST(Simulation, ImpossiblePoseSwitchesTheForceOff)
{
    const double nan = std::numeric_limits<double>::quiet_NaN();
    for (const double bad : {nan, std::numeric_limits<double>::infinity(), 1e300, -11.0}) {
        for (const bool axis : {false, true}) {
            Simulation simulation(tests::blockSphere());
            settle(simulation, -5e-3);
            auto sample = at({0, -5e-3, 0});
            (axis ? sample.axis : sample.position).y = bad;
            simulation.tick(sample);
            const TickRecord& r = simulation.tick(at({0, -5e-3, 0}));
            EXPECT_TRUE(r.faulted);
            EXPECT_EQ(r.total, Vec3(0.0));
        }
    }
}

// Before there is a pose the tool is nowhere near the body, not at the patient's origin, which is in it.
TEST(Simulation, AnImpossibleFirstPoseTouchesNothing)
{
    Simulation simulation(tests::blockSphere());
    auto sample = at({0, 20e-3, 0});
    sample.position.x = std::numeric_limits<double>::quiet_NaN();
    for (int i = 0; i < 5; ++i) {
        const TickRecord& r = simulation.tick(sample);
        EXPECT_TRUE(r.faulted);
        EXPECT_EQ(r.phase, Phase::free);
        EXPECT_EQ(r.tissueForce, Vec3(0.0));
        EXPECT_EQ(r.total, Vec3(0.0));
    }
}

// Turning DFFB off changes the additional channel and nothing else: with the same poses the basic force, events, phases and
// tissue of every tick are the same, and so are the displaced nodes, the distances and the core. In every tick the parts
// make the total (equation 1).
TEST(Simulation, DffbChangesOnlyItsOwnChannel)
{
    using datasets::DffbMode;
    for (const DffbMode mode : {DffbMode::field, DffbMode::thesis}) {
        auto off = tests::modelOf(tests::layeredScene);
        off.scene.dffb.mode = DffbMode::off;
        auto on = tests::modelOf(tests::layeredScene);
        on.scene.dffb.mode = mode;
        on.scene.dffb.structure = {1.0, 0.05, 1.0, 100.0};
        on.scene.dffb.range = 60e-3;
        Simulation a(off), b(on);
        double most = 0.0;
        for (int i = 0; i < 1200; ++i) {
            auto s = at({0, -10e-3 + 5e-5 * (i < 1000 ? i : 2000 - i), 0});
            s.buttons |= i == 900 ? buttonFire : 0;
            const TickRecord ra = a.tick(s);
            const TickRecord rb = b.tick(s);
            ASSERT_EQ(ra.basic, rb.basic);
            ASSERT_EQ(ra.additional, Vec3(0.0));
            ASSERT_EQ(ra.phase, rb.phase);
            ASSERT_EQ(ra.tissue, rb.tissue);
            ASSERT_EQ(ra.proxy, rb.proxy);
            ASSERT_EQ(ra.distance, rb.distance);
            ASSERT_EQ(ra.eventCount, rb.eventCount);
            for (std::uint32_t k = 0; k < ra.eventCount; ++k) {
                ASSERT_EQ(ra.events[k].kind, rb.events[k].kind);
                ASSERT_EQ(ra.events[k].value, rb.events[k].value);
            }
            ASSERT_EQ(ra.core.fraction, rb.core.fraction);
            ASSERT_EQ(rb.total, rb.basic + rb.additional);
            most = std::max(most, glm::length(rb.additional));
        }
        EXPECT_TRUE(std::ranges::equal(a.shape().u(), b.shape().u()));
        EXPECT_GT(most, 0.05);
    }
}

TEST(Simulation, TickTouchesNoHeap)
{
    for (const auto* model : {&tests::layeredNeedle(), &tests::blockSphere()}) {
        Simulation simulation(*model);
        const auto count = tests::heapCallsIn([&] {
            for (int i = 0; i < 2000; ++i) {
                auto s = at({0, -15e-3 + 2e-5 * i, 0});
                s.buttons |= i == 1900 ? buttonFire : 0;
                simulation.tick(s);
            }
        });
        EXPECT_EQ(count, 0U);
    }
}

}  // namespace
}  // namespace palpate::haptics
