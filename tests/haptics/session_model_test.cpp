#include "models.h"

#include <datasets/tables.h>
#include <haptics/simulation.h>
#include <tests/error_of.h>

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
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

// What a program sets is held to what a scene's text may say; each of these never ended, or ended the process.
TEST(SessionModel, ASceneThatNoTextMayHaveIsRefused)
{
    using Scene = datasets::Scene;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const std::vector<std::pair<const char*, std::function<void(Scene&)>>> all{
        {"[model.elastic] spacing_mm = 0 mm: must be 0.2 to 20 mm", [](Scene& s) { s.model.elastic.spacing = 0; }},
        {"[model.elastic] spacing_mm = nan mm", [=](Scene& s) { s.model.elastic.spacing = nan; }},
        {"[model] spacing_mm = 0 mm", [](Scene& s) { s.model.spacing = 0; }},
        {"[model.elastic] window = 0: must be 9 to 41", [](Scene& s) { s.model.elastic.window = 0; }},
        {"[model.elastic] window = 10: must be odd", [](Scene& s) { s.model.elastic.window = 10; }},
        {"[model.elastic] cycles = 0: must be 1 to 100", [](Scene& s) { s.model.elastic.cycles = 0; }},
        {"[target] entry_mm = [nan, 0, 0]", [=](Scene& s) { s.entry = Vec3(nan, 0, 0); }},
        {"[tool] radius_mm = 0 mm: must be over 0 mm", [](Scene& s) { s.tool.radius = 0; }},
        {"[tool] radius_mm = nan mm", [=](Scene& s) { s.tool.radius = nan; }}};
    const Scene good = datasets::parseScene(tests::sphereOnBlock("structure = \"fat\"\n"), "test.toml");
    const auto tissue = std::make_shared<const volume::Tissue>(datasets::sceneVolume(good));
    SessionModel model = buildModel(good, tissue);
    for (const auto& [words, change] : all) {
        Scene bad = good;
        change(bad);
        const std::string why = tests::errorOf([&] { buildModel(bad, tissue); });
        EXPECT_TRUE(why.starts_with("block: " + std::string(words))) << why;
        model.scene = bad;
        EXPECT_THROW(Simulation{model}, std::runtime_error) << words;
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
