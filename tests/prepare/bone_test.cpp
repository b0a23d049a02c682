#include <volume/label_image.h>
#include <volume/prepare/bone.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <cmath>
#include <functional>
#include <random>
#include <vector>

namespace palpate::prepare {
namespace {

using volume::LabelImage;
using volume::VoxelGrid;

constexpr double spacing = 1e-3;
const VoxelGrid cube{Index3(41), {Mat3(spacing), Vec3(0.0)}};
const Index3 middle(20);

std::size_t at(const VoxelGrid& grid, Index3 n)
{
    return LabelImage{grid.size, grid.affine, {}}.offset(n);
}

template <typename T>
std::vector<T> filled(const VoxelGrid& grid, const std::function<T(Vec3)>& value)  // at the place from the middle [voxels]
{
    std::vector<T> out(at(grid, {0, 0, grid.size.z}));
    volume::forEachIndex(Index3(0), grid.size - 1,
                         [&](Index3 n) { out[at(grid, n)] = value(Vec3(n) - Vec3(grid.size - 1) / 2.0); });
    return out;
}

double across(Vec3 p)
{
    return std::hypot(p.x, p.y);
}

// A shell 3 voxels thick is met by every ray from inside, and by none from further than the reach.
TEST(Enclosure, IsWholeInsideAShellAndNothingFarFromIt)
{
    const auto shell = filled<std::uint8_t>(
        cube, [](Vec3 p) { return glm::length(p) > 7 && glm::length(p) <= 10 ? std::uint8_t{1} : std::uint8_t{0}; });
    const auto fraction = enclosure(cube, shell, 18e-3);
    const auto none = enclosure(cube, shell, 5e-3);
    volume::forEachIndex(Index3(0), cube.size - 1, [&](Index3 n) {
        const double r = glm::length(Vec3(n - middle));
        if (r <= 7) {
            EXPECT_EQ(fraction[at(cube, n)], 1.0F);
        } else if (r > 15.5) {
            EXPECT_EQ(none[at(cube, n)], 0.0F);
        } else if (r > 10.5) {
            EXPECT_LE(fraction[at(cube, n)], 17.0F / 26);  // half of the rays, and those along the face
        }
    });
}

// In a pipe of inner radius r all rays meet the wall but for the two along it, and all are asked; in the last layer nine of
// them leave the grid and are not counted.
TEST(Enclosure, OfAPipeLacksItsTwoEnds)
{
    const VoxelGrid pipe{Index3(21, 21, 61), {Mat3(spacing), Vec3(0.0)}};
    const auto wall = filled<std::uint8_t>(
        pipe, [](Vec3 p) { return across(p) > 5 && across(p) <= 8 ? std::uint8_t{1} : std::uint8_t{0}; });
    const auto fraction = enclosure(pipe, wall, 12e-3);
    EXPECT_FLOAT_EQ(fraction[at(pipe, {10, 10, 30})], 24.0F / 26);
    EXPECT_FLOAT_EQ(fraction[at(pipe, {10, 10, 60})], 16.0F / 17);
}

// Rays have lengths in space: with voxels twice as long, half as many of them.
TEST(Enclosure, KnowsLongVoxels)
{
    VoxelGrid lengthy = cube;
    lengthy.affine.linear[2] *= 2.0;
    std::vector<std::uint8_t> one(at(cube, {0, 0, 41}), 0);
    one[at(lengthy, middle)] = 1;
    const auto fraction = enclosure(lengthy, one, 8e-3);
    EXPECT_GT(fraction[at(lengthy, middle + Index3(8, 0, 0))], 0.0F);
    EXPECT_EQ(fraction[at(lengthy, middle + Index3(9, 0, 0))], 0.0F);
    EXPECT_GT(fraction[at(lengthy, middle + Index3(0, 0, 4))], 0.0F);
    EXPECT_EQ(fraction[at(lengthy, middle + Index3(0, 0, 5))], 0.0F);
}

struct Made {
    std::vector<float> hu;
    Mask bone;
};

// What is found in muscle of 50 HU with noise of 15 HU, where `value` is not 0 that [HU].
Made foundIn(const VoxelGrid& grid, const std::function<float(Vec3)>& value, double noise = 15)
{
    std::mt19937 random(7);
    std::normal_distribution<float> off(0, static_cast<float>(noise));
    Made made{filled<float>(grid,
                            [&](Vec3 p) {
                                const float v = value(p);
                                return (v != 0 ? v : 50) + off(random);
                            }),
              {}};
    const Mask all(made.hu.size(), 1), none(made.hu.size(), 0);
    made.bone = findBone(grid, made.hu, all, none);
    return made;
}

// A shell with a gap 3 voxels wide and marrow as dark as fat comes back whole; muscle around it stays.
TEST(Bone, HasItsMarrowHoweverDark)
{
    for (const float marrow : {-80.0F, 40.0F, 180.0F}) {
        const auto value = [&](Vec3 p) {
            const bool gap = p.z > 0 && across(p) < 1.6;
            return glm::length(p) <= 10 ? (glm::length(p) > 8 && !gap ? 450.0F : marrow) : 0.0F;
        };
        const Made made = foundIn(cube, value);
        const auto bone =
            filled<std::uint8_t>(cube, [](Vec3 p) { return glm::length(p) <= 10 ? std::uint8_t{1} : std::uint8_t{0}; });
        double both = 0, sum = 0;
        for (std::size_t i = 0; i < bone.size(); ++i) {
            both += bone[i] != 0 && made.bone[i] != 0 ? 1 : 0;
            sum += bone[i] + made.bone[i];
        }
        EXPECT_GT(2 * both / sum, 0.98) << marrow;
    }
}

// A canal that is open at both ends is none, though its walls are bone.
TEST(Bone, HasNoCanal)
{
    const VoxelGrid pipe{Index3(41, 41, 121), {Mat3(spacing), Vec3(0.0)}};
    const Made made =
        foundIn(pipe, [](Vec3 p) { return across(p) > 8 && across(p) <= 12 && std::abs(p.z) < 20 ? 500.0F : 0.0F; });
    std::size_t inside = 0, canal = 0;
    volume::forEachIndex(Index3(0), pipe.size - 1, [&](Index3 n) {
        const Vec3 p = Vec3(n) - Vec3(pipe.size - 1) / 2.0;
        if (across(p) < 7 && std::abs(p.z) < 20) {
            ++canal;
            inside += made.bone[at(pipe, n)];
        }
    });
    EXPECT_LT(static_cast<double>(inside), 0.02 * static_cast<double>(canal));
}

// An organ with contrast medium is brighter than the limit, but nothing in it can only be bone; noise alone makes none
// either.
TEST(Bone, IsNoOrganWithContrastMedium)
{
    const Made organ = foundIn(
        cube, [](Vec3 p) { return glm::length(p) < 9 ? 165.0F : 0.0F; }, 8);
    EXPECT_EQ(std::count(organ.bone.begin(), organ.bone.end(), 1), 0);
    const Made noisy = foundIn(
        cube, [](Vec3) { return 0.0F; }, 40);
    EXPECT_LT(std::count(noisy.bone.begin(), noisy.bone.end(), 1), 20);  // of 69 thousand
}

// Partial volume lowers the limit from 150 HU in voxels of 1 mm to 125 HU in those of 3 mm, and no further.
TEST(Bone, LimitFollowsTheVoxelsSize)
{
    const auto limit = [](double edge) { return boneThreshold({Index3(2), {Mat3(edge), Vec3(0.0)}}); };
    EXPECT_EQ(limit(0.5e-3), 150);
    EXPECT_NEAR(limit(1e-3), 150, 1e-3);
    EXPECT_NEAR(limit(2e-3), 137.5, 1e-3);
    EXPECT_NEAR(limit(3e-3), 125, 1e-3);
    EXPECT_EQ(limit(10e-3), 125);
}

// What has a label is bone for its neighbours and around marrow, and is not found a second time.
TEST(Bone, LabelledBoneEnclosesToo)
{
    const auto shell = filled<std::uint8_t>(
        cube, [](Vec3 p) { return glm::length(p) > 8 && glm::length(p) <= 10 ? std::uint8_t{1} : std::uint8_t{0}; });
    Mask may(shell.size());
    std::transform(shell.begin(), shell.end(), may.begin(), [](std::uint8_t s) { return s != 0 ? 0 : 1; });
    int wrong = 0;
    const Mask bone = findBone(cube, std::vector<float>(shell.size(), 40.0F), may, shell);
    volume::forEachIndex(Index3(0), cube.size - 1, [&](Index3 n) {
        const double r = glm::length(Vec3(n - middle));
        wrong += bone[at(cube, n)] != (r <= 8 ? 1 : 0) ? 1 : 0;
    });
    EXPECT_EQ(wrong, 0);
}

}  // namespace
}  // namespace palpate::prepare
