#include "bodies.h"

#include <tests/folder.h>
#include <volume/tissue.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
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
    const CompanionImage companion = ramp(image, {{{0, 0.5}, {190, 1.5}}, {"fat"}, {}});
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

// An image whose factor is 1 makes every voxel be read for itself; without one, cells that a single label fills are not
// read: the same materials, in volumes turned and not, held behind a plane and by bone, whatever the grid.
TEST(Companion, AFactorOfOneIsNone)
{
    std::mt19937 random(11);
    std::uniform_real_distribution<double> anywhere(-20e-3, 20e-3);
    for (std::size_t trial = 0; trial < 8; ++trial) {
        std::array<Vec3, 6> lumps;
        std::generate(lumps.begin(), lumps.end(),
                      [&] { return Vec3(anywhere(random), anywhere(random), anywhere(random)); });
        const Vec3 voxel(trial % 3 == 0 ? Vec3(1e-3) : Vec3(0.8e-3, 1.1e-3, 2.3e-3));
        const Affine affine = trial % 2 == 0 ? Affine{glm::dmat3(voxel.x, 0, 0, 0, -voxel.y, 0, 0, 0, voxel.z), Vec3(0.0)}
                                             : oblique(voxel, Vec3(0.0), trial % 4 == 1);
        // A ball, or a column so long that what its back holds is deeper than a block of voxels.
        const bool isColumn = trial >= 4;
        const double across = trial % 2 == 0 ? 24e-3 : 70e-3;  // of a volume that is turned the column takes more
        const Index3 size((isColumn ? Vec3(across, 140e-3, across) : Vec3(46e-3)) / voxel);
        const auto isBody = [&](Vec3 p) {
            return isColumn ? std::max(std::abs(p.x), std::abs(p.z)) < 10e-3 && std::abs(p.y) < 60e-3
                            : glm::length(p) < 21e-3;
        };
        const int hard = trial % 4 < 2 ? 300 : 7;
        const LabelImage image = voxelise(size, centred(affine, size), [&](Vec3 p) {
            const auto near = [&](Vec3 lump) { return glm::length(p - lump) < 6e-3; };
            return std::any_of(lumps.begin(), lumps.end(), near) ? hard : isBody(p) ? 1 : 0;
        });
        const CompanionImage same = ramp(image, {{{0, 1.0}}, {}, {}});
        const Tissue plain = Tissue::fromLabels(image, table(), names(), {});
        const Tissue scaled = Tissue::fromLabels(image, table(), names(), {}, &same);
        const double spacing = std::array{1.6e-3, 2e-3, 4.1e-3}[trial % 3];
        const NodeGrid grid = coveringGrid(plain.box(), spacing, 2 * spacing);
        const auto materials = plain.materialOn(grid), read = scaled.materialOn(grid);
        const ScalarField modulus = plain.youngsModulusOn(grid), modulusRead = scaled.youngsModulusOn(grid);
        for (std::size_t i = 0; i < grid.count(); ++i) {
            ASSERT_NEAR(materials[i].youngsModulus, read[i].youngsModulus, 1e-5F * read[i].youngsModulus);
            ASSERT_NEAR(materials[i].fixed, read[i].fixed, 1e-6F);
            ASSERT_NEAR(materials[i].along, read[i].along, 1e-4F);
            ASSERT_NEAR(materials[i].share, read[i].share, 1e-4F);
            ASSERT_NEAR(modulus.values[i], modulusRead.values[i], 1e-5F * modulusRead.values[i]);
        }
    }
}

// A factor of 2 for one tissue doubles what is made of it alone, and leaves the other as it was.
TEST(Companion, ScalesTheStiffnessOfTheTissuesItIsMeantFor)
{
    const LabelImage image = block();
    const CompanionImage twice = ramp(image, {{{0, 2.0}}, {"fat"}, {}});
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
