#include "models.h"
#include "synthetic_session.h"

#include <haptics/broadcast.h>
#include <haptics/replay.h>
#include <haptics/score.h>
#include <haptics/simulation.h>
#include <haptics/trainee.h>

#include <gtest/gtest.h>

#include <string>

namespace palpate::haptics {
namespace {

// A press counts once, however long it lasts; each scan has the dose that its scene says.
TEST(Ct, EachPressIsAScanAndItsDose)
{
    SessionInfo info = synthetic::info();
    info.extra.emplace_back(scanDoseKey, "7.5");
    Scorer scorer(info);
    channel::State state;
    TickRecord r;
    for (const bool down : {false, true, true, true, false, true, false, false, true}) {
        r.device.buttons = down ? buttonPicture : 0U;
        scorer.add(r);
        showTick(r, {}, state);
        ++r.tick;
    }
    const Score s = scorer.score();
    EXPECT_EQ(s.scans, 3U);
    EXPECT_EQ(state.pictures, 3U) << "viewers count the same";
    EXPECT_DOUBLE_EQ(s.scanDose, 7.5);
    Scorer without(synthetic::info());
    r.device.buttons = buttonPicture;
    without.add(r);
    EXPECT_EQ(without.score().scans, 0U);
}

// The viewers show a pin where the tool was, on the surface that it pressed in.
TEST(Marks, AreSeenWhereTheToolWasWhenItsButtonWentDown)
{
    channel::State state;
    TickRecord r;
    r.phase = Phase::contact;
    for (const bool down : {false, true, true, false, false, true}) {
        r.device.buttons = down ? buttonMark : 0U;
        r.proxy = {1e-3 * static_cast<double>(r.tick), 0, 0};
        showTick(r, {}, state);
        ++r.tick;
    }
    ASSERT_EQ(state.marks, 2U);
    EXPECT_FLOAT_EQ(state.mark[0].place[0], 1e-3F);
    EXPECT_FLOAT_EQ(state.mark[1].place[0], 5e-3F);
    EXPECT_FLOAT_EQ(state.mark[1].axis[1], 1.0F);
}

// Taken back from the last one on, once for each press; where there is none, nothing happens.
TEST(Marks, AreTakenBackFromTheLastOneOn)
{
    channel::State state;
    TickRecord r;
    for (const std::uint32_t buttons : {buttonMark, 0U, buttonMark, 0U, buttonUnmark, buttonUnmark, 0U, buttonMark}) {
        r.device.buttons = buttons;
        r.device.position = {1e-3 * static_cast<double>(r.tick), 0, 0};
        showTick(r, {}, state);
        ++r.tick;
    }
    ASSERT_EQ(state.marks, 2U);
    EXPECT_FLOAT_EQ(state.mark[0].place[0], 0.0F);
    EXPECT_FLOAT_EQ(state.mark[1].place[0], 7e-3F);
    for (int i = 0; i < 3; ++i) {
        r.device.buttons = i % 2 == 0 ? buttonUnmark : 0U;
        showTick(r, {}, state);
    }
    r.device.buttons = 0;
    showTick(r, {}, state);
    r.device.buttons = buttonUnmark;
    showTick(r, {}, state);
    EXPECT_EQ(state.marks, 0U);
}

// Of three marks the second is taken back: what is left are two 12 mm apart, their middle 5 mm beside the target's.
TEST(Marks, ThatWereTakenBackDoNotCount)
{
    SessionInfo info = synthetic::info();
    info.extra.emplace_back(targetShapeKey, toText({{0.01, 0.02, 0}, {0, 1, 0}, 0.010}));
    Scorer scorer(info);
    const auto press = [&scorer](std::uint32_t button, double x) {
        TickRecord r;
        r.device.position = {x, -0.01, 0};
        for (const std::uint32_t buttons : {button, button, 0U}) {
            r.device.buttons = buttons;
            scorer.add(r);
            ++r.tick;
        }
    };
    press(buttonUnmark, 0);  // there is none yet
    press(buttonMark, 0.009);
    press(buttonMark, 0.070);
    press(buttonUnmark, 0);
    press(buttonMark, 0.021);
    const Score s = scorer.score();
    EXPECT_EQ(s.marks, 2U);
    EXPECT_NEAR(s.markError, 5e-3, 1e-9);
    EXPECT_NEAR(s.markSizeError, 2e-3, 1e-9);
    ASSERT_EQ(scorer.marks().size(), 2U);
    EXPECT_EQ(scorer.marks()[1].x, 0.021);
}

TEST(Ct, ADoseThatIsNoneCountsNothing)
{
    for (const char* text : {"", "much", "nan", "-3", "inf"}) {
        SessionInfo info;
        info.extra.emplace_back(scanDoseKey, text);
        EXPECT_EQ(scanDoseOf(info), 0.0) << text;
    }
}

// A scripted trainee scans when it looks, before the shot and after it.
TEST(Ct, ATraineeScansAtEachLook)
{
    const auto model = tests::modelOf(tests::layeredScene + "[model]\nlevel = \"spring\"\n[ct]\nctdi_mgy = 4\n");
    EXPECT_NEAR(scanDoseOf(infoOf(model)), 4 * 3 * 0.5, 1e-9);
    const auto scansOf = [&](const SessionModel& of) {
        Trainee trainee(of, skillCalled("expert"), 3, 0.02);
        Simulation simulation(of);
        Scorer scorer(infoOf(of));
        std::uint32_t shots = 0;
        for (int i = 0; i < 60000 && !trainee.finished(); ++i) {
            const TickRecord record = simulation.tick(trainee.read());
            trainee.observe(record);
            scorer.add(record);
            shots += record.fired ? 1 : 0;
        }
        EXPECT_GE(shots, 1U);
        return scorer.score().scans;
    };
    EXPECT_GE(scansOf(model), 3U);
    EXPECT_EQ(scansOf(tests::modelOf(tests::layeredScene + "[model]\nlevel = \"spring\"\n")), 0U);
}

}  // namespace
}  // namespace palpate::haptics
