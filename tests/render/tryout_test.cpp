#include <render/tryout.h>

#include <gtest/gtest.h>

namespace palpate::render {
namespace {

channel::State tipAt(double x, double y)
{
    channel::State s;
    s.tip = {x, y, 0};
    s.axis = {0, 1, 0};
    return s;
}

// Each step is left only by doing it.
TEST(Tryout, EveryStepWaitsUntilItIsDone)
{
    channel::Scenery scenery;
    scenery.viewersHand = channel::handIsViewers;
    Tryout tryout(30);
    channel::State s = tipAt(0, -30e-3);
    EXPECT_EQ(tryout.see(scenery, s, false).step, 1);
    EXPECT_EQ(tryout.see(scenery, tipAt(20e-3, -30e-3), false).step, 1) << "nobody holds it";
    EXPECT_EQ(tryout.see(scenery, s, true).step, 2);
    EXPECT_EQ(tryout.see(scenery, tipAt(0, -15e-3), true).step, 2) << "along itself is not in the plane";
    EXPECT_EQ(tryout.see(scenery, tipAt(6e-3, -30e-3), true).step, 3);
    EXPECT_EQ(tryout.see(scenery, tipAt(6e-3, -40e-3), true).step, 3) << "back is not on";
    EXPECT_EQ(tryout.see(scenery, tipAt(6e-3, -20e-3), true).step, 4);
    s = tipAt(6e-3, 0);
    EXPECT_EQ(tryout.see(scenery, s, true).step, 4);
    s.phase = channel::Phase::contact;
    EXPECT_EQ(tryout.see(scenery, s, true).step, 5);
    EXPECT_EQ(tryout.see(scenery, s, true).step, 5);
    EXPECT_EQ(tryout.see(scenery, s, false).step, 6);
    s.time = 17.5;
    const Coaching last = tryout.see(scenery, s, true);
    EXPECT_EQ(last.step, 6);
    EXPECT_EQ(last.steps, 6);
    EXPECT_NE(last.now.find("13 s left"), std::string::npos) << last.now;
}

TEST(Tryout, AHapticDeviceIsToldOfItsOwnButtons)
{
    channel::Scenery scenery;
    scenery.viewersHand = channel::handIsDevices;
    Tryout tryout(30);
    EXPECT_NE(tryout.see(scenery, tipAt(0, 0), false).now.find("centre button"), std::string::npos);
    EXPECT_EQ(tryout.see(scenery, tipAt(6e-3, 0), false).step, 2);
}

}  // namespace
}  // namespace palpate::render
