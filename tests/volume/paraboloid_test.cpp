#include <volume/paraboloid.h>

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace palpate::volume {
namespace {

// Height over the plane through `top`, a quadric of the places along two directions in it.
struct Quadric {
    SurfacePoint top;
    Vec3f u, v;
    double height, alongU, alongV, uu, uv, vv;

    SurfacePoint at(float a, float b) const
    {
        const double h = height + alongU * a + alongV * b + uu * a * a + uv * a * b + vv * b * b;
        return {top.at + a * u + b * v + static_cast<float>(h) * top.normal, top.normal};
    }
};

Quadric randomQuadric(std::mt19937& random)
{
    std::uniform_real_distribution<float> unit(-1.0F, 1.0F);
    Quadric quadric{{Vec3f(20.0F) + 5.0F * Vec3f(unit(random), unit(random), unit(random)),
                     glm::normalize(Vec3f(unit(random), unit(random), unit(random)))},
                    {},
                    {},
                    0.3 * unit(random),
                    0.1 * unit(random),
                    0.1 * unit(random),
                    0.03 * unit(random),
                    0.03 * unit(random),
                    0.03 * unit(random)};
    quadric.u = glm::normalize(glm::cross(quadric.top.normal, Vec3f(0.6F, 0.64F, 0.48F)));
    quadric.v = glm::cross(quadric.top.normal, quadric.u);
    return quadric;
}

// A quadric's own points have no residual, whatever they weigh: the fit is the quadric, however many they are and wherever
// in the columns they begin. What stands before and behind them, beyond reach or on another sheet does not count: all of it
// is far off the quadric.
TEST(Paraboloid, ThroughPointsOfAQuadricIsTheQuadric)
{
    std::mt19937 random(7);
    std::uniform_real_distribution<float> place(-3.0F, 3.0F);
    for (int count = 12; count < 60; ++count) {
        const Quadric quadric = randomQuadric(random);
        constexpr float reach = 5.0F;
        std::vector<SurfacePoint> own;
        for (int i = 0; i < count; ++i) {
            own.push_back(quadric.at(place(random), place(random)));
            if (i % 5 == 0) {
                own.push_back({quadric.top.at + 0.9F * reach * quadric.top.normal, quadric.top.normal});
                own.push_back({quadric.top.at + 1.1F * reach * quadric.u, quadric.top.normal});
                own.push_back({quadric.top.at + 0.5F * quadric.top.normal, -quadric.top.normal});
            }
        }
        const std::size_t before = random() % 7;
        PointColumns columns(before + own.size() + 3);
        for (std::size_t k = 0; k < before + own.size() + 3; ++k) {
            columns.set(k, {quadric.top.at + 0.4F * quadric.top.normal, quadric.top.normal});
        }
        for (std::size_t k = 0; k < own.size(); ++k) {
            columns.set(before + k, own[k]);
        }
        Paraboloid paraboloid(quadric.top, reach);
        const std::size_t middle = before + own.size() / 3;
        paraboloid.add(columns, before, middle);
        paraboloid.add(columns, middle, before + own.size());
        ASSERT_TRUE(paraboloid.solve()) << count;
        EXPECT_NEAR(paraboloid.height(), quadric.height, 2e-5) << count;
        EXPECT_NEAR(paraboloid.bend(), 2.0 * (quadric.uu + quadric.vv), 2e-5) << count;
        const Vec3f normal = glm::normalize(quadric.top.normal - static_cast<float>(quadric.alongU) * quadric.u -
                                            static_cast<float>(quadric.alongV) * quadric.v);
        EXPECT_NEAR(glm::length(paraboloid.normal() - normal), 0.0F, 2e-5F) << count;
    }
}

TEST(Paraboloid, IsNotToldByTooFewPoints)
{
    std::mt19937 random(3);
    const Quadric quadric = randomQuadric(random);
    PointColumns columns(9);
    for (std::size_t k = 0; k < 9; ++k) {
        columns.set(k, quadric.at(2.5F * static_cast<float>(k % 3) - 2.5F, 2.5F * static_cast<float>(k / 3) - 2.5F));
    }
    Paraboloid few(quadric.top, 5.0F);
    few.add(columns, 0, 9);
    EXPECT_FALSE(few.solve());
    Paraboloid twice(quadric.top, 5.0F);
    twice.add(columns, 0, 9);
    twice.add(columns, 0, 9);
    EXPECT_TRUE(twice.solve());
    Paraboloid alongALine(quadric.top, 5.0F);
    for (std::size_t k = 0; k < 9; ++k) {
        columns.set(k, quadric.at(0.4F * static_cast<float>(k) - 1.6F, 0.0F));
    }
    alongALine.add(columns, 0, 9);
    alongALine.add(columns, 0, 9);
    EXPECT_FALSE(alongALine.solve());
}

}  // namespace
}  // namespace palpate::volume
