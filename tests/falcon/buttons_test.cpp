#include <haptics/falcon/buttons.h>
#include <tests/falcon/rig.h>

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace palpate::falcon {
namespace {

constexpr double step = 5e-3;  // between two readings [s]

// What presses() tells of one reading after the other.
std::vector<int> told(const std::vector<std::uint8_t>& readings)
{
    Presses presses;
    std::vector<int> all;
    double now = 1;
    for (const std::uint8_t buttons : readings) {
        if (const std::uint8_t down = presses.take(buttons, now += step); down != 0) {
            all.push_back(down);
        }
    }
    return all;
}

std::vector<std::uint8_t> operator+(std::vector<std::uint8_t> a, const std::vector<std::uint8_t>& b)
{
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

std::vector<std::uint8_t> held(std::uint8_t buttons, std::size_t readings = 10)
{
    return std::vector<std::uint8_t>(readings, buttons);
}

TEST(FalconButtons, APressIsToldOnceHoweverLongItLasts)
{
    EXPECT_EQ(told(held(0) + held(buttonForward, 200) + held(0) + held(buttonForward)),
              (std::vector<int>{buttonForward, buttonForward}));
}

TEST(FalconButtons, OneReadingAloneIsNoPress)
{
    EXPECT_EQ(told(held(0) + held(buttonLeft, 1) + held(0) + held(buttonRight, 2) + held(0)), std::vector<int>{});
    EXPECT_EQ(told(held(0) + held(buttonLeft) + held(0, 1) + held(buttonLeft)), std::vector<int>{buttonLeft});
}

// The left button ends a session when it is held: the window behind it must not take that for a press of its own.
TEST(FalconButtons, WhatIsHeldFromTheBeginningIsNoPress)
{
    EXPECT_EQ(told(held(buttonLeft, 100) + held(0) + held(buttonLeft)), std::vector<int>{buttonLeft});
    EXPECT_EQ(told(held(buttonLeft) + held(buttonLeft | buttonCentre)), std::vector<int>{buttonCentre});
}

TEST(FalconButtons, AreToldOfAFalconThatWasNeverHomedAndWithoutAForce)
{
    Rig rig({syntheticFirmware(), 0.98, false});
    rig.link.connect(rig.stop);
    ASSERT_NE(rig.device.homed(), allHomed);
    const std::vector<std::uint8_t> pattern{0, buttonForward, 0, buttonRight, 0, buttonCentre, 0, buttonLeft, 0};
    const double begun = rig.wire.now(), each = 0.1;
    std::vector<std::string> names;
    watchButtons(
        rig.link, rig.wire, [&](std::uint8_t button) { names.emplace_back(nameOf(button)); },
        [&] {
            rig.watch();
            const auto at = static_cast<std::size_t>((rig.wire.now() - begun) / each);
            rig.device.hand.buttons = at < pattern.size() ? pattern[at] : 0;
            return at >= pattern.size();
        });
    EXPECT_EQ(names, (std::vector<std::string>{"forward", "right", "centre", "left"}));
    EXPECT_EQ(rig.largest, 0);
}

TEST(FalconButtons, AFalconThatIsGoneIsNotWatchedForEver)
{
    Rig rig({syntheticFirmware(), 0.98, false});
    rig.link.connect(rig.stop);
    rig.device.mishaps.stalled = true;
    const double begun = rig.wire.now(), enough = 60;
    watchButtons(
        rig.link, rig.wire, [](std::uint8_t) {}, [&] { return rig.wire.now() > begun + enough; });
    EXPECT_TRUE(rig.link.lost());
    EXPECT_LT(rig.wire.now(), begun + enough);
}

// One packet in a hundred that lies, and contacts that bounce for 15 ms, are one press.
TEST(FalconButtons, ASteadyButtonIsPressedOnce)
{
    SteadyButton button;
    int presses = 0;
    bool before = false;
    for (int tick = 0; tick < 1000; ++tick) {
        const bool bounces = tick >= 400 && tick < 415;
        const bool down = tick % 100 == 50 ? tick < 400 : bounces ? tick % 4 < 2 : tick >= 415 && tick < 800;
        const bool now = button.take(down);
        presses += now && !before ? 1 : 0;
        before = now;
    }
    EXPECT_EQ(presses, 1);
    EXPECT_FALSE(before);
}

}  // namespace
}  // namespace palpate::falcon
