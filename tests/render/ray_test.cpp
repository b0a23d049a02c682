#include <render/leap_grid.h>
#include <render/ray_budget.h>
#include <tests/render/body.h>

#include <gtest/gtest.h>
#include <glm/common.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

namespace palpate::render {
namespace {

// Boxes of labels in air, in a volume whose sides are no multiples of a block.
struct Boxes {
    explicit Boxes(unsigned seed)
    {
        grid.size = {27, 22, 19};
        grid.spacing = 1e-3;
        labels.resize(27 * 22 * 19, 0);
        std::mt19937 random(seed);
        std::uniform_int_distribution<int> at(-3, 24), label(0, 3);
        for (int box = 0; box < 4; ++box) {
            const glm::ivec3 low(at(random), at(random), at(random)), high = low + 12;
            const int inside = label(random);
            const auto value = static_cast<std::uint8_t>(inside == 3 ? 1 | channel::shellBit : inside);
            for (std::size_t i = 0; i < labels.size(); ++i) {
                const glm::ivec3 n = voxel(static_cast<int>(i));
                if (glm::clamp(n, low, high) == n)
                    labels[i] = value;
            }
        }
    }
    glm::ivec3 voxel(int i) const
    {
        return {i % grid.size[0], i / grid.size[0] % grid.size[1], i / grid.size[0] / grid.size[1]};
    }
    // Whether all voxels of the blocks `low` to `high`, and those around them, have one label.
    bool same(glm::ivec3 low, glm::ivec3 high) const
    {
        const glm::ivec3 last(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1);
        low = glm::clamp(LeapGrid::side * low - 1, glm::ivec3(0), last);
        high = glm::clamp(LeapGrid::side * (high + 1), glm::ivec3(0), last);
        const auto label = [&](int x, int y, int z) {
            return labels[static_cast<std::size_t>((z * grid.size[1] + y) * grid.size[0] + x)];
        };
        for (int z = low.z; z <= high.z; ++z)
            for (int y = low.y; y <= high.y; ++y)
                for (int x = low.x; x <= high.x; ++x)
                    if (label(x, y, z) != label(low.x, low.y, low.z))
                        return false;
        return true;
    }

    channel::Grid grid;
    std::vector<std::uint8_t> labels;
};

// In the cube of blocks nearer than the distance there is one label, and in the next larger cube there is not.
TEST(LeapGrid, GivesTheLargestCubeWithoutABorder)
{
    for (unsigned seed = 1; seed < 4; ++seed) {
        const Boxes boxes(seed);
        const LeapGrid leaps = leapGrid(boxes.grid, boxes.labels);
        ASSERT_EQ(leaps.size, glm::ivec3(14, 11, 10));
        int at = 0, free = 0;
        for (int z = 0; z < leaps.size.z; ++z)
            for (int y = 0; y < leaps.size.y; ++y)
                for (int x = 0; x < leaps.size.x; ++x) {
                    const std::uint8_t block = leaps.blocks[static_cast<std::size_t>(at++)];
                    const int distance = block & ~LeapGrid::airBit;
                    const glm::ivec3 n(x, y, z);
                    ASSERT_EQ(boxes.same(n - distance + 1, n + distance - 1) || distance == 0, true) << x << y << z;
                    ASSERT_FALSE(distance < LeapGrid::most && boxes.same(n - distance, n + distance)) << x << y << z;
                    const int first = (2 * z * boxes.grid.size[1] + 2 * y) * boxes.grid.size[0] + 2 * x;
                    const bool air = (boxes.labels[static_cast<std::size_t>(first)] & channel::rowBits) == 0;
                    ASSERT_EQ((block & LeapGrid::airBit) != 0, air && distance > 0);
                    free += distance > 1 ? 1 : 0;
                }
        EXPECT_GT(free, 50);
    }
}

// A picture costs its rays and something else, and the machine is now slower, now faster.
TEST(RayBudget, NineOfTenPicturesAreInTime)
{
    constexpr double pixels = 312e3;
    std::mt19937 random(2);
    std::lognormal_distribution<double> slower(0, 0.2);
    for (const double perRay : {0.1e-6, 0.25e-6, 0.6e-6}) {
        RayBudget budget;
        int late = 0, all = 0;
        for (int i = 0; i < 6000; ++i) {
            const double apart = budget.apart(pixels);
            const double took = (9e-3 + perRay * pixels / (apart * apart)) * slower(random);
            budget.took(took);
            if (i > 500) {
                late += took > RayBudget::seconds ? 1 : 0;
                ++all;
            }
        }
        EXPECT_LT(late, all / 10) << perRay;
        EXPECT_GT(late, all / 30) << "what time there is, is used " << perRay;
    }
}

}  // namespace
}  // namespace palpate::render
