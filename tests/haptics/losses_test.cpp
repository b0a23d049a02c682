#include <haptics/losses.h>

#include <base/words.h>

#include <tests/haptics/synthetic_session.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <numeric>
#include <random>

namespace palpate::haptics {
namespace {

constexpr double oneMillimetre = 1e-3;

// Notch of 20 mm along the back direction whose middle lies `away` from a target of 10 mm at 0, after a touch of the skin.
std::vector<Loss> lossesOfCore(Vec3 away, double fraction, double error)
{
    SessionInfo info = synthetic::info();
    info.extra.emplace_back(targetShapeKey, toText({{0, 0, 0}, {0, 1, 0}, 0.010}));
    LossWatch watch(info);
    std::vector<TickRecord> ticks(3000);
    for (std::size_t n = 0; n < ticks.size(); ++n) {
        ticks[n].tick = n;
        ticks[n].distance = {1, 1, 1};
        ticks[n].phase = n < 1000 ? Phase::free : Phase::inserted;
        ticks[n].inserted = n < 1000 ? 0 : 0.02;
    }
    TickRecord& shot = ticks[2000];
    shot.fired = true;
    shot.core.targetFraction = fraction;
    shot.core.targetLength = 0.02 * fraction;
    shot.core.notchStart = away - Vec3(0, 0.01, 0);
    shot.core.notchEnd = away + Vec3(0, 0.01, 0);
    synthetic::addEvent(shot, synthetic::event(EventKind::fire, 0, 4, error));
    for (const TickRecord& tick : ticks) {
        watch.add(tick);
    }
    return watch.losses(info);
}

TEST(Losses, SayWhereTheCoreLay)
{
    const auto feet = lossesOfCore({0, 0, -14 * oneMillimetre}, 0, 9 * oneMillimetre);
    ASSERT_FALSE(feet.empty());
    EXPECT_EQ(feet[0].measure, "best_target_pct");
    EXPECT_EQ(feet[0].words,
              "No core hit the tumour: the nearest lay 9.0 mm beside it; it lay 14.0 mm off its middle towards the feet");
    EXPECT_DOUBLE_EQ(feet[0].at.value(), 2.0);
    EXPECT_TRUE(lossesOfCore({8 * oneMillimetre, 0, 8 * oneMillimetre}, 0, 0.003)[0].words.ends_with(
        "it lay 11.3 mm off its middle towards the patient's left and the head"));
    EXPECT_NE(lossesOfCore({0, 12 * oneMillimetre, 0}, 0.2, 0)[0].words.find("it lay 12.0 mm too deep"), std::string::npos);
    EXPECT_NE(lossesOfCore({0, -12 * oneMillimetre, 0}, 0.2, 0)[0].words.find("12.0 mm not deep enough"),
              std::string::npos);
}

TEST(Losses, HaveDirectionsOfThePatient)
{
    EXPECT_EQ(directionInWords({0.005, 0, 0}), "towards the patient's left");
    EXPECT_EQ(directionInWords({0, -0.005, 0.001}), "towards the front");
    EXPECT_EQ(directionInWords({0, 0.005, -0.004}), "towards the back and the feet");
    EXPECT_EQ(directionInWords({0.0005, 0, 0}), "");
}

// With the total they add up to 100, whatever happened: every point that is lost is explained.
TEST(Losses, AndTheTotalAddUpToAHundred)
{
    std::mt19937_64 random(3);
    for (int round = 0; round < 60; ++round) {
        SessionInfo info = synthetic::info();
        info.extra.emplace_back(targetShapeKey, toText({{0.01, 0.02, 0}, {0, 1, 0}, 0.010}));
        LossWatch watch(info);
        auto ticks = synthetic::procedure(3, static_cast<double>(random() % 11) / 10, static_cast<std::uint32_t>(round));
        for (TickRecord& tick : ticks) {
            tick.total *= round % 3;
            const bool touched = round % 4 == 1 && tick.tick > 1500 && tick.tick % 400 == 0;
            if (touched && tick.eventCount < 10) {
                synthetic::addEvent(tick, synthetic::event(EventKind::vitalTouch, 2, 0, 0.001));
            }
            tick.device.buttons |= round % 5 == 2 && tick.tick % 900 < 10 ? buttonMark : 0;
            tick.fired = tick.fired && round % 7 != 3;
            watch.add(tick);
        }
        const auto losses = watch.losses(info);
        const double lost =
            std::accumulate(losses.begin(), losses.end(), 0.0, [](double sum, const Loss& l) { return sum + l.points; });
        EXPECT_NEAR(lost + watch.score().total, 100, 0.05) << round;
        EXPECT_TRUE(std::ranges::is_sorted(losses, std::ranges::greater{}, &Loss::points));
        for (const Loss& loss : losses) {
            EXPECT_TRUE(!loss.at || (*loss.at >= 0 && *loss.at < 3)) << loss.words;
        }
    }
}

// Marked 25 mm beside the lump: neither its size nor gentle pressing is worth anything.
TEST(Losses, APalpationThatMissesKeepsNoMoreThanABiopsyThatMisses)
{
    Score s;
    s.aim.tool = datasets::ToolKind::capsule;
    s.skinContacts = 1;
    s.marks = 2;
    s.markError = 25 * oneMillimetre;
    s.markSizeError = 0;
    s.peakForce = 1;
    EXPECT_EQ(parts(s).core + parts(s).technique, 0);
    s.markError = 9 * oneMillimetre;
    EXPECT_EQ(parts(s).technique, 25);
}

// The middle of the marks that count is the score's: of marks after the 32nd no loss speaks.
TEST(Losses, MarksThatDoNotCountTurnNoDirection)
{
    SessionInfo info = synthetic::info();
    info.sceneText = "task = \"find\"\n[tool]\nkind = \"capsule\"\n";
    info.extra.emplace_back(targetShapeKey, toText({{0, 0, 0}, {0, 1, 0}, 0.010}));
    LossWatch watch(info);
    TickRecord tick;
    tick.distance = {1, 1, 1};
    tick.phase = Phase::contact;
    for (std::uint64_t i = 0; i < 120; ++i) {
        tick.tick = i;
        tick.device.buttons = i % 2 == 0 ? buttonMark : 0;
        tick.device.position = i < 64 ? Vec3(12 * oneMillimetre, 0, 0) : Vec3(0, 0, -50 * oneMillimetre);
        watch.add(tick);
    }
    EXPECT_EQ(watch.score().marks, 32U);
    const std::vector<Loss> losses = watch.losses(info);
    const auto place = std::ranges::find(losses, "mark_error_mm", &Loss::measure);
    ASSERT_NE(place, losses.end());
    EXPECT_TRUE(place->words.ends_with("12.0 mm beside that of the tumour, towards the patient's left")) << place->words;
    EXPECT_DOUBLE_EQ(place->at.value(), 0.062);
}

// Ticks at rest on the skin, or inside at a depth, between two seconds of air.
struct Stay {
    double seconds = 0, depth = 0;  // [s], [m]; 0: on the skin
    double force = 1;               // [N]
    double target = 1;              // distance of the tip [m]
};

LossWatch watched(const std::string& scene, const std::vector<Stay>& stays, bool fires = false)
{
    SessionInfo info = synthetic::info();
    info.sceneText = scene;
    LossWatch watch(info);
    std::uint64_t n = 0;
    const auto add = [&](const Stay& stay, Phase phase) {
        for (int i = 0; i < static_cast<int>(1000 * stay.seconds); ++i) {
            TickRecord tick;
            tick.tick = n++;
            tick.phase = phase;
            tick.inserted = stay.depth;
            tick.device.position = {0, stay.depth, 0};
            tick.total = {0, phase == Phase::free ? 0 : -stay.force, 0};
            tick.distance = {stay.target, 1, 1};
            tick.fired = fires && phase == Phase::inserted && i == 10;
            watch.add(tick);
        }
    };
    add({1}, Phase::free);
    for (const Stay& stay : stays) {
        add(stay, stay.depth > 0 ? Phase::inserted : Phase::contact);
    }
    add({1}, Phase::free);
    return watch;
}

std::vector<Loss> lossesIn(const std::string& scene, const LossWatch& watch)
{
    SessionInfo info = synthetic::info();
    info.sceneText = scene;
    return watch.losses(info);
}

const std::string touchScene = "task = \"touch\"\n", advanceScene = "task = \"advance\"\n",
                  sphereScene = "[tool]\nkind = \"sphere\"\n";

TEST(Losses, ATouchLosesNothingForACoreThatNobodyAskedFor)
{
    const LossWatch rested = watched(touchScene, {{3.1}});
    EXPECT_EQ(rested.score().total, 100);
    EXPECT_TRUE(lossesIn(touchScene, rested).empty());
    EXPECT_NEAR(rested.score().rest, 3.1, 1e-9);

    const LossWatch hasty = watched(touchScene, {{1.5}});
    EXPECT_NEAR(hasty.score().total, 62.5, 1e-9);
    ASSERT_EQ(lossesIn(touchScene, hasty).size(), 1U);
    EXPECT_EQ(lossesIn(touchScene, hasty)[0].measure, "rest_s");

    const LossWatch hard = watched(touchScene, {{3.1, 0, 3}});
    ASSERT_EQ(lossesIn(touchScene, hard).size(), 1U);
    EXPECT_EQ(inWords(lossesIn(touchScene, hard)[0]), "-6 points: The force rose to 3.0 N (at 1.0 s)");
}

TEST(Losses, ATouchThatPiercesKeepsThePointsForVitalStructuresAlone)
{
    const LossWatch pierced = watched(touchScene, {{3.1}, {1, 0.02}}, true);
    EXPECT_EQ(pierced.score().total, 25);
    const auto losses = lossesIn(touchScene, pierced);
    ASSERT_EQ(losses.size(), 1U);
    EXPECT_EQ(inWords(losses[0]), "-75 points: The skin was pierced, 20.0 mm deep; it was only to be touched (at 4.1 s)");
}

TEST(Losses, AnAdvanceIsJudgedByTheTipAndNotByACore)
{
    const LossWatch reached = watched(advanceScene, {{1}, {1, 0.02, 1, 0.005}, {1, 0.03, 1, -0.005}});
    EXPECT_EQ(reached.score().total, 100);
    EXPECT_TRUE(lossesIn(advanceScene, reached).empty());

    const LossWatch shallow = watched(advanceScene, {{1}, {1, 0.02, 1, 0.004}});
    const auto losses = lossesIn(advanceScene, shallow);
    ASSERT_EQ(losses.size(), 1U);
    EXPECT_EQ(inWords(losses[0]), "-30 points: The tip came within 4.0 mm of the tumour and not into it");
    EXPECT_EQ(lossesIn(advanceScene, watched(advanceScene, {{1}}))[0].words, "The needle did not go in");
}

TEST(Losses, AToolThatTakesNoCoreLosesNothingForOne)
{
    const LossWatch pressed = watched(sphereScene, {{1}});
    EXPECT_EQ(pressed.score().total, 100);
    EXPECT_TRUE(lossesIn(sphereScene, pressed).empty());
    const std::string finger = "task = \"find\"\n[tool]\nkind = \"capsule\"\n";
    const LossWatch unmarked = watched(finger, {{1}});
    EXPECT_EQ(unmarked.score().total, 25);
    EXPECT_EQ(inWords(lossesIn(finger, unmarked)[0]), "-75 points: Nothing was marked");
}

// Records from before there were tasks, and scenes that say what they ask for, are scored as they were.
TEST(Losses, ABiopsyWithoutAShotIsScoredAsBefore)
{
    for (const std::string scene : {"", "task = \"biopsy\"\n", "name = ", "task = \"dance\"\n"}) {
        const LossWatch dry = watched(scene, {{1}, {1, 0.03}});
        EXPECT_EQ(dry.score().total, 25) << scene;
        EXPECT_EQ(lossesIn(scene, dry)[0].words, "The gun was not fired: there is no core") << scene;
    }
}

// Who fires too early is told so, and when, and not that the gun was left alone.
TEST(Losses, AShotOutsideTheBodyIsNoGunThatWasNotFired)
{
    const SessionInfo info = synthetic::info();
    LossWatch watch(info);
    for (std::uint64_t n = 0; n < 1000; ++n) {
        TickRecord tick;
        tick.tick = n;
        tick.phase = n < 500 ? Phase::free : Phase::contact;
        tick.distance = {1, 1, 1};
        if (n == 250) {
            synthetic::addEvent(tick, synthetic::event(EventKind::fireRefused, 0xFF, 0, 0));
        }
        watch.add(tick);
    }
    EXPECT_EQ(inWords(watch.losses(info)[0]),
              "-75 points: The gun was fired only outside the body: there is no core (at 0.2 s)");
}

// Who fires with the tip at a rib is told of the rib; a core that a rib has cut short says so.
TEST(Losses, SayWhatBoneDidToAShot)
{
    SessionInfo info = synthetic::info();
    info.tissues = {"air", "liver", "rib"};
    const auto wordsAfter = [&](EventKind kind, double value, bool fired) {
        LossWatch watch(info);
        for (std::uint64_t n = 0; n < 1000; ++n) {
            TickRecord tick;
            tick.tick = n;
            tick.phase = n < 200 ? Phase::contact : Phase::inserted;
            tick.inserted = n < 200 ? 0 : 0.02;
            tick.distance = {1, 1, 1};
            if (n == 500) {
                tick.fired = fired;
                synthetic::addEvent(tick, synthetic::event(EventKind::fire, 0, 1, 8e-3));
                synthetic::addEvent(tick, synthetic::event(kind, 0xFF, 2, value));
            }
            watch.add(tick);
        }
        return inWords(watch.losses(info)[0]);
    };
    EXPECT_EQ(wordsAfter(EventKind::fireRefused, 0, false),
              "-75 points: The gun was fired only with the tip at rib: there is no core (at 0.5 s)");
    EXPECT_NE(wordsAfter(EventKind::throwStopped, 3.2e-3, true).find("; its throw was stopped by rib after 3.2 mm"),
              std::string::npos);
    EXPECT_EQ(wordsAfter(EventKind::puncture, 3.2e-3, true).find("stopped"), std::string::npos);
}

TEST(Losses, OfEveryTaskAddUpToAHundredWithTheTotal)
{
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> unit(0, 1);
    for (int round = 0; round < 100; ++round) {
        const std::string scene = std::array{touchScene, advanceScene, sphereScene}[static_cast<std::size_t>(round % 3)];
        std::vector<Stay> stays{{3 * unit(random), 0, 6 * unit(random)}};
        for (int i = 0; i < round % 5; ++i) {
            const double depth = round % 2 == 0 ? 0.04 * unit(random) : 0.002 * unit(random);
            stays.push_back({0.2, depth, 6 * unit(random), 0.015 * unit(random) - 0.001});
        }
        const LossWatch watch = watched(scene, stays);
        double sum = watch.score().total;
        for (const Loss& loss : lossesIn(scene, watch)) {
            sum += loss.points;
        }
        EXPECT_NEAR(sum, 100, 0.05) << round;
    }
}

// The words are in the language of who reads them, and so is what stands around them.
TEST(Losses, ALineIsInOneLanguage)
{
    const Loss loss{"", 75, "Es wurde nicht ausgelöst", 1.5};
    base::useLanguage("de");
    const std::string line = inWords(loss);
    base::useLanguage("en");
    EXPECT_EQ(line, "-75 Punkte: Es wurde nicht ausgelöst (bei 1,5 s)");
}

}  // namespace
}  // namespace palpate::haptics
