#include "models.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace palpate::haptics {
namespace {

// docs/scenes.md: a scene needs a structure or an aim. With an aim alone the distance to the target is that to the
// structure around it.
TEST(SessionModel, AnAimAloneSamplesTheStructureThatItLiesIn)
{
    const auto aimed = tests::modelOf(tests::sphereOnBlock("aim_mm = [0, 25, 0]\n"));
    const auto named = tests::modelOf(tests::blockScene);
    EXPECT_EQ(aimed.scene.target, "tumour");
    EXPECT_EQ(aimed.structures.front().labels, named.structures.front().labels);
    for (const Vec3 p : {Vec3(0, 25e-3, 0), Vec3(0, 5e-3, 0), Vec3(-14e-3, 20e-3, 6e-3)}) {
        EXPECT_EQ(aimed.structures.front().distance.distance(p), named.structures.front().distance.distance(p));
    }
    EXPECT_EQ(tests::modelOf(tests::sphereOnBlock("aim_mm = [20, 10, 5]\n")).scene.target, "fat");
}

TEST(SessionModel, AnAimInTheAirIsRefused)
{
    try {
        tests::modelOf(tests::sphereOnBlock("aim_mm = [0, -5, 0]\n"));
        FAIL() << "no error";
    } catch (const std::runtime_error& error) {
        EXPECT_STREQ(error.what(), "block: [target] aim_mm = [0, -5, 0] lies outside the body");
    }
}

}  // namespace
}  // namespace palpate::haptics
