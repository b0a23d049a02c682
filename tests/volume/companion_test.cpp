#include "bodies.h"

#include <tests/folder.h>
#include <volume/tissue.h>

#include <gtest/gtest.h>

#include <algorithm>

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

// Where there is tissue the image comes back to the bit, elsewhere it is air.
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
        ASSERT_EQ(back->values[i], image.values[i] != 0 ? companion.values[i] : -1000.0F);
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

TEST(Companion, OfAnotherSizeIsRefused)
{
    const LabelImage image = block();
    CompanionImage companion = ramp(image, {});
    companion.values.pop_back();
    EXPECT_THROW(Tissue::fromLabels(image, table(), names(), {}, &companion), std::runtime_error);
}

}  // namespace
}  // namespace palpate::volume
