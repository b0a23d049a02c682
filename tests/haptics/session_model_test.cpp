#include "models.h"

#include <datasets/tables.h>

#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>
#include <vector>

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

TEST(SessionModel, OfNoVolumeIsRefused)
{
    EXPECT_THROW(buildModel(*datasets::builtInScene("block"), nullptr), std::runtime_error);
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

// A face of voxels lies where it lies: voxels that are no divisor of the fields' spacing, wherever the volume begins.
TEST(SessionModel, TheSurfaceIsTheSameWhereverTheVolumeBegins)
{
    for (const double edge : {0.6e-3, 1e-3}) {
        for (const double begins : {0.0, 0.13e-3, 0.2e-3, -0.41e-3}) {
            volume::LabelImage image;
            image.size = {60, 50, 60};
            image.affine = {Mat3(edge), Vec3(0, begins, 0)};
            image.values.assign(180'000, 0);
            volume::forEachIndex({2, 2, 2}, {57, 47, 57},
                                 [&](Index3 n) { image.values[image.offset(n)] = n.y > 43 ? 2 : 1; });
            const std::vector<volume::LabelName> names{{1, "fat", "fat"}, {2, "floor", "bone"}};
            auto tissue = std::make_shared<const volume::Tissue>(
                volume::Tissue::fromLabels(image, datasets::defaultTissues(), names, {}));
            auto scene = datasets::parseScene(tests::sphereOnBlock("structure = \"fat\"\n"), "test.toml");
            const Vec3 top(29.5 * edge, 1.5 * edge + begins, 29.5 * edge);
            scene.entry = top;
            scene.aim = top + Vec3(0, 5e-3, 0);
            const SessionModel model = buildModel(std::move(scene), std::move(tissue));
            for (const Vec3 aside : {Vec3(0), Vec3(7.3e-3, 0, 0), Vec3(-4.1e-3, 0, 6.7e-3)}) {
                EXPECT_NEAR(model.surface.distance(top + aside), 0, 0.02e-3) << edge << " " << begins;
            }
        }
    }
}

}  // namespace
}  // namespace palpate::haptics
