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

// Least clearance between the tool's surface and the body, and the point of the axis that has it.
double clearance(const Body& body, const Capsule& tool, Vec3& nearest) noexcept
{
    const int samples = axisSamples(body, tool);
    double least = 0.0;
    for (int i = 0; i < samples; ++i) {
        const Vec3 p = axisPoint(tool, i, samples);
        const double d = distance(body, p) - tool.radius;
        if (i == 0 || d < least) {
            least = d;
            nearest = p;
        }
    }
    return least;
}

double distanceToAxis(const Capsule& tool, Vec3 p) noexcept
{
    const Vec3 along = tool.b - tool.a;
    const double square = glm::dot(along, along);
    const double t = square > 0.0 ? glm::clamp(glm::dot(p - tool.a, along) / square, 0.0, 1.0) : 0.0;
    return glm::distance(p, tool.a + t * along);
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

}  // namespace

void touch(const Body& body, const Capsule& tool, ContactSet& out) noexcept
{
    const double reach = tool.radius + 0.5 * body.grid.spacing;
    out.count = 0;
    body.map.visit(glm::min(tool.a, tool.b) - reach, glm::max(tool.a, tool.b) + reach, [&](Element e) {
        const double depth = reach - distanceToAxis(tool, body.position(e));
        if (depth > 0.0 && out.count < ContactSet::capacity) {
            out.contacts[out.count++] = {e, depth};
        }
    });
    out.depth = -clearance(body, tool, out.point);
    out.touching = out.depth > 0.0;
    if (out.touching || out.count > 0) {
        out.normal = surfaceNormal(body, out.point);
    }
}

Sweep sweep(const Body& body, const Capsule& from, const Capsule& to) noexcept
{
    const double way = std::max(glm::distance(from.a, to.a), glm::distance(from.b, to.b));
    const double shortest = 0.25 * std::min(body.grid.spacing, body.surface.grid.spacing);
    Sweep result;
    double travelled = 0.0;
    for (int step = 0; step < sweepSteps; ++step) {
        result.fraction = way > 0.0 ? travelled / way : 1.0;
        const Capsule now{glm::mix(from.a, to.a, result.fraction), glm::mix(from.b, to.b, result.fraction), from.radius};
        const double clear = clearance(body, now, result.point);
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
