#include <trainer/grip.h>
#include <trainer/state.h>

#include <gtest/gtest.h>

namespace palpate::trainer {
namespace {

TEST(Grip, EachButtonHasItsMeaningAndOtherLinesHaveNone)
{
    EXPECT_EQ(gripLine("button forward").press, Press::activate);
    EXPECT_EQ(gripLine("button right").press, Press::next);
    EXPECT_EQ(gripLine("button left").press, Press::previous);
    EXPECT_EQ(gripLine("button centre").press, Press::back);
    for (const char* line : {"", "button", "button forward ", "palpate: button forward", "ready: the buttons"})
        EXPECT_FALSE(gripLine(line).press) << line;
    EXPECT_EQ(gripLine("ready: the buttons").ready, true);
    EXPECT_EQ(gripLine("waiting: no Falcon is plugged in").ready, false);
    EXPECT_FALSE(gripLine("button left").ready);
}

// A device is one program's at a time: what else takes it comes first, and so does another window.
TEST(Grip, IsListenedToOnlyWhileNobodyElseHasTheDevice)
{
    State state;
    EXPECT_FALSE(listensToGrip(state)) << "keys go elsewhere";
    state.listening = true;
    EXPECT_TRUE(listensToGrip(state));
    for (bool State::*busy : {&State::running, &State::trying, &State::pushing}) {
        state.*busy = true;
        EXPECT_FALSE(listensToGrip(state));
        state.*busy = false;
    }
    state.screen = Screen::devices;
    EXPECT_FALSE(listensToGrip(state)) << "the look for devices opens it";
    state.devices.done = true;
    EXPECT_TRUE(listensToGrip(state));
    state.screen = Screen::session;
    EXPECT_FALSE(listensToGrip(state));
}

}  // namespace
}  // namespace palpate::trainer
