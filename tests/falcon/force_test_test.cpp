#include <haptics/falcon/force_test.h>
#include <tests/falcon/rig.h>

#include <gtest/gtest.h>

#include <cmath>

namespace palpate::falcon {
namespace {

// A Falcon that is homed, and somebody who presses the button when told to.
struct Tested {
    explicit Tested(std::uint8_t buttons)
    {
        rig.device.makeReady();
        rig.link.connect(rig.stop);
        rig.device.hand.buttons = buttons;
    }
    ForceTest run()
    {
        return testForce(
            rig.link, rig.wire, [this](const std::string& what) { said = what; }, rig.stop, guardian);
    }
    Guardian guardian;
    Rig rig;
    std::string said;
};

// One newton towards the user, by the motors' torques, and nothing is left of it.
TEST(FalconForceTest, PushesWithOneNewtonAndLetsGo)
{
    Tested tested(buttonCentre);
    const ForceTest test = tested.run();
    EXPECT_TRUE(test.held && test.complete);
    EXPECT_NEAR(test.peak, 1.0, 0.05);
    EXPECT_GT(test.moved, 0.5e-3);
    EXPECT_NE(tested.said.find("centre button"), std::string::npos);
    EXPECT_NE(inWords(test).find("pushed towards you with 1 N"), std::string::npos);
    EXPECT_EQ(largestOf(tested.rig.device.command().motor), 0);
}

TEST(FalconForceTest, GivesNoForceToAHandThatDoesNotHoldTheButton)
{
    Tested tested(0);
    const ForceTest test = tested.run();
    EXPECT_FALSE(test.held);
    EXPECT_EQ(test.peak, 0.0);
    EXPECT_NE(inWords(test).find("not pressed"), std::string::npos);
    EXPECT_EQ(largestOf(tested.rig.device.command().motor), 0);
}

TEST(FalconForceTest, AFalconThatStopsAnsweringIsNotTested)
{
    Tested tested(buttonCentre);
    tested.rig.device.mishaps.stalled = true;
    // The button was seen while it still answered.
    const ForceTest test = tested.run();
    EXPECT_FALSE(test.complete);
    EXPECT_EQ(inWords(test).find("pushed towards you"), std::string::npos);
}

}  // namespace
}  // namespace palpate::falcon
