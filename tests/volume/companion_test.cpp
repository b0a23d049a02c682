#include "bodies.h"

#include <tests/folder.h>
#include <volume/tissue.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace palpate::volume {
namespace {

using namespace bodies;
using tests::Folder;

LabelImage block()
{
    return voxelise({20, 18, 16}, centred(oblique(Vec3(2e-3), Vec3(0.0), true), {20, 18, 16}), [](Vec3 p) {
        return glm::length(p) < 8e-3 ? 7 : glm::length(p) < 14e-3 ? 1 : 0;
    });
}

CompanionImage ramp(const LabelImage& image, StiffnessMap map)
{
    CompanionImage companion{{}, "HU", std::move(map)};
    forEachIndex(Index3(0), image.size - 1, [&](Index3 n) { companion.values.push_back(static_cast<float>(10 * n.x)); });
    return companion;
}

// The image comes back to the bit, outside the labels too.
TEST(Companion, IsKeptInTheFile)
{
    const Folder folder;
    const LabelImage image = block();
    const CompanionImage companion = ramp(image, {{{0, 0.5}, {190, 1.5}}, {"fat"}});
    Tissue::fromLabels(image, table(), names(), {}, &companion).save(folder / "a.vdb");
    const Tissue loaded = Tissue::load(folder / "a.vdb");
    EXPECT_EQ(loaded.labels().values, image.values);
    ASSERT_TRUE(loaded.hasImage());
    const auto back = loaded.companion();
    EXPECT_EQ(back->unit, "HU");
    EXPECT_EQ(back->stiffness.points, companion.stiffness.points);
    EXPECT_EQ(back->stiffness.tissues, companion.stiffness.tissues);
    for (std::size_t i = 0; i < image.values.size(); ++i) {
        ASSERT_EQ(back->values[i], companion.values[i]);
    }
    EXPECT_FALSE(Tissue::fromLabels(image, table(), names(), {}).hasImage());
}

// A factor of 2 for one tissue doubles what is made of it alone, and leaves the other as it was.
TEST(Companion, ScalesTheStiffnessOfTheTissuesItIsMeantFor)
{
    const LabelImage image = block();
    const CompanionImage twice = ramp(image, {{{0, 2.0}}, {"fat"}});
    const Tissue plain = Tissue::fromLabels(image, table(), names(), {});
    const Tissue scaled = Tissue::fromLabels(image, table(), names(), {}, &twice);
    const NodeGrid grid = coveringGrid(plain.box(), 2e-3, 0);
    const auto materials = plain.materialOn(grid), stiffer = scaled.materialOn(grid);
    const ScalarField before = plain.youngsModulusOn(grid), after = scaled.youngsModulusOn(grid);
    std::size_t fat = 0, lump = 0;
    for (std::size_t i = 0; i < grid.count(); ++i) {
        const double r = glm::length(grid.position(grid.node(i)));
        if (r < 4e-3) {
            EXPECT_EQ(stiffer[i].youngsModulus, materials[i].youngsModulus);
            ++lump;
        } else if (r > 11.6e-3 && r < 12e-3) {
            EXPECT_NEAR(stiffer[i].youngsModulus / materials[i].youngsModulus, 2.0, 1e-5);
            EXPECT_NEAR(after.values[i] / before.values[i], 2.0, 1e-5);
            ++fat;
        }
    }
    EXPECT_GT(fat, 5U);
    EXPECT_GT(lump, 5U);
    const Tissue::Reader reader(scaled);
    EXPECT_NEAR(reader.youngsModulus(Vec3(0, 0, 11e-3)), 2 * 3.25e3, 1e-3);
    EXPECT_NEAR(reader.youngsModulus(Vec3(0.0)), 43.7e3, 1e-3);
}

// A cell that is all tissue has the ramp's value at its middle, however the voxels lie to the grid: to rounding where it
// interpolates between voxels, else to half a voxel (steps of 10). Where no tissue is near there is no value.
TEST(Companion, IsTheMeanOverTheTissueInACell)
{
    const LabelImage image = block();
    const CompanionImage companion = ramp(image, {});
    const Tissue tissue = Tissue::fromLabels(image, table(), names(), {}, &companion);
    for (const double spacing : {1e-3, 2e-3, 3.9e-3, 4.5e-3}) {
        const NodeGrid grid = coveringGrid(tissue.box(), spacing, 4 * spacing);
        const std::vector<float> values = tissue.imageOn(grid);
        ASSERT_EQ(values.size(), grid.count());
        const bool exact = spacing < 4e-3;
        std::size_t within = 0, beyond = 0;
        for (std::size_t i = 0; i < grid.count(); ++i) {
            const Vec3 p = grid.position(grid.node(i));
            const double reach = spacing + 3.5e-3;  // of a cell's samples and the voxels around them
            if (glm::length(p) < 14e-3 - reach) {
                EXPECT_NEAR(static_cast<double>(values[i]), 10 * image.affine.toIndex(p).x, exact ? 1e-3 : 5.0);
                ++within;
            } else if (glm::length(p) > 14e-3 + reach) {
                EXPECT_TRUE(std::isnan(values[i]));
                ++beyond;
            }
        }
        EXPECT_GT(within, 5U);
        EXPECT_GT(beyond, 5U);
    }
}

TEST(Companion, IsNowhereWithoutOne)
{
    const Tissue tissue = Tissue::fromLabels(block(), table(), names(), {});
    for (const float value : tissue.imageOn(coveringGrid(tissue.box(), 4e-3, 0))) {
        ASSERT_TRUE(std::isnan(value));
    }
}

TEST(Companion, OfAnotherSizeIsRefused)
{
    const LabelImage image = block();
    CompanionImage companion = ramp(image, {});
    companion.values.pop_back();
    EXPECT_THROW(Tissue::fromLabels(image, table(), names(), {}, &companion), std::runtime_error);
}

}  // namespace
}  // namespace palpate::volume
