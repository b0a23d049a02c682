#include <haptics/surface_proxy.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::haptics {

namespace {

constexpr double longestSlip = 1e-3;  // of the proxy over the surface in one step [m]
constexpr int slipSteps = 8;
constexpr double axisStep = 1e-3;   // along the segment, where its deepest place is looked for [m]
constexpr double asDeep = 0.25e-3;  // places that are less apart in depth count as one [m]

}  // namespace

DeepestPlace deepestPlace(const volume::DistanceField& surface, const ProxyTool& tool, Vec3 front) noexcept
{
    const auto steps = static_cast<int>(std::ceil(tool.length / axisStep));
    if (steps == 0) {
        return {front, surface.distance(front)};
    }
    const auto placeAt = [&](int i) { return front - (tool.length * i / steps) * tool.axis; };
    double least = std::numeric_limits<double>::max();
    for (int i = 0; i <= steps; ++i) {
        least = std::min(least, surface.distance(placeAt(i)));
    }
    Vec3 sum(0.0);
    int count = 0;
    for (int i = 0; i <= steps; ++i) {
        if (const Vec3 place = placeAt(i); surface.distance(place) <= least + asDeep) {
            sum += place;
            ++count;
        }
    }
    return {sum / static_cast<double>(count), least};
}

SurfaceProxy touching(const volume::DistanceField& surface, const ProxyTool& tool, Vec3 front) noexcept
{
    for (int i = 0; i < 3; ++i) {
        const DeepestPlace place = deepestPlace(surface, tool, front);
        front += (tool.radius - place.distance) * surface.normal(place.at);
    }
    return {front, surface.normal(deepestPlace(surface, tool, front).at)};
}

void slip(const volume::DistanceField& surface, const ProxyTool& tool, Vec3 front, SurfaceProxy& proxy) noexcept
{
    for (int i = 0; i < slipSteps; ++i) {
        const Vec3 away = front - proxy.front;
        const double depth = -glm::dot(away, proxy.normal);
        const Vec3 across = away + depth * proxy.normal;
        const double excess = glm::length(across) - tool.friction * std::max(depth, 0.0);
        if (excess <= 1e-9) {
            return;
        }
        proxy = touching(surface, tool, proxy.front + std::min(excess, longestSlip) * glm::normalize(across));
    }
}

double depthUnder(const SurfaceProxy& proxy, Vec3 front) noexcept
{
    return -glm::dot(front - proxy.front, proxy.normal);
}

}  // namespace palpate::haptics
