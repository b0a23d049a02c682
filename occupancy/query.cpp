#include <occupancy/query.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::occupancy {

namespace {

constexpr int axisSamplesAtMost = 32;

// Points along the tool's axis, no further apart than its radius or half an element.
int axisSamples(const Body& body, const Capsule& tool) noexcept
{
    const double step = std::max(tool.radius, 0.5 * body.grid.spacing);
    const double length = glm::distance(tool.a, tool.b);
    return std::clamp(static_cast<int>(std::ceil(length / step)) + 1, 1, axisSamplesAtMost);
}

Vec3 axisPoint(const Capsule& tool, int i, int samples) noexcept
{
    // From b, the tip: one sample means the tip.
    return samples == 1 ? tool.b : glm::mix(tool.b, tool.a, static_cast<double>(i) / (samples - 1));
}

Vec3 nearestOnAxis(const Capsule& tool, Vec3 p) noexcept
{
    const Vec3 along = tool.b - tool.a;
    const double square = glm::dot(along, along);
    const double t = square > 0.0 ? glm::clamp(glm::dot(p - tool.a, along) / square, 0.0, 1.0) : 0.0;
    return tool.a + t * along;
}

// Normal of the deformed surface at `p`: the gradient of the distance composed with the inverse displacement.
Vec3 surfaceNormal(const Body& body, Vec3 p) noexcept
{
    const double h = body.surface.grid.spacing;
    Vec3 g;
    for (int axis = 0; axis < 3; ++axis) {
        Vec3 e(0.0);
        e[axis] = h;
        g[axis] = distance(body, p + e) - distance(body, p - e);
    }
    const double length = glm::length(g);
    return length > 1e-12 ? g / length : Vec3(0, 0, 1);
}

// What lies around a tool: the element whose piece of surface is nearest to the tool's axis, and whether anything has
// moved.
struct Surroundings {
    Element nearest = none;
    double distance = 0;  // from the axis to that piece of surface, to half an element [m]
    bool moved = false;
};

// Visits the elements within `reach` of the tool's axis; visit(element, distance to the axis).
template <typename Visit>
Surroundings look(const Body& body, const Capsule& tool, double reach, Visit&& visit) noexcept
{
    Surroundings found;
    body.map.visit(glm::min(tool.a, tool.b) - reach, glm::max(tool.a, tool.b) + reach, [&](Element e) {
        const Vec3 p = body.position(e);
        const double away = glm::distance(p, nearestOnAxis(tool, p));
        if (away >= reach) {
            return;
        }
        // Its surface lies beyond it by its own depth at rest.
        const double surface = away + body.surface.at(body.restPosition(e));
        if (found.nearest == none || surface < found.distance) {
            found.nearest = e;
            found.distance = surface;
        }
        found.moved = found.moved || body.u[e] != Vec3f(0.0F);
        visit(e, away);
    });
    return found;
}

// Clearance between the tool's surface and the body, where the axis is nearest, and the body's normal there.
struct Gap {
    double clear = 0;
    Vec3 point{0.0};
    Vec3 normal{0, 0, 1};
};

// At rest the distance field answers for the axis itself.
Gap gapAtRest(const Body& body, const Capsule& tool) noexcept
{
    const int samples = axisSamples(body, tool);
    Gap gap;
    for (int i = 0; i < samples; ++i) {
        const Vec3 p = axisPoint(tool, i, samples);
        const double d = body.surface.distance(p) - tool.radius;
        if (i == 0 || d < gap.clear) {
            gap.clear = d;
            gap.point = p;
        }
    }
    gap.normal = body.surface.normal(gap.point);
    return gap;
}

// Deformed tissue is known only where elements are: look from the point of the tool's surface that faces the nearest of
// them, and turn it towards the body's surface.
Gap gapDeformed(const Body& body, const Capsule& tool, const Surroundings& around) noexcept
{
    constexpr int turns = 2;
    Gap gap;
    gap.point = nearestOnAxis(tool, body.position(around.nearest));
    const Vec3 facing = body.position(around.nearest) - gap.point;
    gap.normal = glm::dot(facing, facing) > 0.0 ? -glm::normalize(facing) : body.surface.normal(gap.point);
    for (int i = 0; i < turns; ++i) {
        gap.normal = surfaceNormal(body, gap.point - tool.radius * gap.normal);
        gap.point = nearestOnAxis(tool, gap.point - tool.radius * gap.normal);
    }
    gap.clear = distance(body, gap.point - tool.radius * gap.normal);
    return gap;
}

Gap gapOf(const Body& body, const Capsule& tool, const Surroundings& around) noexcept
{
    return around.moved ? gapDeformed(body, tool, around) : gapAtRest(body, tool);
}

}  // namespace

void touch(const Body& body, const Capsule& tool, ContactSet& out) noexcept
{
    const double reach = tool.radius + 0.5 * body.grid.spacing;
    out.count = 0;
    const auto around = look(body, tool, reach, [&](Element e, double away) {
        if (out.count < ContactSet::capacity) {
            out.contacts[out.count++] = {e, reach - away};
        }
    });
    const Gap gap = gapOf(body, tool, around);
    out.depth = -gap.clear;
    out.point = gap.point;
    out.touching = out.depth > 0.0;
    out.normal = gap.normal;
}

Sweep sweep(const Body& body, const Capsule& from, const Capsule& to) noexcept
{
    const double way = std::max(glm::distance(from.a, to.a), glm::distance(from.b, to.b));
    const double shortest = 0.25 * std::min(body.grid.spacing, body.surface.grid.spacing);
    const double reach = 1.5 * body.grid.spacing;
    Sweep result;
    double travelled = 0.0;
    for (int step = 0; step < sweepSteps; ++step) {
        result.fraction = way > 0.0 ? travelled / way : 1.0;
        const Capsule now{glm::mix(from.a, to.a, result.fraction), glm::mix(from.b, to.b, result.fraction), from.radius};
        const Gap gap = gapOf(body, now, look(body, now, now.radius + reach, [](Element, double) {}));
        const double clear = gap.clear;
        result.point = gap.point;
        if (clear <= 0.0) {
            result.hit = true;
            return result;
        }
        if (travelled >= way) {
            return result;
        }
        travelled = std::min(way, travelled + std::max(0.5 * clear, shortest));
    }
    result.hit = true;
    return result;
}

}  // namespace palpate::occupancy
