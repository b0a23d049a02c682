#include <haptics/score.h>

#include <haptics/measures.h>

#include <tests/haptics/synthetic_session.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <string_view>

namespace palpate::haptics {
namespace {

constexpr double millimetre = 1e-3;

// Ticks of a tip that goes to depths straight along y, inside the body wherever the depth is above 0.
std::vector<TickRecord> along(const std::vector<synthetic::Key>& keys)
{
    std::vector<TickRecord> ticks(static_cast<std::size_t>(std::lround(keys.back().time * 1000)) + 1);
    for (std::size_t n = 0; n < ticks.size(); ++n) {
        const double depth = synthetic::depthAt(keys, static_cast<double>(n) / 1000);
        ticks[n].tick = n;
        ticks[n].device.position = {0, depth, 0};
        ticks[n].phase = depth > 0 ? Phase::inserted : Phase::free;
        ticks[n].inserted = std::max(depth, 0.0);
        ticks[n].distance = {0.1, 0.1, 0.1};
    }
    return ticks;
}

Score scoreTicks(const std::vector<TickRecord>& ticks)
{
    Scorer scorer(synthetic::info());
    for (const TickRecord& tick : ticks) {
        scorer.add(tick);
    }
    return scorer.score();
}

void fire(TickRecord& tick, double error, double fraction, double length)
{
    tick.fired = true;
    tick.core.targetFraction = fraction;
    tick.core.targetLength = length;
    synthetic::addEvent(tick, synthetic::event(EventKind::fire, 0, 4, error));
}

// 30 mm in free space and 40 mm in: 70 mm, of which 40 mm less at most a tick's 0.04 mm are inside.
TEST(Score, StraightLineHasItsLength)
{
    const Score s = scoreTicks(along({{0, -0.03}, {1, 0}, {2, 0.04}}));
    EXPECT_NEAR(s.pathLength, 70 * millimetre, 1e-9);
    EXPECT_NEAR(s.insertedPath, 40 * millimetre, 0.041 * millimetre);
    EXPECT_NEAR(s.deepest, 40 * millimetre, 1e-9);
}

// The margin is the least distance to a vital structure, the target left out, of ticks inside.
TEST(Score, MarginIsTheLeastDistanceToAVitalStructureInside)
{
    auto ticks = along({{0, -0.03}, {1, 0}, {2, 0.04}});
    EXPECT_NEAR(scoreTicks(ticks).vitalMargin, 0.1, 1e-12);
    ticks[500].distance[1] = 1e-3;  // outside
    ticks[1500].distance[0] = 2e-3;
    ticks[1500].distance[2] = 3e-3;
    EXPECT_NEAR(scoreTicks(ticks).vitalMargin, 3e-3, 1e-12);
    EXPECT_TRUE(std::isinf(scoreTicks(along({{0, -0.03}, {1, -0.01}})).vitalMargin));
}

// The third difference of block means of x = c t^3 / 6 is c exactly. At rest and at constant speed there is none.
TEST(Score, JerkOfACubicIsItsThirdDerivative)
{
    constexpr double c = 12.0;  // [m/s^3]
    JerkMeter cubic, straight;
    for (int i = 0; i < 2000; ++i) {
        const double t = i * 1e-3;
        cubic.add({0, c * t * t * t / 6, 0}, 1000);
        straight.add({0.02 * t, 0, 0}, 1000);
    }
    EXPECT_NEAR(cubic.rms(), c, 1e-6);
    EXPECT_NEAR(straight.rms(), 0, 1e-6);
}

// 2 N held against over 40 mm are 80 mJ; on the way back with the force the tissue gives them again.
TEST(Score, WorkOnTheTissueIsForceTimesWay)
{
    auto ticks = along({{0, 0.001}, {1, 0.041}});
    for (TickRecord& tick : ticks) {
        tick.basic = {0, -2, 0};
    }
    EXPECT_NEAR(scoreTicks(ticks).tissueWork, 0.08, 1e-9);
    ticks = along({{0, 0.001}, {1, 0.041}, {2, 0.001}});
    for (TickRecord& tick : ticks) {
        tick.basic = {0, -2, 0};
    }
    EXPECT_NEAR(scoreTicks(ticks).tissueWork, 0.0, 1e-9);
}

// A spring pressed by x takes k x^2 / 2 at any speed, and gives it back; a tremor in it takes nothing.
TEST(Score, WorkOnASpringIsItsEnergyAtAnySpeed)
{
    constexpr double k = 100, x = 0.04;  // [N/m], [m]
    const auto workOf = [&](std::vector<TickRecord> ticks) {
        for (TickRecord& tick : ticks) {
            tick.basic = {0, -k * std::max(0.0, tick.device.position.y), 0};
        }
        return scoreTicks(ticks).tissueWork;
    };
    for (const double seconds : {0.02, 0.1, 2.0}) {
        EXPECT_NEAR(workOf(along({{0, 0}, {seconds, x}})), k * x * x / 2, 1e-9) << seconds;
        EXPECT_NEAR(workOf(along({{0, 0}, {seconds, x}, {2 * seconds, 0}, {3 * seconds, -x}})), 0, 1e-9) << seconds;
    }
    std::vector<synthetic::Key> tremor{{0, 0}, {1, x}};
    for (int i = 0; i < 40; ++i) {
        tremor.push_back({1.05 + 0.05 * i, i % 2 == 0 ? x - 1e-3 : x});
    }
    EXPECT_NEAR(workOf(along(tremor)), k * x * x / 2, 1e-9);
}

// Two marks 12 mm apart across the finger, their middle 5 mm beside the target's; how deep a mark is does not count.
TEST(Score, MarksAreJudgedAcrossTheTool)
{
    SessionInfo info = synthetic::info();
    info.extra.emplace_back(targetShapeKey, toText({{0.01, 0.02, 0}, {0, 1, 0}, 0.010}));
    Scorer scorer(info);
    auto ticks = along({{0, -0.03}, {1, -0.01}});
    ticks[100].device = {.position = {0.009, -0.01, 0}, .buttons = buttonMark};
    ticks[200].device = {.position = {0.021, -0.03, 0}, .buttons = buttonMark};
    ticks[201].device = ticks[200].device;  // still pressed
    for (const TickRecord& tick : ticks) {
        scorer.add(tick);
    }
    const Score s = scorer.score();
    EXPECT_EQ(s.marks, 2U);
    EXPECT_NEAR(s.markError, 5e-3, 1e-9);
    EXPECT_NEAR(s.markSizeError, 2e-3, 1e-9);
}

// Back out again it is 40 mm more; a turn costs at most two steps of 0.2 mm, on leaving at most a tick.
TEST(Score, PathInsideIsInAndOut)
{
    const Score s = scoreTicks(along({{0, -0.03}, {1, 0}, {2, 0.04}, {3, -0.03}, {4, -0.01}}));
    EXPECT_NEAR(s.insertedPath, 80 * millimetre, 0.55 * millimetre);
    EXPECT_LE(s.insertedPath, 80 * millimetre);
}

// Steps of c = 0.2 mm are chords: a circle of radius r loses (c / r)^2 / 24 of its length, 1.7e-5, and steps end on ticks.
TEST(Score, CircleHasItsCircumference)
{
    std::vector<TickRecord> ticks(10001);
    const double radius = 10 * millimetre;
    for (std::size_t n = 0; n < ticks.size(); ++n) {
        const double angle = 2 * std::numbers::pi * static_cast<double>(n) / 10000;
        ticks[n].tick = n;
        ticks[n].device.position = radius * Vec3(std::cos(angle), std::sin(angle), 0);
    }
    EXPECT_NEAR(scoreTicks(ticks).pathLength, 2 * std::numbers::pi * radius, 2e-5 * 2 * std::numbers::pi * radius);
}

TEST(Score, NoiseOfAnEncoderAddsNoPath)
{
    std::vector<TickRecord> ticks(5000);
    for (std::size_t n = 0; n < ticks.size(); ++n) {
        ticks[n].tick = n;
        ticks[n].device.position.x = n % 2 == 0 ? 0 : 0.06 * millimetre;
    }
    EXPECT_LT(scoreTicks(ticks).pathLength, 0.2 * millimetre);
}

// From the touch at 1 s to the end at 3 s.
TEST(Score, TimeRunsFromTheFirstContactToTheEnd)
{
    EXPECT_NEAR(scoreTicks(along({{0, -0.03}, {1, 0}, {3, 0.04}})).seconds, 2, 0.0015);
    EXPECT_EQ(scoreTicks(along({{0, -0.03}, {3, -0.01}})).seconds, 0);
}

// Two reversals of 6 mm count, reversals of 4 mm or on one leg only do not, nor does leaving the body.
TEST(Score, RedirectIsMoreThanFiveMillimetresOutAndInAgain)
{
    const auto redirects = [](const std::vector<synthetic::Key>& keys) { return scoreTicks(along(keys)).redirects; };
    EXPECT_EQ(redirects({{0, -0.01}, {1, 0.040}, {2, 0.034}, {3, 0.040}, {4, 0.034}, {5, 0.040}}), 2U);
    EXPECT_EQ(redirects({{0, -0.01}, {1, 0.040}, {2, 0.036}, {3, 0.050}}), 0U);
    EXPECT_EQ(redirects({{0, -0.01}, {1, 0.040}, {2, 0.030}, {3, 0.034}, {4, 0.030}}), 0U);
    EXPECT_EQ(redirects({{0, -0.01}, {1, 0.040}, {2, -0.010}, {3, 0.040}}), 0U);
}

// Three touches, of which the last comes 50 ms after the one before and is the same.
TEST(Score, SkinContactsAreTouchesAfterATenthOfASecondOff)
{
    std::vector<TickRecord> ticks(2000);
    for (std::size_t n = 0; n < ticks.size(); ++n) {
        ticks[n].tick = n;
        const bool touching = (n >= 200 && n < 400) || (n >= 900 && n < 1000) || (n >= 1050 && n < 1200);
        ticks[n].phase = touching ? Phase::contact : Phase::free;
    }
    EXPECT_EQ(scoreTicks(ticks).skinContacts, 2U);
}

// |(3, 0, 4)| = 5 for half of the contact and 1 for the other half; without contact a force counts only for the peak.
TEST(Score, ForcesArePeakAndMeanOfTheTotal)
{
    std::vector<TickRecord> ticks(400);
    for (std::size_t n = 0; n < ticks.size(); ++n) {
        ticks[n].tick = n;
        ticks[n].phase = n < 200 ? Phase::contact : Phase::free;
        ticks[n].total = n < 100 ? Vec3(3, 0, 4) : n < 200 ? Vec3(0, 1, 0) : Vec3(0);
    }
    const Score s = scoreTicks(ticks);
    EXPECT_DOUBLE_EQ(s.peakForce, 5);
    EXPECT_DOUBLE_EQ(s.meanForce, 3);
}

// Both vital structures overlap for 100 of 300 ticks: the time is that of their union, 500 ticks.
TEST(Score, VitalContactIsTimeInAnyVitalStructure)
{
    auto ticks = along({{0, 0.01}, {2, 0.01}});
    for (std::size_t n = 300; n < 600; ++n) {
        ticks[n].distance[1] = -2 * millimetre;
    }
    for (std::size_t n = 500; n < 800; ++n) {
        ticks[n].distance[2] = -3 * millimetre;
    }
    for (std::size_t n = 0; n < 2000; ++n) {
        ticks[n].distance[0] = -1;
    }
    synthetic::addEvent(ticks[299], synthetic::event(EventKind::warning, 1, 0, 0.01));
    synthetic::addEvent(ticks[300], synthetic::event(EventKind::vitalTouch, 1, 0, 0));
    synthetic::addEvent(ticks[500], synthetic::event(EventKind::vitalTouch, 2, 0, 0));
    const Score s = scoreTicks(ticks);
    EXPECT_DOUBLE_EQ(s.vitalSeconds, 0.5);
    EXPECT_DOUBLE_EQ(s.vitalDepth, 3 * millimetre);
    EXPECT_EQ(s.vitalContacts, 2U);
    EXPECT_EQ(s.warnings, 1U);
}

TEST(Score, BestFiringHasTheMostPointsThenTheLargestShare)
{
    auto ticks = along({{0, 0.01}, {2, 0.01}});
    fire(ticks[100], 1 * millimetre, 0.2, 4 * millimetre);   // 12 + 4 + 9
    fire(ticks[200], 3 * millimetre, 0.6, 9 * millimetre);   // 30 + 9 + 7
    fire(ticks[300], 1 * millimetre, 0.6, 8 * millimetre);   // 30 + 8 + 9
    fire(ticks[400], -5 * millimetre, 0.1, 1 * millimetre);  // 6 + 1 + 10
    const Score s = scoreTicks(ticks);
    EXPECT_EQ(s.passes, 4U);
    EXPECT_DOUBLE_EQ(s.bestTargetFraction, 0.6);
    EXPECT_DOUBLE_EQ(s.targetingError, 1 * millimetre);
    EXPECT_DOUBLE_EQ(s.bestTargetLength, 8 * millimetre);
    fire(ticks[500], 1 * millimetre, 0.7, 8 * millimetre);  // as many
    EXPECT_DOUBLE_EQ(scoreTicks(ticks).bestTargetFraction, 0.7);
}

// A second shot beside the first hole fills half of the notch. The target's share of that is larger, though its axis lies
// in the hole.
TEST(Score, AFurtherShotTakesNoPointsFromTheCore)
{
    auto ticks = along({{0, 0.01}, {2, 0.01}});
    fire(ticks[100], 0, 0.562, 11.5 * millimetre);
    const double before = parts(scoreTicks(ticks)).core;
    fire(ticks[200], 0, 0.618, 0);
    const Score s = scoreTicks(ticks);
    EXPECT_DOUBLE_EQ(parts(s).core, before);
    EXPECT_DOUBLE_EQ(s.bestTargetLength, 11.5 * millimetre);
}

TEST(Score, NotchInsideTheTargetHasNoError)
{
    auto ticks = along({{0, 0.01}, {1, 0.01}});
    fire(ticks[100], -5 * millimetre, 1, 20 * millimetre);
    EXPECT_EQ(scoreTicks(ticks).targetingError, 0);
}

// One push, a core of target only, a firing inside it and no touch of anything vital is the perfect procedure.
TEST(Score, PerfectProcedureHasAHundredPoints)
{
    auto ticks = along({{0, -0.01}, {1, 0.04}, {2, -0.01}});
    fire(ticks[1000], 0, 1, 20 * millimetre);
    EXPECT_DOUBLE_EQ(scoreTicks(ticks).total, 100);
}

TEST(Score, WithoutAFiringThereAreOnlyPointsForTheVitalStructures)
{
    const Score s = scoreTicks(along({{0, -0.01}, {1, 0.04}, {2, -0.01}}));
    EXPECT_FALSE(std::isfinite(s.targetingError));
    EXPECT_EQ(parts(s).core, 0);
    EXPECT_EQ(parts(s).technique, 0);
    EXPECT_EQ(s.total, 25);
    EXPECT_EQ(scoreTicks(along({{0, -0.03}, {1, -0.01}})).total, 0);
}

double measured(const Score& s, std::string_view key)
{
    const auto at = std::ranges::find(measures(), key, [](const Measure& m) { return std::string_view(m.key); });
    return at->value(s);
}

// No core is a core without target only where one was asked for: "not a number" is left out of groups.
TEST(Score, ASessionHasOnlyMeasuresOfWhatItIsFor)
{
    Score s;
    s.aim.tool = datasets::ToolKind::needle;
    EXPECT_EQ(measured(s, "best_target_pct"), 0);
    EXPECT_TRUE(std::isinf(measured(s, "targeting_error_mm"))) << "worse than any";
    for (const auto task : {datasets::SessionTask::touch, datasets::SessionTask::advance, datasets::SessionTask::find}) {
        s.aim.task = task;
        EXPECT_TRUE(std::isnan(measured(s, "best_target_pct")) && std::isnan(measured(s, "best_target_length_mm")));
        EXPECT_TRUE(std::isnan(measured(s, "targeting_error_mm")));
        EXPECT_EQ(std::isnan(measured(s, "rest_s")), task != datasets::SessionTask::touch);
    }
    s.passes = 1;
    EXPECT_EQ(measured(s, "best_target_pct"), 0) << "a core that was taken is judged";
    EXPECT_TRUE(std::isnan(measured(s, "probe_s")) && std::isnan(measured(s, "ct_scans")));
}

// A mark with a needle, by a key that slipped: no core is no core.
TEST(Score, AMarkDoesNotMakeABiopsyAPalpation)
{
    Score s;
    s.aim.tool = datasets::ToolKind::needle;
    s.skinContacts = 1;
    s.marks = 1;
    EXPECT_EQ(judgedBy(s), Judged::core);
    EXPECT_EQ(parts(s).core, 0);
    EXPECT_EQ(parts(s).technique, 0);
    s.aim.tool = datasets::ToolKind::capsule;
    EXPECT_EQ(judgedBy(s), Judged::marks);
}

// Half the target fraction of a full mark, half its length, half its error: 15 + 5 + 5. Two touches, 1 s and 0.5 mm: 25 (1
// - 0.8 - 0.1 - 0.05). Three passes, two redirects, two contacts, twice the path, 6.25 N: 5 (0.5 + 0.75 + 0.5 + 0.5 + 0.5).
TEST(Score, PointsFollowTheFormula)
{
    Score s;
    s.passes = 3;
    s.bestTargetFraction = 0.25;
    s.bestTargetLength = 5 * millimetre;
    s.targetingError = 5 * millimetre;
    s.vitalContacts = 2;
    s.vitalSeconds = 1;
    s.vitalDepth = 0.5 * millimetre;
    s.skinContacts = 2;
    s.redirects = 2;
    s.deepest = 40 * millimetre;
    s.insertedPath = 160 * millimetre;
    s.peakForce = 6.25;
    EXPECT_NEAR(parts(s).core, 25, 1e-12);
    EXPECT_NEAR(parts(s).vital, 1.25, 1e-12);
    EXPECT_NEAR(parts(s).technique, 13.75, 1e-12);
}

// However careful and straight: a core without target is no biopsy.
TEST(Score, AMissKeepsNoPointsForTechnique)
{
    Score s;
    s.skinContacts = 1;
    s.passes = 1;
    s.insertedPath = 0.06;
    s.deepest = 0.03;
    s.targetingError = 14e-3;
    EXPECT_DOUBLE_EQ(parts(s).technique, 0.0);
    EXPECT_DOUBLE_EQ(parts(s).core + parts(s).vital, 25.0);
    s.targetingError = 0;
    s.bestTargetFraction = 0.05;
    EXPECT_DOUBLE_EQ(parts(s).technique, 12.5);
    s.bestTargetFraction = 0.1;
    EXPECT_DOUBLE_EQ(parts(s).technique, 25.0);
}

// A tip that goes on from the target's middle by 31 mm: what counts is from where it left the target, and the way back and
// in again begins anew. Such a needle has no technique to be praised for.
TEST(Score, DepthBeyondTheTargetIsFromWhereTheTipLeftIt)
{
    Scorer scorer(synthetic::info());
    TickRecord tick;
    tick.phase = Phase::inserted;
    const auto push = [&](double from, double to) {
        const double way = to > from ? 0.5 * millimetre : -0.5 * millimetre;
        for (double depth = from; std::abs(depth - to) > 1e-9; depth += way) {
            tick.inserted = depth;
            tick.device.position = Vec3(0.0, depth, 0.0);
            tick.distance.fill(1);
            tick.distance[0] = std::abs(depth - 15 * millimetre) - 5 * millimetre;
            scorer.add(tick);
            ++tick.tick;
        }
    };
    push(0, 14 * millimetre);
    EXPECT_NEAR(scorer.score().beyondTarget, 0, 1e-9);
    push(14 * millimetre, 46.5 * millimetre);
    EXPECT_NEAR(scorer.score().beyondTarget, 26 * millimetre, 0.6 * millimetre) << "a step";
    push(46 * millimetre, 2 * millimetre);
    push(2 * millimetre, 18 * millimetre);
    EXPECT_NEAR(scorer.score().beyondTarget, 26 * millimetre, 0.6 * millimetre) << "a step";

    Score good;
    good.skinContacts = good.passes = 1;
    good.bestTargetFraction = 0.6;
    good.beyondTarget = 3 * millimetre;
    EXPECT_DOUBLE_EQ(parts(good).technique, 25.0);
    good.beyondTarget = 26 * millimetre;
    EXPECT_DOUBLE_EQ(parts(good).technique, 0.0);
}

// Every point of the total falls, or stays, when a measure gets worse.
TEST(Score, WorseMeasuresNeverGiveMorePoints)
{
    std::mt19937 random(1);
    std::uniform_real_distribution<double> unit(0, 1);
    const auto below = [&](std::uint32_t n) { return static_cast<std::uint32_t>(random() % n); };
    const auto total = [](const Score& s) {
        const ScoreParts p = parts(s);
        return p.core + p.vital + p.technique;
    };
    for (int round = 0; round < 2000; ++round) {
        Score s;
        s.passes = 1 + below(6);
        s.skinContacts = 1 + below(6);
        s.redirects = below(6);
        s.vitalContacts = below(3);
        s.vitalSeconds = unit(random);
        s.vitalDepth = 5 * millimetre * unit(random);
        s.bestTargetFraction = unit(random);
        s.bestTargetLength = 20 * millimetre * unit(random);
        s.targetingError = 15 * millimetre * unit(random);
        s.deepest = 40 * millimetre;
        s.insertedPath = s.deepest * (1 + 4 * unit(random));
        s.peakForce = 10 * unit(random);
        s.beyondTarget = 20 * millimetre * unit(random);
        const double before = total(s);
        EXPECT_GE(before, 0);
        EXPECT_LE(before, 100);
        for (const auto& worsen : std::vector<std::function<void(Score&)>>{
                 [](Score& w) { ++w.passes; }, [](Score& w) { ++w.skinContacts; }, [](Score& w) { ++w.redirects; },
                 [](Score& w) { ++w.vitalContacts; }, [](Score& w) { w.vitalSeconds += 0.3; },
                 [](Score& w) { w.vitalDepth += millimetre; }, [](Score& w) { w.bestTargetFraction *= 0.8; },
                 [](Score& w) { w.bestTargetLength *= 0.8; }, [](Score& w) { w.targetingError += millimetre; },
                 [](Score& w) { w.insertedPath *= 1.3; }, [](Score& w) { w.peakForce += 1; },
                 [](Score& w) { w.beyondTarget += millimetre; }}) {
            Score w = s;
            worsen(w);
            EXPECT_LE(total(w), before + 1e-12);
        }
    }
}

// The same of what is asked for in place of a core.
TEST(Score, WorseMeasuresOfATouchAndAnAdvanceNeverGiveMorePoints)
{
    std::mt19937 random(2);
    std::uniform_real_distribution<double> unit(0, 1);
    for (int round = 0; round < 2000; ++round) {
        Score s;
        s.aim.task = round % 2 == 0 ? datasets::SessionTask::touch : datasets::SessionTask::advance;
        s.skinContacts = 1 + static_cast<std::uint32_t>(random() % 6);
        s.redirects = static_cast<std::uint32_t>(random() % 6);
        s.rest = 4 * unit(random);
        s.deepest = 4 * millimetre * unit(random);
        s.insertedPath = s.deepest * (1 + 4 * unit(random));
        s.tipToTarget = 12 * millimetre * unit(random);
        s.beyondTarget = 20 * millimetre * unit(random);
        s.peakForce = 10 * unit(random);
        const ScoreParts p = parts(s);
        EXPECT_GE(p.core, 0);
        EXPECT_LE(p.core, 50);
        EXPECT_LE(p.technique, 25);
        for (const auto& worsen : std::vector<std::function<void(Score&)>>{
                 [](Score& w) { ++w.skinContacts; }, [](Score& w) { ++w.redirects; }, [](Score& w) { w.rest *= 0.8; },
                 [](Score& w) { w.deepest += w.aim.task == datasets::SessionTask::touch ? millimetre : 0; },
                 [](Score& w) { w.tipToTarget += millimetre; }, [](Score& w) { w.beyondTarget += millimetre; },
                 [](Score& w) { w.peakForce += 1; }, [](Score& w) { w.insertedPath *= 1.3; }}) {
            Score w = s;
            worsen(w);
            const ScoreParts q = parts(w);
            EXPECT_LE(q.core + q.technique, p.core + p.technique + 1e-12);
        }
    }
}

// The score of the live session and that of its record are the same bits.
TEST(Score, LiveAndRecordedAreTheSame)
{
    const synthetic::Folder folder;
    const auto ticks = synthetic::procedure(6, 0.4, 5);
    synthetic::record(folder / "a", synthetic::info(), ticks);
    const Score live = scoreTicks(ticks);
    const Score recorded = scoreOf(Record(folder / "a"));
    EXPECT_EQ(live.total, recorded.total);
    EXPECT_EQ(live.seconds, recorded.seconds);
    EXPECT_EQ(live.pathLength, recorded.pathLength);
    EXPECT_EQ(live.insertedPath, recorded.insertedPath);
    EXPECT_EQ(live.deepest, recorded.deepest);
    EXPECT_EQ(live.peakForce, recorded.peakForce);
    EXPECT_EQ(live.meanForce, recorded.meanForce);
    EXPECT_EQ(live.targetingError, recorded.targetingError);
    EXPECT_EQ(live.bestTargetFraction, recorded.bestTargetFraction);
    EXPECT_EQ(live.vitalSeconds, recorded.vitalSeconds);
    EXPECT_EQ(live.warnings, recorded.warnings);
    EXPECT_EQ(live.warnings, 1U);
    EXPECT_EQ(live.redirects, 1U);
    EXPECT_EQ(describe(live), describe(recorded));
}

TEST(Score, MoreSkillScoresHigher)
{
    EXPECT_GT(scoreTicks(synthetic::procedure(6, 0.9, 1)).total, scoreTicks(synthetic::procedure(6, 0.2, 1)).total + 5);
}

}  // namespace
}  // namespace palpate::haptics
