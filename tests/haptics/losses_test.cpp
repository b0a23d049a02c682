#include <haptics/losses.h>

#include <tests/haptics/synthetic_session.h>

#include <gtest/gtest.h>

#include <algorithm>
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
    s.skinContacts = 1;
    s.marks = 2;
    s.markError = 25 * oneMillimetre;
    s.markSizeError = 0;
    s.peakForce = 1;
    EXPECT_EQ(parts(s).core + parts(s).technique, 0);
    s.markError = 9 * oneMillimetre;
    EXPECT_EQ(parts(s).technique, 25);
}

}  // namespace
}  // namespace palpate::haptics
