// The ultrasound probe: it presses like a tool of its shape, it sees what lies in its beam, and a replay has all of it.
#include "models.h"
#include "synthetic_session.h"

#include <tests/allocations.h>
#include <tests/error_of.h>
#include <tests/folder.h>

#include <haptics/probe.h>
#include <haptics/replay.h>
#include <haptics/score.h>
#include <haptics/simulation.h>
#include <haptics/trainee.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <ultrasound/transducer.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::haptics {
namespace {

// A linear probe whose face lies on the surface y = 0 of a block, in the plane x, y.
const std::string onTheBlock = R"([probe]
kind = "linear"
face_mm = [0, 0, 0]
direction = [0, 1, 0]
lateral = [1, 0, 0]
)";

const SessionModel& blockWithProbe()
{
    static const auto model = tests::modelOf(
        tests::sphereOnBlock("structure = \"tumour\"\naim_mm = [0, 25, 0]\n[model]\nsetting = \"fast\"\n" + onTheBlock));
    return model;
}

DeviceSample away()
{
    DeviceSample s;
    s.position = {0, -40e-3, 0};
    s.buttons = buttonDeadMan;
    return s;
}

// Presses the probe `depth` [m] deep at 10 mm/s, and waits.
const TickRecord& press(Simulation& simulation, double depth, DeviceSample sample = away())
{
    for (double at = 0.0; at < depth; at += 10e-6) {
        sample.probe.press = at;
        simulation.tick(sample);
    }
    sample.probe.press = depth;
    for (int i = 0; i < 200; ++i) {
        simulation.tick(sample);
    }
    return simulation.tick(sample);
}

// The same capsule in the hand, lying on the block: the force is that of one body and one contact, whoever holds it.
// A scene takes what a probe has and refuses what it would be scanned without: the two lists are one.
TEST(Probe, AScenesSettingsAreThoseOfTheTransducer)
{
    for (const auto& [kind, t] :
         {std::pair("linear", ultrasound::linearProbe()), std::pair("curved", ultrasound::curvedProbe())}) {
        const auto refusal = [&](const char* key, float value) {
            return tests::errorOf([&] {
                datasets::parseScene(fmt::format("name = \"a\"\n[volume]\nphantom = \"block\"\n[target]\naim_mm = [0, 20, "
                                                 "0]\n[probe]\nkind = \"{}\"\n"
                                                 "over_target = true\n{} = {}\n",
                                                 kind, key, value),
                                     "a.toml");
            });
        };
        for (const auto& [key, least, most] : {std::tuple("depth_mm", 1e3F * t.shallowest, 1e3F * t.deepest),
                                               std::tuple("frequency_mhz", 1e-6F * t.lowest, 1e-6F * t.highest)}) {
            EXPECT_EQ(refusal(key, std::round(least)), "");
            EXPECT_EQ(refusal(key, std::round(most)), "");
            EXPECT_NE(refusal(key, std::round(least) - 0.5F).find("must be"), std::string::npos);
            EXPECT_NE(refusal(key, std::round(most) + 0.5F).find("must be"), std::string::npos);
        }
        EXPECT_EQ(refusal("focus_mm", std::floor(1e3F * t.depth)), "");
        EXPECT_NE(refusal("focus_mm", 1e3F * t.depth + 1).find("deeper than the picture"), std::string::npos);
    }
}

TEST(Probe, PressesLikeACapsuleOfItsShape)
{
    const double depth = 3e-3;
    Simulation simulation(blockWithProbe());
    const TickRecord probe = press(simulation, depth);
    const auto& model = blockWithProbe();
    const auto transducer = ultrasound::linearProbe();
    const double half = 0.5 * static_cast<double>(transducer.width);
    chainmail::DisplacedLattice shape(model.lattice);
    chainmail::ElasticLevel level(shape, *model.elastic, model.surface, elasticOptions(model.scene.model.elastic), {});
    chainmail::Grip grip;
    grip.kind = chainmail::Grip::Kind::press;
    Vec3 force(0.0);
    for (int i = 0; i < 500; ++i) {
        const double at = std::min(depth, 10e-6 * i);
        grip.position = Vec3(0, at - Probe::edge, 0);
        grip.proxy = Vec3(0, -Probe::edge, 0);
        grip.shape = {Vec3(-half, at - Probe::edge, 0), Vec3(half, at - Probe::edge, 0), Probe::edge, Probe::edge};
        force = level.deform(grip).force.value_or(Vec3(0.0));
    }
    EXPECT_LT(probe.probeForce.y, -0.1);
    EXPECT_NEAR(probe.probeForce.y, force.y, 0.03 * std::abs(force.y));
    EXPECT_LT(std::hypot(probe.probeForce.x, probe.probeForce.z), 0.03 * std::abs(force.y));
    EXPECT_EQ(glm::length(probe.total), 0.0) << "the hand with the needle touches nothing";
}

// What is under the face goes along with it, and comes back.
TEST(Probe, TheTissueUnderItIsPressedInAndComesBack)
{
    // Cells of 2 mm where the hand is: near the probe.
    static const auto model =
        tests::modelOf(tests::sphereOnBlock("structure = \"tumour\"\naim_mm = [0, 25, 0]\n" + onTheBlock));
    Simulation simulation(model);
    DeviceSample hand = away();
    hand.position.y = -14e-3;
    const auto under = [&] {
        const auto& grid = model.lattice.grid;
        const Index3 node(glm::round((Vec3(0, 1e-3, 0) - grid.origin) / grid.spacing));
        return static_cast<double>(simulation.shape().u()[grid.offset(node)].y);
    };
    const TickRecord pressed = press(simulation, 4e-3, hand);
    EXPECT_NEAR(under(), 4e-3, 0.5e-3);
    EXPECT_GT(pressed.moved, 100U);
    DeviceSample off = hand;
    off.probe.press = -10e-3;
    for (int i = 0; i < 2000; ++i) {
        simulation.tick(off);
    }
    EXPECT_EQ(under(), 0.0);
    EXPECT_EQ(glm::length(simulation.tick(off).probeForce), 0.0);
}

// A hand that presses beside the probe feels a body that the probe has made tauter, and the probe feels the hand.
TEST(Probe, HandAndProbeFeelOneBody)
{
    Simulation alone(blockWithProbe()), both(blockWithProbe());
    const Vec3 before = press(both, 3e-3).probeForce;
    DeviceSample hand = away();
    TickRecord withProbe, without;
    for (int i = 0; i < 1500; ++i) {
        hand.position = Vec3(0, std::min(-14e-3 + 10e-6 * i, -6e-3), 22e-3);
        hand.probe.press = 3e-3;
        withProbe = both.tick(hand);
        hand.probe.press = -10e-3;
        without = alone.tick(hand);
    }
    EXPECT_GT(-without.tissueForce.y, 0.1);
    EXPECT_LT(-withProbe.tissueForce.y, -without.tissueForce.y) << "the probe has pressed the tissue away from the hand";
    EXPECT_LT(-withProbe.probeForce.y, -before.y) << "and the hand has pressed it away from the probe";
}

TEST(Probe, CurvedProbesPressWithTheirArc)
{
    datasets::ProbeSpec spec;
    spec.kind = datasets::ProbeKind::curved;
    Probe probe(spec);
    probe.place({.press = 5e-3}, blockWithProbe().surface);
    const auto transducer = ultrasound::curvedProbe();
    const double radius = static_cast<double>(transducer.radius);
    const Vec3 middle = Vec3(0, 5e-3, 0) - radius * Vec3(0, 1, 0);
    ASSERT_EQ(probe.tools().size(), chainmail::ElasticLevel::maxOthers);
    for (const auto& tool : probe.tools()) {
        for (const double t : {0.0, 0.5, 1.0}) {
            const double to = glm::distance(tool.shape.a + t * (tool.shape.b - tool.shape.a), middle) + Probe::edge;
            EXPECT_NEAR(to, radius, 0.2e-3);
        }
    }
}

// A shaft that crosses the plane at its tip at an angle a leaves a beam of half width w after w / sin a.
TEST(Probe, SeesTheLengthThatLiesInItsBeam)
{
    datasets::ProbeSpec spec;
    spec.kind = datasets::ProbeKind::linear;
    Probe probe(spec);
    probe.place({}, blockWithProbe().surface);
    const double radius = 1e-3, length = 30e-3, depth = 18e-3;
    const ultrasound::Beam beam(ultrasound::linearProbe(), ultrasound::settingsOf(ultrasound::linearProbe()));
    const double half = 1.17741 * static_cast<double>(beam.elevationSigma(static_cast<float>(depth))) + radius;
    const Vec3 tip(10e-3, depth, 0);
    const auto along = [](double out) { return Vec3(std::cos(out), 0, std::sin(out)); };
    EXPECT_NEAR(probe.look({10e-3, depth, 0}, along(0), 20e-3, radius).length, 20e-3, 1e-9);
    for (const double out : {0.1, 0.3, 1.0}) {
        const NeedleInBeam seen = probe.look(tip, along(out), length, radius);
        EXPECT_NEAR(seen.length, std::min(28e-3 / std::cos(out), std::min(length, half / std::sin(out))), length / 64);
        EXPECT_TRUE(seen.tip);
    }
    EXPECT_FALSE(probe.look({0, depth, 2 * half}, along(0), length, radius).tip);
    EXPECT_EQ(probe.look({0, depth, 2 * half}, along(0), length, radius).length, 0.0);
    EXPECT_FALSE(probe.look({25e-3, depth, 0}, along(0), 1e-3, radius).tip) << "beside the picture";
    EXPECT_FALSE(probe.look({0, 45e-3, 0}, along(0), 1e-3, radius).tip) << "below the picture";
    EXPECT_EQ(Probe({}).look(tip, along(0), length, radius).length, 0.0) << "no probe";
}

// A probe that is nowhere (NaN, out of bounds) stays where it was; needle and record go on.
TEST(Probe, AHandThatIsNowhereLeavesItWhereItWas)
{
    Simulation simulation(blockWithProbe());
    const TickRecord before = press(simulation, 2e-3);
    DeviceSample bad = away();
    for (const double wrong : {std::nan(""), 2.0, -std::numeric_limits<double>::infinity()}) {
        bad.probe = {wrong, 0, 0, 0, 0, 0};
        const TickRecord& now = simulation.tick(bad);
        EXPECT_EQ(now.device.probe.press, 2e-3);
        EXPECT_EQ(now.probeFace, before.probeFace);
    }
}

TEST(Probe, PressingAllocatesNothing)
{
    Simulation simulation(blockWithProbe());
    DeviceSample sample = away();
    const auto before = tests::allocations();
    for (int i = 0; i < 400; ++i) {
        sample.probe = {.press = 10e-6 * i, .slide = 5e-6 * i, .tilt = 1e-4 * i};
        simulation.tick(sample);
    }
    EXPECT_EQ(tests::allocations(), before);
}

// A whole biopsy beside the probe: the windows of fine cells follow the needle, and go away from the probe with it. Where
// wider cells had the probe, those with a corner of the tissue threw it back with 1e5 N.
TEST(Probe, ANeedleThatComesAndGoesLeavesItsForce)
{
    for (const char* setting : {"fast", "default"}) {
        std::string scene = datasets::builtInScene("us-core-biopsy")->text;
        scene.insert(scene.find("level = "), std::string("setting = \"") + setting + "\"\n");
        const auto model = tests::modelOf(scene);
        Simulation simulation(model);
        Trainee trainee(model, skillCalled("novice"), 3, 5e-3);
        double pressed = 0.0;
        for (int i = 0; i < 9000 && !trainee.finished(); ++i) {
            const TickRecord& r = simulation.tick(trainee.read());
            trainee.write(r.total);
            trainee.observe(r);
            pressed = std::max(pressed, glm::length(r.probeForce));
            ASSERT_LT(pressed, 5.0) << setting << ", tick " << i;
        }
        EXPECT_GT(pressed, 0.5) << setting;
        EXPECT_TRUE(trainee.finished()) << setting;
    }
}

// The hands of a trainee, live: everything that the record has of the probe comes again bit for bit, and so does the score.
TEST(Probe, ARecordHasItAndAReplayGivesItAgain)
{
    const auto model = tests::modelOf(tests::layeredSceneOf(80) +
                                      "[model]\nsetting = \"fast\"\n[probe]\nkind = \"linear\"\nover_target = true\n" +
                                      "[[probe_step]]\nat_s = 0.3\npress_mm = 2\n");
    SessionInfo info = infoOf(model);
    info.rate = 1000;
    const tests::Folder folder;
    const auto file = folder / "s.db";
    Scorer live(info);
    double pressed = 0.0;
    {
        Recorder recorder(file, info);
        Simulation simulation(model);
        Trainee trainee(model, skillCalled("novice"), 3, 5e-3);
        for (int i = 0; i < 6000 && !trainee.finished(); ++i) {
            const TickRecord& r = simulation.tick(trainee.read());
            trainee.write(r.total);
            trainee.observe(r);
            live.add(r);
            pressed = std::max(pressed, glm::length(r.probeForce));
            recorder.push(r);
            if (i % 100 == 0) {
                recorder.flush();
            }
        }
        recorder.finish({});
    }
    EXPECT_GT(pressed, 0.05);
    const Record record(file);
    EXPECT_TRUE(record.info().probe);
    EXPECT_EQ(record.seal().state, Seal::State::whole);
    const ReplayResult again = replay(record, model);
    EXPECT_FALSE(again.firstDifference.has_value()) << again.inWords;
    const Score a = live.score(), b = scoreOf(record);
    EXPECT_EQ(a.needleInBeam, b.needleInBeam);
    EXPECT_EQ(a.blindAdvance, b.blindAdvance);
    EXPECT_EQ(a.probeSeconds, b.probeSeconds);
    EXPECT_GT(b.probeSeconds, 1.0);
}

// On flat skin the face lies over the target, and the needle comes in beside the housing, in the picture's plane.
TEST(Probe, LiesOverTheTargetWithTheNeedleInItsPlane)
{
    const auto model = tests::modelOf(tests::layeredSceneOf(80) + "[probe]\nkind = \"linear\"\nover_target = true\n");
    const auto& probe = model.scene.probe;
    const Vec3 middle(0, 26e-3, 0);
    EXPECT_LT(glm::distance(model.approach.aim, middle), 1e-3);
    EXPECT_LT(glm::distance(probe.face, Vec3(0, 0, 0)), 1e-3);
    EXPECT_GT(probe.direction.y, 0.999);
    EXPECT_NEAR(model.approach.entry.y, 0.0, 0.3e-3);
    const Vec3 way = model.approach.aim - model.approach.entry;
    EXPECT_LT(std::abs(glm::dot(glm::normalize(way), glm::cross(probe.direction, probe.lateral))), 0.02);
    const double beside = glm::dot(model.approach.entry - probe.face, probe.lateral);
    EXPECT_GE(beside, Probe(probe).halfLength());
    EXPECT_LE(beside, Probe(probe).halfLength() + 15e-3);
    const auto bone = std::ranges::find(model.structures, "bone", &GuardedStructure::name);
    EXPECT_GT(bone->distance.distance(model.approach.aim), 0.0);
}

// A needle that is too short for any of the ways.
TEST(Probe, WithoutAWayBesideItSaysSo)
{
    const std::string deep = R"(name = "deep"
[volume]
phantom = "block"
[volume.parameters]
tumour_centre_mm = 40
[tool]
kind = "needle"
length_mm = 30
[probe]
kind = "curved"
over_target = true
[target]
structure = "tumour"
)";
    EXPECT_NE(tests::errorOf([&] { tests::modelOf(deep); }).find("[probe] over_target: no needle"), std::string::npos);
}

// Means over the time inside, sums over the way in: of ticks whose values are known.
TEST(Probe, MeasuresFollowFromWhatThePictureHad)
{
    SessionInfo info = synthetic::info();
    info.probe = true;
    Scorer scorer(info);
    TickRecord r;
    const auto tick = [&](Phase phase, double inserted, double seen, bool tip, std::uint32_t buttons = 0) {
        r.phase = phase;
        r.inserted = inserted;
        r.needleInBeam = seen;
        r.tipInBeam = tip;
        r.device.buttons = buttons;
        r.probeForce = Vec3(0, -0.5, 0);
        scorer.add(r);
        ++r.tick;
    };
    tick(Phase::free, 0, 0, false, buttonPicture);
    tick(Phase::contact, 0, 0, false);
    for (int mm = 1; mm <= 20; ++mm) {
        tick(Phase::inserted, 1e-3 * mm, mm > 10 ? 0.5e-3 * mm : 0.0, mm > 10, mm == 20 ? buttonPicture : 0U);
    }
    r.fired = true;
    tick(Phase::inserted, 20e-3, 10e-3, true);
    r.fired = false;
    tick(Phase::inserted, 20e-3, 10e-3, true, buttonPicture);
    tick(Phase::inserted, 12e-3, 0, false);
    const Score s = scorer.score();
    EXPECT_NEAR(s.blindAdvance, 10e-3, 1e-12) << "withdrawing is no advance";
    EXPECT_NEAR(s.minInBeam, 5.5e-3, 1e-12);
    EXPECT_NEAR(s.tipShare, 12.0 / 23.0, 1e-12);
    EXPECT_NEAR(s.needleInBeam, (0.5e-3 * (20 * 21 - 10 * 11) / 2 + 20e-3) / 23, 1e-12);
    EXPECT_NEAR(s.needleShare, (0.5 * 12) / 23, 1e-12);
    EXPECT_NEAR(s.probeSeconds, 25e-3, 1e-12);
    EXPECT_EQ(s.picturesBefore, 1U) << "the one without the needle does not count";
    EXPECT_EQ(s.picturesAfter, 1U);
}

// In by 40 mm, slowly back to 20 and in again, never seen: all of both ways in is blind.
TEST(Probe, AWayInThatBeginsAnewIsBlindFromWhereItBegins)
{
    SessionInfo info = synthetic::info();
    info.probe = true;
    Scorer scorer(info);
    TickRecord r;
    r.phase = Phase::inserted;
    const auto push = [&](double from, double to) {
        for (int i = 1; i <= 1000; ++i) {
            r.inserted = from + (to - from) * i / 1000;
            scorer.add(r);
            ++r.tick;
        }
    };
    push(0, 40e-3);
    push(40e-3, 20.1e-3);
    push(20.1e-3, 40e-3);
    EXPECT_NEAR(scorer.score().blindAdvance, 59.9e-3, 1e-9);
    push(40e-3, 36e-3);
    push(36e-3, 40e-3);
    EXPECT_NEAR(scorer.score().blindAdvance, 59.9e-3, 1e-9) << "a hand that goes back and forth is no other way in";
}

// The better the skill, the more of the needle stays in the picture; over seeds.
TEST(Probe, WhoKnowsHowKeepsTheNeedleInThePicture)
{
    const auto model = tests::modelOf(tests::layeredSceneOf(80) +
                                      "[model]\nlevel = \"spring\"\n[probe]\nkind = \"linear\"\nover_target = true\n");
    const auto meanOf = [&](const char* who) {
        double tip = 0.0;
        constexpr int seeds = 12;
        for (int seed = 1; seed <= seeds; ++seed) {
            Simulation simulation(model);
            Trainee trainee(model, skillCalled(who), static_cast<std::uint64_t>(seed), 10e-3);
            Scorer scorer(infoOf(model));
            for (int i = 0; i < 60000 && !trainee.finished(); ++i) {
                const TickRecord& r = simulation.tick(trainee.read());
                trainee.write(r.total);
                trainee.observe(r);
                scorer.add(r);
            }
            tip += scorer.score().tipShare / seeds;
        }
        return tip;
    };
    const double novice = meanOf("novice"), expert = meanOf("expert");
    EXPECT_GT(expert, novice + 0.1);
    EXPECT_GT(expert, 0.5);
}

}  // namespace
}  // namespace palpate::haptics
