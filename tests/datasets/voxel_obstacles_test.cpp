#include <datasets/voxel_obstacles.h>

#include <datasets/tables.h>
#include <volume/label_image.h>

#include <gtest/gtest.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include <algorithm>
#include <random>
#include <vector>

namespace palpate::datasets {
namespace {

using volume::LabelImage;
using volume::Tissue;

struct Body {
    LabelImage image;
    Tissue tissue;
    VoxelObstacles obstacles;
};

// A box of fat with lumps of 2 to 5 voxels of vessel in it; `skewed` leans its axes.
Body bodyOf(std::mt19937& random, bool skewed)
{
    std::uniform_real_distribution<double> any(-1, 1);
    Mat3 axes = glm::mat3_cast(glm::normalize(glm::dquat(any(random), any(random), any(random), any(random))));
    axes[1] += (skewed ? 0.3 : 0.0) * axes[0];
    const Vec3 spacing(0.6e-3, 1.1e-3, 2.3e-3);
    for (int k = 0; k < 3; ++k) {
        axes[k] *= spacing[k] * (k == 2 && random() % 2 == 0 ? -1.0 : 1.0);
    }
    LabelImage image{{40, 26, 14}, {axes, Vec3(any(random), any(random), any(random)) * 0.1}, {}};
    image.values.assign(image.offset(image.size - 1) + 1, 1);
    for (int lump = 0; lump < 4; ++lump) {
        const Index3 low(random() % 36, random() % 22, random() % 10);
        const Index3 high = low + Index3(1 + random() % 4, 1 + random() % 4, 1 + random() % 4);
        volume::forEachIndex(low, glm::min(high, image.size - 1), [&](Index3 n) { image.values[image.offset(n)] = 2; });
    }
    const std::vector<volume::LabelName> names{{1, "fat", "fat"}, {2, "vessel", "artery"}};
    Tissue tissue = Tissue::fromLabels(image, defaultTissues(), names, {});
    std::vector<char> obstacle(65536, 0);
    obstacle[2] = 1;
    VoxelObstacles obstacles(tissue, obstacle);
    return {image, std::move(tissue), std::move(obstacles)};
}

Vec3 anyPlace(std::mt19937& random, const Body& body)
{
    std::uniform_real_distribution<double> any(-1, 1);
    return body.image.affine.toPatient(Vec3(20, 13, 7) * (1.0 + Vec3(any(random), any(random), any(random))));
}

// By all voxels and 400 places along the segment: never less than the distance, and at most half a step more.
double bySamples(const LabelImage& image, Vec3 from, Vec3 to)
{
    double least = 1.0;
    const Mat3 toVoxel = glm::inverse(image.affine.linear);
    const Mat3 unit(glm::normalize(image.affine.linear[0]), glm::normalize(image.affine.linear[1]),
                    glm::normalize(image.affine.linear[2]));
    const Vec3 half = 0.5 * image.affine.spacing();
    volume::forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        if (image.values[image.offset(n)] != 2) {
            return;
        }
        for (int i = 0; i <= 400; ++i) {
            const Vec3 index = toVoxel * (glm::mix(from, to, i / 400.0) - image.affine.toPatient(Vec3(n)));
            const Vec3 beyond = glm::max(glm::abs(index * image.affine.spacing()) - half, Vec3(0.0));
            least = std::min(least, glm::length(unit * (beyond * glm::sign(index))));
        }
    });
    return least;
}

// Lines through oblique volumes of any handedness, with voxels of any shape.
TEST(VoxelObstacles, ADistanceIsThatOfTheNearestBox)
{
    std::mt19937 random(3);
    for (int trial = 0; trial < 6; ++trial) {
        const Body body = bodyOf(random, false);
        for (int line = 0; line < 8; ++line) {
            const Vec3 from = anyPlace(random, body), to = anyPlace(random, body);
            const double sampled = bySamples(body.image, from, to);
            const double found = body.obstacles.distance(from, to, 1.0);
            EXPECT_LE(found, sampled + 2e-6);
            EXPECT_GE(found, sampled - glm::distance(from, to) / 800 - 2e-6);
            EXPECT_EQ(body.obstacles.distance(from, to, 0.1e-3), std::min(found, 0.1e-3));
        }
    }
}

// Axes that lean: a voxel is the box around it, so that the distance is not too large. The sampled distance is that of the
// nearest point of a leaning box along its own axes, which is not too small.
TEST(VoxelObstacles, LeaningVoxelsAreNeverFurtherThanTheyAre)
{
    std::mt19937 random(4);
    for (int trial = 0; trial < 3; ++trial) {
        const Body body = bodyOf(random, true);
        for (int line = 0; line < 8; ++line) {
            const Vec3 from = anyPlace(random, body), to = anyPlace(random, body);
            EXPECT_LE(body.obstacles.distance(from, to, 1.0), bySamples(body.image, from, to) + 2e-6);
        }
    }
}

TEST(VoxelObstacles, WithoutAnyThereIsRoomAsFarAsIsAsked)
{
    std::mt19937 random(5);
    const Body body = bodyOf(random, false);
    const VoxelObstacles none(body.tissue, std::vector<char>(65536, 0));
    EXPECT_EQ(none.distance(Vec3(0.0), Vec3(0.1), 7e-3), 7e-3);
}

}  // namespace
}  // namespace palpate::datasets
