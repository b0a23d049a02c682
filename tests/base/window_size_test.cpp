#include <base/window_size.h>

#include <gtest/gtest.h>

namespace palpate::base {
namespace {

// The trainer's buttons are at its lower edge: on a screen of 1024 x 600 a window of 1280 x 720 would have them outside.
TEST(WindowSize, FitsTheScreenAndIsNoLargerThanWanted)
{
    const auto on = [](int width, int height) { return fittedTo({width, height}, {1280, 720}); };
    EXPECT_EQ(on(1024, 600).width, 1024);
    EXPECT_EQ(on(1024, 600).height, 600);
    EXPECT_EQ(on(1920, 700).width, 1280);
    EXPECT_EQ(on(1920, 700).height, 700);
    EXPECT_EQ(on(0, 0).width, 1280);
    EXPECT_EQ(on(0, 0).height, 720);
}

}  // namespace
}  // namespace palpate::base
