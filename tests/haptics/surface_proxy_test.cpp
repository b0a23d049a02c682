#include <haptics/surface_proxy.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <random>

namespace palpate::haptics {
namespace {

// Distance to a ball, or to two, in a box that does not reach far beside them.
volume::DistanceField balls(double apart, double radius)
{
    constexpr double spacing = 1.5e-3;
    volume::DistanceField field;
    field.grid = {Index3(40, 24, 28), -spacing * Vec3(19.5, 11.5, 13.5), spacing};
    volume::forEachIndex(Index3(0), field.grid.size - 1, [&](Index3 n) {
        const Vec3 p = field.grid.position(n), middle(0.5 * apart, 0, 0);
        field.values.push_back(static_cast<float>(std::min(glm::distance(p, middle), glm::distance(p, -middle)) - radius));
    });
    return field;
}

// What it is by definition: every place along the tool is looked at.
DeepestPlace everyPlace(const volume::DistanceField& surface, const ProxyTool& tool, Vec3 front)
{
    const int steps = std::min(static_cast<int>(std::ceil(tool.length / 1e-3)), 512);
    const auto placeAt = [&](int i) { return front - (tool.length * i / steps) * tool.axis; };
    double least = surface.distance(front);
    for (int i = 1; i <= steps; ++i) {
        least = std::min(least, surface.distance(placeAt(i)));
    }
    Vec3 sum(0.0);
    double weights = 0.0;
    for (int i = 0; i <= steps; ++i) {
        const double weight = std::max(least + 0.25e-3 - surface.distance(placeAt(i)), 0.0);
        sum += weight * placeAt(i);
        weights += weight;
    }
    return {sum / weights, least};
}

// Places that are passed over because the distance cannot fall so fast change nothing, inside the field and beside it.
TEST(SurfaceProxy, DeepestPlaceIsThatOfEveryPlace)
{
    std::mt19937 random(5);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    for (const double apart : {0.0, 16e-3, 30e-3}) {
        const auto surface = balls(apart, 7e-3);
        for (int i = 0; i < 2000; ++i) {
            const auto direction = [&] { return Vec3(unit(random), unit(random), unit(random)); };
            const ProxyTool tool{3e-3, i % 10 == 0 ? 0.5 : 1e-3 + 40e-3 * std::abs(unit(random)),
                                 glm::normalize(direction()), 0.0};
            const Vec3 front = 40e-3 * direction();
            const DeepestPlace found = deepestPlace(surface, tool, front);
            const DeepestPlace expected = everyPlace(surface, tool, front);
            ASSERT_EQ(found.distance, expected.distance) << apart << " " << i;
            ASSERT_EQ(found.at, expected.at) << apart << " " << i;
        }
    }
}

// Distance to a block that is 50 mm wide and 40 mm deep, with a slit in its middle that is 20 mm deep.
volume::DistanceField slitBlock(double width, double spacing, Vec3 off)
{
    const auto box = [](Vec3 p, Vec3 low, Vec3 high) {
        const Vec3 out = glm::max(low - p, p - high);
        return glm::length(glm::max(out, Vec3(0.0))) + std::min(std::max({out.x, out.y, out.z}), 0.0);
    };
    volume::DistanceField field;
    field.grid = {Index3(static_cast<int>(64e-3 / spacing)), Vec3(-30e-3, -23e-3, -30e-3) + off, spacing};
    volume::forEachIndex(Index3(0), field.grid.size - 1, [&](Index3 n) {
        const Vec3 p = field.grid.position(n), low(-25e-3, 0.0, -25e-3), high(25e-3, 40e-3, 25e-3);
        const double left = box(p, low, Vec3(-0.5 * width, high.y, high.z));
        const double right = box(p, Vec3(0.5 * width, low.y, low.z), high);
        const double under = box(p, Vec3(low.x, 20e-3, low.z), high);
        field.values.push_back(static_cast<float>(std::min({left, right, under})));
    });
    return field;
}

// A rod that nearly fills a slit, or does between samples of the distance, is led into one wall: its proxy stays on that
// wall. It changed to the other in any tick, which ended the contact, and the next began with a proxy far away.
TEST(SurfaceProxy, KeepsItsWallInASlitAsNarrowAsTheTool)
{
    std::mt19937 random(3);
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    for (int i = 0; i < 60; ++i) {
        const double spacing = (1.0 + unit(random)) * 1e-3;
        const auto surface = slitBlock(4e-3, spacing, spacing * Vec3{unit(random), unit(random), unit(random)});
        const ProxyTool rod{(1.4 + 0.5 * unit(random)) * 1e-3, 25e-3, Vec3(0, 1, 0), 0.0};
        const double side = i % 2 == 0 ? 1.0 : -1.0;
        const Vec3 start(side * 0.7e-3, 14e-3, 0.0);
        SurfaceProxy proxy = touching(surface, rod, start);
        for (int step = 0; step <= 400; ++step) {
            const Vec3 front = start + Vec3(side * 20e-6 * step, 0.0, 0.0);
            slip(surface, rod, front, proxy);
            if (depthUnder(proxy, front) <= 0.0) {
                proxy = touching(surface, rod, front);
            }
            ASSERT_TRUE(step < 40 || -side * proxy.normal.x > 0.9) << i << ", step " << step;
            ASSERT_LT(std::abs(proxy.front.x), 1.5e-3) << i << ", step " << step;
        }
        EXPECT_GT(depthUnder(proxy, start + Vec3(side * 8e-3, 0.0, 0.0)), 7e-3) << i;
    }
}

// A ball that is wider than a slit is pressed into it beside its middle. Its proxy lies on both edges and follows it step
// by step. It jumped from edge to edge by a millimetre in any tick, and with it the force.
TEST(SurfaceProxy, LiesStillOverASlitThatIsNarrowerThanTheTool)
{
    std::mt19937 random(4);
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    for (int i = 0; i < 60; ++i) {
        const double spacing = (1.0 + unit(random)) * 1e-3, width = (8.0 + 10.0 * unit(random)) * 1e-3;
        const auto surface = slitBlock(width, spacing, spacing * Vec3{unit(random), unit(random), unit(random)});
        const ProxyTool ball{(0.55 + 0.6 * unit(random)) * width, 0.0, Vec3(0, 1, 0), 0.0};
        const double aside = 0.5e-3 * unit(random);
        Vec3 front(aside, 0.5e-3 - ball.radius, 0.3e-3);
        SurfaceProxy proxy = touching(surface, ball, front);
        for (int step = 0; step < 700; ++step) {
            const Vec3 before = proxy.front;
            front.y += step < 500 ? 20e-6 : 0.0;
            slip(surface, ball, front, proxy);
            const double most = step >= 510 ? 1e-9 : step >= 100 ? 0.8e-3 : 1.0;
            ASSERT_LE(glm::distance(proxy.front, before), most) << i << ", step " << step;
        }
    }
}

}  // namespace
}  // namespace palpate::haptics
