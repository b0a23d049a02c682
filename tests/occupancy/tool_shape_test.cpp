#include "../allocations.h"

#include <occupancy/tool_shape.h>

#include <gtest/gtest.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <random>

namespace palpate::occupancy {
namespace {

double distance(const RoundCone& tool, Vec3 p)
{
    return ShapeDistance(tool).distance(p);
}

Vec3 gradient(const RoundCone& tool, Vec3 p)
{
    return ShapeDistance(tool).gradient(p);
}

class Random {
public:
    double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
    Vec3 place(double reach) { return {between(-reach, reach), between(-reach, reach), between(-reach, reach)}; }

    // Tapered either way, with equal radii, a point for one end, a sphere, and one end inside the other.
    RoundCone tool(int kind)
    {
        const Vec3 a = place(1.0), b = place(1.0);
        const double r = between(0.1, 0.5), other = between(0.1, 0.5);
        switch (kind % 5) {
            case 0:
                return {a, b, r, other};
            case 1:
                return {a, b, r, r};
            case 2:
                return {a, b, 0.0, r};
            case 3:
                return {a, a, r, r};
            default:
                return {a, a + 0.3 * glm::normalize(b), r, r + (kind % 2 == 0 ? 0.35 : 0.3 - 1e-9)};
        }
    }

private:
    std::mt19937 engine_{11};
};

// Of the spheres that a round cone is made of, the nearest. The distance to one changes by at most 2 m per metre of axis
// (length and radius), so that it is over the exact one by no more than the distance between two of them.
double minOfSpheres(const RoundCone& tool, Vec3 p, int spheres)
{
    double least = 1e300;
    for (int i = 0; i <= spheres; ++i) {
        const double t = static_cast<double>(i) / spheres;
        least = std::min(least, glm::distance(p, glm::mix(tool.a, tool.b, t)) - std::lerp(tool.radiusA, tool.radiusB, t));
    }
    return least;
}

TEST(RoundCone, DistanceIsTheLeastToAllItsSpheres)
{
    constexpr int spheres = 4000;
    Random random;
    for (int i = 0; i < 1000; ++i) {
        const RoundCone tool = random.tool(i);
        const Vec3 p = random.place(1.5);
        const double sampled = minOfSpheres(tool, p, spheres);
        const double step = std::max(glm::distance(tool.a, tool.b), std::abs(tool.radiusB - tool.radiusA)) / spheres;
        ASSERT_LE(distance(tool, p), sampled + 1e-12) << i;
        ASSERT_GE(distance(tool, p), sampled - step - 1e-12) << i;
    }
}

// Central differences of a distance are exact to the square of their step over the distance to the axis.
TEST(RoundCone, GradientIsTheSlopeOfTheDistanceAndOfUnitLength)
{
    constexpr double h = 1e-5;
    Random random;
    for (int i = 0; i < 1000; ++i) {
        const RoundCone tool = random.tool(i);
        const Vec3 p = random.place(1.5), g = gradient(tool, p);
        ASSERT_NEAR(glm::length(g), 1.0, 1e-12) << i;
        for (int axis = 0; axis < 3; ++axis) {
            Vec3 e(0.0);
            e[axis] = h;
            ASSERT_NEAR(g[axis], (distance(tool, p + e) - distance(tool, p - e)) / (2.0 * h), 1e-4) << i;
        }
    }
}

// At a point of the axis the distance grows in many directions: the gradient is one of them.
TEST(RoundCone, GradientOnTheAxisLeadsOut)
{
    Random random;
    for (int i = 0; i < 100; ++i) {
        const RoundCone tool = random.tool(i);
        for (const double t : {0.0, 0.3, 1.0}) {
            const Vec3 p = glm::mix(tool.a, tool.b, t), g = gradient(tool, p);
            ASSERT_NEAR(glm::length(g), 1.0, 1e-12) << i;
            ASSERT_NEAR(distance(tool, p + 1e-4 * g) - distance(tool, p), 1e-4, 1e-9) << i;
        }
    }
}

TEST(RoundCone, OfACapsuleHasTheDistanceToItsSegmentLessItsRadius)
{
    const RoundCone tool{{0, 0, 0}, {0, 0, 2}, 0.5, 0.5};
    EXPECT_NEAR(distance(tool, {3, 4, 1}), 4.5, 1e-15);
    EXPECT_NEAR(distance(tool, {3, 0, 6}), 4.5, 1e-15);
    EXPECT_NEAR(distance(tool, {0, 0, -2}), 1.5, 1e-15);
    EXPECT_NEAR(distance(tool, {0, 0.25, 1}), -0.25, 1e-15);
}

TEST(RoundCone, WithOneEndInsideTheOtherIsTheLargerSphere)
{
    const Vec3 p(3, 4, 0);
    EXPECT_NEAR(distance(RoundCone{{0, 0, 0}, {0.1, 0, 0}, 2.0, 0.5}, p), 3.0, 1e-15);
    EXPECT_NEAR(distance(RoundCone{{0.1, 0, 0}, {0, 0, 0}, 0.5, 2.0}, p), 3.0, 1e-15);
    EXPECT_NEAR(distance(RoundCone{{0, 0, 0}, {0, 0, 0}, 0.5, 2.0}, p), 3.0, 1e-15);
}

TEST(RoundCone, AllocatesNothing)
{
    const RoundCone tool{{0, 0, 0}, {1, 0, 0}, 0.1, 0.4};
    double sum = 0.0;
    const auto count = tests::allocationsIn([&] {
        const ShapeDistance shape(tool);
        for (int i = 0; i < 100; ++i) {
            const Vec3 p(0.01 * i, 0.3, 0.1);
            sum += shape.distance(p) + shape.gradient(p).x;
        }
    });
    EXPECT_EQ(count, 0U);
    EXPECT_NE(sum, 0.0);
}

}  // namespace
}  // namespace palpate::occupancy
