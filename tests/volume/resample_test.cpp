#include "bodies.h"

#include <volume/resample.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>
#include <vector>

namespace palpate::volume {
namespace {

using namespace bodies;

VoxelGrid gridOf(const LabelImage& image)
{
    return {image.size, image.affine};
}

std::uint64_t countOf(const LabelImage& image, std::uint16_t value)
{
    return static_cast<std::uint64_t>(std::count(image.values.begin(), image.values.end(), value));
}

LabelImage noise(Index3 size, const Affine& affine, unsigned seed)
{
    std::mt19937 random(seed);
    return voxelise(size, affine, [&](Vec3) { return random() % 5; });
}

TEST(Resample, TheSameGridGivesTheSameLabels)
{
    const LabelImage image = noise({17, 13, 11}, oblique(Vec3(1e-3), {0.02, 0.1, -0.3}, true), 3);
    EXPECT_EQ(resampled(image, gridOf(image)).image.values, image.values);
    const VoxelGrid same = isotropicGrid(gridOf(image), 1e-3);
    EXPECT_EQ(same.size, image.size);
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3 at = Vec3(image.size) * Vec3(corner & 1, (corner >> 1) & 1, (corner >> 2) & 1);
        EXPECT_LT(glm::length(same.affine.toPatient(at) - image.affine.toPatient(at)), 1e-12);
    }
}

// What a label is called decides nothing: relabelling and resampling commute.
TEST(Resample, DoesNotDependOnTheValuesOfTheLabels)
{
    const LabelImage image = noise({23, 19, 15}, oblique({0.7e-3, 1.3e-3, 2.9e-3}, Vec3(0.0), false), 11);
    std::vector<std::uint16_t> renamed{0, 900, 30, 65535, 4};
    const auto rename = [&](LabelImage m) {
        for (auto& v : m.values) {
            v = renamed[v];
        }
        return m;
    };
    for (const double spacing : {0.9e-3, 2.3e-3}) {
        const VoxelGrid grid = isotropicGrid(gridOf(image), spacing);
        EXPECT_EQ(rename(resampled(image, grid).image).values, resampled(rename(image), grid).image.values);
    }
}

// A ball between slices 5 mm apart keeps its volume and its middle on a grid of 1 mm.
TEST(Resample, ABallKeepsItsVolumeAndItsMiddle)
{
    const double radius = 20e-3;
    const Vec3 middle(3e-3, -2e-3, 1e-3);
    const Index3 size(70, 70, 14);
    const Affine affine = centred(oblique({0.8e-3, 0.8e-3, 5e-3}, Vec3(0.0), true), size);
    const LabelImage image = voxelise(size, affine, [&](Vec3 p) { return glm::length(p - middle) < radius ? 3 : 0; });
    const VoxelGrid grid = isotropicGrid(gridOf(image), 1e-3);
    const ResampledLabels fine = resampled(image, grid);
    const double volume = static_cast<double>(countOf(fine.image, 3)) * 1e-9;
    const double exact = 4.0 / 3.0 * std::numbers::pi * radius * radius * radius;
    EXPECT_NEAR(volume / exact, 1.0, 0.02);
    Vec3 sum(0.0);
    forEachIndex(Index3(0), grid.size - 1, [&](Index3 n) {
        if (fine.image.values[fine.image.offset(n)] == 3) {
            sum += grid.affine.toPatient(Vec3(n));
        }
    });
    EXPECT_LT(glm::length(sum / static_cast<double>(countOf(fine.image, 3)) - middle), 0.3e-3);
    ASSERT_EQ(fine.changes.size(), 1U);
    EXPECT_DOUBLE_EQ(fine.changes[0].after, volume);
    EXPECT_EQ(fine.changes[0].regained, 0U);
}

// A tube of a ninth of the new voxel's cross-section is the winner nowhere, and still keeps its volume. So do a sheet of a
// quarter of a voxel and a single voxel of which 64 make a new one: that one becomes a whole one.
TEST(Resample, ThinStructuresKeepTheirVolume)
{
    const Index3 size(64);
    LabelImage image = voxelise(size, {Mat3(0.5e-3), Vec3(0.0)}, [](Vec3) { return 1; });
    for (int k = 0; k < 64; ++k) {
        image.values[image.offset({9, 9, k})] = 2;
        for (int j = 0; j < 64; ++j) {
            image.values[image.offset({40, j, k})] = 3;
        }
    }
    image.values[image.offset({22, 33, 44})] = 4;
    const VoxelGrid grid = isotropicGrid(gridOf(image), 2e-3);
    ASSERT_EQ(grid.size, Index3(16));
    const ResampledLabels coarse = resampled(image, grid);
    for (const StructureChange& change : coarse.changes) {
        EXPECT_DOUBLE_EQ(change.after, static_cast<double>(countOf(coarse.image, change.value)) * 8e-9);
        if (change.value == 2 || change.value == 3) {
            EXPECT_NEAR(change.after / change.before, 1.0, 0.001) << change.value;
            EXPECT_EQ(change.regained, countOf(coarse.image, change.value));
        }
    }
    EXPECT_EQ(countOf(coarse.image, 4), 1U);
    EXPECT_EQ(coarse.image.values[coarse.image.offset({22 / 4, 33 / 4, 44 / 4})], 4);
    // The tube's voxels are those that it runs through.
    forEachIndex(Index3(0), grid.size - 1, [&](Index3 n) {
        if (coarse.image.values[coarse.image.offset(n)] == 2) {
            EXPECT_EQ(Index3(n.x, n.y, 0), Index3(2, 2, 0));
        }
    });
}

// The part of a voxel of `edge` at `index` that lies between `low` and `high`, along one axis [old voxels].
double overlap(int index, double edge, double low, double high)
{
    return std::max(0.0, std::min(high, (index + 1) * edge) - std::max(low, index * edge)) / edge;
}

// A sheet of one voxel in new voxels of any size fills what they overlap of it: along its normal at most half of each, so
// that the rule for thin structures gives it exactly its volume.
TEST(Resample, ASheetKeepsItsVolumeAtAnyRatio)
{
    for (const double ratio : {2.1, 2.3, 2.5, 3.1, 4.1, 10.0, 12.0}) {
        for (int at = 30; at < 33; ++at) {
            LabelImage image = voxelise(Index3(60), {Mat3(1e-3), Vec3(0.0)}, [](Vec3) { return 1; });
            forEachIndex({at, 5, 5}, {at, 54, 54}, [&](Index3 n) { image.values[image.offset(n)] = 2; });
            const VoxelGrid grid = isotropicGrid(gridOf(image), 1e-3 * ratio);
            const ResampledLabels coarse = resampled(image, grid);
            const StructureChange& sheet = coarse.changes.at(1);
            EXPECT_NEAR(sheet.after / grid.affine.voxelVolume(), 2500.0 / (ratio * ratio * ratio), 0.5001)
                << ratio << " " << at;
        }
    }
}

// Two sheets that share new voxels: which one wins is what the overlap of boxes says, here in closed form.
TEST(Resample, SharesAreTheOverlapOfBoxes)
{
    constexpr double ratio = 2.5;
    LabelImage image =
        voxelise(Index3(40), {Mat3(1e-3), Vec3(0.0)}, [](Vec3 p) { return std::lround(1e3 * p.x) % 3 == 0 ? 1 : 2; });
    const VoxelGrid grid = isotropicGrid(gridOf(image), 1e-3 * ratio);
    ASSERT_EQ(grid.size, Index3(16));
    const LabelImage coarse = resampled(image, grid).image;
    for (int i = 0; i < grid.size.x; ++i) {
        double first = 0;
        for (int old = 0; old < image.size.x; old += 3) {
            first += overlap(i, ratio, old, old + 1);
        }
        ASSERT_GT(std::abs(first - 0.5), 0.01) << "no tie";
        EXPECT_EQ(coarse.values[coarse.offset({i, 7, 9})], first > 0.5 ? 1 : 2) << i;
    }
}

// Whatever lies beside it, a structure has a voxel in the end: a cube of three quarters of a new voxel beside a plate that
// fills the rest of that voxel and of no other, and cubes of two old voxels in new ones of ten.
TEST(Resample, NoStructureVanishes)
{
    LabelImage image = voxelise(Index3(80), {Mat3(1e-3), Vec3(0.0)}, [](Vec3) { return 1; });
    forEachIndex({40, 40, 40}, {42, 43, 43}, [&](Index3 n) { image.values[image.offset(n)] = 2; });
    forEachIndex({43, 40, 40}, {43, 43, 43}, [&](Index3 n) { image.values[image.offset(n)] = 3; });
    const ResampledLabels pair = resampled(image, isotropicGrid(gridOf(image), 4e-3));
    EXPECT_EQ(pair.image.values[pair.image.offset(Index3(10))], 2);
    EXPECT_EQ(countOf(pair.image, 2), 1U);
    EXPECT_EQ(countOf(pair.image, 3), 1U);
    EXPECT_TRUE(pair.changes.at(2).beside);
    EXPECT_FALSE(pair.changes.at(1).beside);

    std::mt19937 random(7);
    LabelImage many = voxelise(Index3(90), {Mat3(0.5e-3), Vec3(0.0)}, [](Vec3) { return 1; });
    for (std::uint16_t label = 2; label < 202; ++label) {
        const Index3 at(random() % 88, random() % 88, random() % 88);
        forEachIndex(at, at + 1, [&](Index3 n) { many.values[many.offset(n)] = label; });
    }
    for (const double spacing : {2e-3, 5e-3}) {
        const ResampledLabels coarse = resampled(many, isotropicGrid(gridOf(many), spacing));
        for (const StructureChange& change : coarse.changes) {
            EXPECT_GT(change.after, 0.0) << change.value << " " << spacing;
        }
    }
}

// A structure that is not thin keeps nine tenths of its volume beside thin ones: here 45 needles of a tenth of a new voxel,
// that only lie in it.
TEST(Resample, ThinStructuresDoNotEatAnother)
{
    LabelImage image = voxelise(Index3(60), {Mat3(1e-3), Vec3(0.0)}, [](Vec3) { return 1; });
    forEachIndex(Index3(15), Index3(44), [&](Index3 n) { image.values[image.offset(n)] = 2; });
    for (int k = 0; k < 36; ++k) {
        const Index3 at(17 + 5 * (k % 6), 17 + 5 * (k / 6), 15);
        forEachIndex(at, at + Index3(1, 1, 29),
                     [&](Index3 n) { image.values[image.offset(n)] = static_cast<std::uint16_t>(10 + k); });
    }
    const ResampledLabels coarse = resampled(image, isotropicGrid(gridOf(image), 5e-3));
    const StructureChange& block = coarse.changes.at(1);
    EXPECT_GE(block.after / block.before, 0.9);
    for (const StructureChange& change : coarse.changes) {
        EXPECT_GT(change.after, 0.0) << change.value;
    }
}

// The grid ends up to half a new voxel beyond the image: a body that the image cuts goes on there.
TEST(Resample, ACutHasNoAirAtItsEdges)
{
    const LabelImage image = voxelise(Index3(30), {Mat3(1e-3), Vec3(0.0)}, [](Vec3) { return 5; });
    for (const double spacing : {0.7e-3, 1.55e-3, 2.1e-3, 7e-3}) {
        const LabelImage out = resampled(image, isotropicGrid(gridOf(image), spacing)).image;
        EXPECT_EQ(countOf(out, 5), out.values.size()) << spacing;
    }
}

// Steps that lean by 20 degrees, as from a tilted gantry: a block keeps its place in the patient.
TEST(Resample, AShearedGridIsStraightened)
{
    Affine sheared{Mat3(1e-3), Vec3(0.0)};
    sheared.linear[2] = 2e-3 * Vec3(0, std::sin(0.35), std::cos(0.35));
    const Index3 size(50, 50, 30);
    sheared = centred(sheared, size);
    const auto inBlock = [](Vec3 p) { return std::abs(p.x) < 10e-3 && std::abs(p.y) < 8e-3 && std::abs(p.z) < 12e-3; };
    const LabelImage image = voxelise(size, sheared, inBlock);
    const VoxelGrid grid = isotropicGrid(gridOf(image), 1e-3);
    const Mat3& m = grid.affine.linear;
    EXPECT_NEAR(glm::dot(m[0], m[1]) + glm::dot(m[1], m[2]) + glm::dot(m[0], m[2]), 0, 1e-18);
    const ResampledLabels result = resampled(image, grid);
    const LabelImage& straight = result.image;
    std::uint64_t wrong = 0;
    forEachIndex(Index3(0), grid.size - 1, [&](Index3 n) {
        const Vec3 p = grid.affine.toPatient(Vec3(n));
        const bool surface = inBlock(p * 0.85) != inBlock(p * 1.15);
        wrong += !surface && (straight.values[straight.offset(n)] == 1) != inBlock(p) ? 1 : 0;
    });
    EXPECT_EQ(wrong, 0U);
    ASSERT_EQ(result.changes.size(), 1U);
    EXPECT_NEAR(result.changes[0].after / result.changes[0].before, 1.0, 0.03);
}

// Trilinear interpolation is exact for a linear function of place.
TEST(ResampleImage, ALinearImageStaysExact)
{
    const VoxelGrid of{{12, 10, 8}, centred(oblique({1e-3, 2e-3, 3e-3}, Vec3(0.0), true), {12, 10, 8})};
    const auto value = [](Vec3 p) { return 100.0 + 3e3 * p.x - 2e3 * p.y + 1e3 * p.z; };
    std::vector<float> values;
    forEachIndex(Index3(0), of.size - 1,
                 [&](Index3 n) { values.push_back(static_cast<float>(value(of.affine.toPatient(Vec3(n))))); });
    const VoxelGrid grid{{20, 20, 20}, centred({Mat3(0.6e-3), Vec3(0.0)}, Index3(20))};
    const std::vector<float> out = resampledImage(of, values, grid, -1000.0F);
    std::size_t at = 0, inside = 0, outside = 0;
    forEachIndex(Index3(0), grid.size - 1, [&](Index3 n) {
        const Vec3 p = grid.affine.toPatient(Vec3(n));
        const Vec3 index = of.affine.toIndex(p);
        const float got = out[at++];
        if (glm::all(glm::greaterThan(index, Vec3(0.0))) && glm::all(glm::lessThan(index, Vec3(of.size - 1)))) {
            EXPECT_NEAR(got, value(p), 1e-3);
            ++inside;
        } else if (glm::any(glm::lessThan(index, Vec3(-0.51))) || glm::any(glm::greaterThan(index, Vec3(of.size) - 0.49))) {
            EXPECT_EQ(got, -1000.0F);
            ++outside;
        }
    });
    EXPECT_GT(inside, 1000U);
    EXPECT_GT(outside, 300U);
}

TEST(Resample, RefusesValuesThatDoNotFitTheGrid)
{
    LabelImage image;
    image.size = {10, 10, 10};
    image.affine.linear = Mat3(1e-3);
    image.values.assign(5, 1);
    const VoxelGrid grid{image.size, image.affine};
    EXPECT_THROW(resampled(image, grid), std::runtime_error);
    EXPECT_THROW(resampledImage(grid, std::vector<float>(5), grid, 0), std::runtime_error);
}

}  // namespace
}  // namespace palpate::volume
