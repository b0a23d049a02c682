#include <haptics/surface_proxy.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

namespace palpate::haptics {

constexpr double longestSlip = 1e-3;  // of the proxy over the surface in one step [m]
constexpr int slipSteps = 8;
constexpr double axisStep = 1e-3;       // along the segment, where its deepest place is looked for [m]
constexpr double asDeep = 0.25e-3;      // places less high over the deepest count, by how much less [m]
constexpr int mostSteps = 512;          // along the segment
constexpr double otherSide = -0.5;      // cosine between normals, under which a place lies across a gap that the tool fills
constexpr double steepestField = 1.75;  // of a distance between its samples: sqrt(3), where each edge of a cell has slope 1

DeepestPlace deepestPlace(const volume::DistanceField& surface, const ProxyTool& tool, Vec3 front) noexcept
{
    const int steps = std::min(static_cast<int>(std::ceil(tool.length / axisStep)), mostSteps);
    if (steps == 0) {
        return {front, surface.distance(front)};
    }
    const double step = tool.length / steps;
    const auto placeAt = [&](int i) { return front - (tool.length * i / steps) * tool.axis; };
    struct Seen {
        int step;
        double distance;
    };
    std::array<Seen, mostSteps + 1> seen;
    std::size_t count = 0;
    double least = std::numeric_limits<double>::max();
    for (int i = 0; i <= steps;) {
        const double distance = surface.distance(placeAt(i));
        seen[count++] = {i, distance};
        least = std::min(least, distance);
        // So high over the deepest place so far, the next places are neither deeper nor about as deep. A spacing is for the
        // border of the field, where it is not quite continuous.
        const double over = distance - least - asDeep - surface.grid.spacing;
        i += std::max(1, static_cast<int>(std::min(over / (steepestField * step), static_cast<double>(steps))));
    }
    // With weights that begin at 0 the place does not jump as the tool turns.
    Vec3 sum(0.0);
    double weights = 0.0;
    for (const Seen& s : std::span(seen).first(count)) {
        const double weight = std::max(least + asDeep - s.distance, 0.0);
        sum += weight * placeAt(s.step);
        weights += weight;
    }
    return {sum / weights, least};
}

SurfaceProxy touching(const volume::DistanceField& surface, const ProxyTool& tool, Vec3 front) noexcept
{
    DeepestPlace place = deepestPlace(surface, tool, front);
    const Vec3 first = surface.normal(place.at);
    Vec3 normal = first;
    for (int i = 0; i < 3; ++i) {
        front += (tool.radius - place.distance) * normal;
        place = deepestPlace(surface, tool, front);
        normal = surface.normal(place.at);
        if (tool.radius > 0.0 && glm::dot(normal, first) < otherSide) {
            return {front, first, place.at};
        }
    }
    return {front, normal, place.at};
}

namespace {

// The proxy moved by `way`, touching again. In a gap that is as narrow as the tool, or looks so between samples of the
// distance, that may be the wall across it: then it goes along its own.
SurfaceProxy moved(const volume::DistanceField& surface, const ProxyTool& tool, const SurfaceProxy& from, Vec3 way) noexcept
{
    const SurfaceProxy to = touching(surface, tool, from.front + way);
    if (tool.radius > 0.0 && glm::dot(to.normal, from.normal) < otherSide) {
        return {from.front + way, from.normal, from.place + way};
    }
    return to;
}

}  // namespace

void slip(const volume::DistanceField& surface, const ProxyTool& tool, Vec3 front, SurfaceProxy& proxy) noexcept
{
    if (tool.length > 0.0) {
        // It may have turned.
        proxy = moved(surface, tool, proxy, Vec3(0.0));
    }
    double longest = longestSlip;
    for (int i = 0; i < slipSteps; ++i) {
        const Vec3 away = front - proxy.front;
        const double depth = -glm::dot(away, proxy.normal);
        const Vec3 across = away + depth * proxy.normal;
        const double excess = glm::length(across) - tool.friction * std::max(depth, 0.0);
        if (excess <= 1e-9) {
            return;
        }
        // Over an edge, or where two walls meet, a step may lead away from the tool.
        const double step = std::min(excess, longest);
        const SurfaceProxy next = moved(surface, tool, proxy, step * glm::normalize(across));
        if (glm::distance(next.front, front) < glm::length(away)) {
            proxy = next;
        } else {
            longest = 0.5 * step;
        }
    }
}

double depthUnder(const SurfaceProxy& proxy, Vec3 front) noexcept
{
    return -glm::dot(front - proxy.front, proxy.normal);
}

}  // namespace palpate::haptics
