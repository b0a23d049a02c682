#include "bodies.h"

#include <volume/tissue.h>

#include <tests/allocations.h>

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <thread>

namespace palpate::volume {
namespace {

using namespace bodies;

LabelImage noise()
{
    std::mt19937 random(1);
    LabelImage image{{50, 40, 30}, oblique({1e-3, 0.7e-3, 1.9e-3}, {0.3, -0.2, 0.1}, true), {}};
    image.values.resize(image.offset({0, 0, 30}));
    const std::vector<std::uint16_t> labels = {0, 1, 7, 300};
    for (std::uint16_t& v : image.values) {
        v = labels[random() % 4];
    }
    return image;
}

// Points within and around the volume, in voxels.
std::vector<Vec3> randomIndices(Index3 size)
{
    std::mt19937 random(2);
    std::uniform_real_distribution<double> uniform(-0.3, 1.3);
    std::vector<Vec3> points(100000);
    for (Vec3& p : points) {
        p = Vec3(uniform(random), uniform(random), uniform(random)) * Vec3(size);
    }
    return points;
}

TEST(Reader, AgreesWithTheDenseImageAndIsZeroOutside)
{
    const LabelImage image = noise();
    const Tissue tissue = Tissue::fromLabels(image, table(), names(), {});
    const Tissue::Reader reader(tissue);
    int outside = 0;
    for (const Vec3& index : randomIndices(image.size)) {
        const Index3 n(glm::floor(index + 0.5));
        const bool in = n.x >= 0 && n.y >= 0 && n.z >= 0 && n.x < 50 && n.y < 40 && n.z < 30;
        const Vec3 p = image.affine.toPatient(index);
        const std::uint16_t expected = in ? image.values[image.offset(n)] : std::uint16_t{0};
        outside += in ? 0 : 1;
        ASSERT_EQ(reader.label(p), expected);
        const std::uint8_t row = expected == 0 ? 0 : expected == 1 ? 1 : expected == 7 ? 2 : 3;
        ASSERT_EQ(reader.tissue(p), row);
        ASSERT_NEAR(reader.youngsModulus(p), table().rows[row].youngsModulus, 1e-4 * table().rows[row].youngsModulus);
    }
    EXPECT_GT(outside, 1000);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(reader.label(Vec3(nan)), 0);
    EXPECT_EQ(reader.label(Vec3(1e300)), 0);
}

TEST(Reader, AllocatesNothing)
{
    const LabelImage image = noise();
    const Tissue tissue = Tissue::fromLabels(image, table(), names(), {});
    const std::vector<Vec3> indices = randomIndices(image.size);
    const Tissue::Reader reader(tissue);
    const auto before = tests::allocations();
    double sum = 0;
    for (const Vec3& index : indices) {
        const Vec3 p = image.affine.toPatient(index);
        sum += reader.label(p) + reader.tissue(p) + reader.youngsModulus(p);
    }
    EXPECT_EQ(tests::allocations() - before, 0U);
    EXPECT_GT(sum, 0);
}

TEST(Reader, ThreadsWithReadersOfTheirOwnSeeTheSame)
{
    const LabelImage image = noise();
    const Tissue tissue = Tissue::fromLabels(image, table(), names(), {});
    const std::vector<Vec3> indices = randomIndices(image.size);
    std::vector<std::uint64_t> sums(4, 0);
    std::vector<std::thread> threads;
    for (std::uint64_t& sum : sums) {
        threads.emplace_back([&] {
            const Tissue::Reader reader(tissue);
            for (const Vec3& index : indices) {
                sum = sum * 31 + reader.label(image.affine.toPatient(index));
            }
        });
    }
    for (std::thread& thread : threads) {
        thread.join();
    }
    EXPECT_EQ(std::count(sums.begin(), sums.end(), sums[0]), 4);
    EXPECT_NE(sums[0], 0U);
}

}  // namespace
}  // namespace palpate::volume
