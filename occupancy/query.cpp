#include <occupancy/query.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::occupancy {

namespace {

constexpr int axisSamplesAtMost = 32;

// Points along the tool's axis, no further apart than its radius or half an element. One means the tip, b.
int axisSamples(const Body& body, const Capsule& tool) noexcept
{
    const double step = std::max(tool.radius, 0.5 * body.grid.spacing);
    const double length = glm::distance(tool.a, tool.b);
    return std::clamp(static_cast<int>(std::ceil(length / step)) + 1, 1, axisSamplesAtMost);
}

// The segment in the middle of a tool.
class Axis {
public:
    explicit Axis(const Capsule& tool) noexcept : a_(tool.a), along_(tool.b - tool.a), square_(glm::dot(along_, along_)) {}

    Vec3 nearest(Vec3 p) const noexcept
    {
        const double t = square_ > 0.0 ? glm::clamp(glm::dot(p - a_, along_) / square_, 0.0, 1.0) : 0.0;
        return a_ + t * along_;
    }

private:
    Vec3 a_;
    Vec3 along_;
    double square_;
};

// Normal of the deformed surface at `p`: the gradient of the distance composed with the inverse displacement.
Vec3 surfaceNormal(const Body& body, Vec3 p) noexcept
{
    const Vec3 g = distanceDifference(body, p, body.surface.grid.spacing);
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

// Visits the elements within `reach` of the tool's axis; visit(element).
template <typename Visit>
Surroundings look(const Body& body, const Capsule& tool, double reach, Visit&& visit) noexcept
{
    // Beyond doubt out of reach: spares most elements the square root.
    const double far = (1.0 + 1e-9) * reach * reach;
    const Axis axis(tool);
    RestPositions restPosition(body.grid);
    Surroundings found;
    body.map.visit(glm::min(tool.a, tool.b) - reach, glm::max(tool.a, tool.b) + reach, [&](Element e) {
        const Vec3 rest = restPosition(e);
        const Vec3 p = rest + Vec3(body.u[e]);
        const Vec3 way = axis.nearest(p) - p;
        const double square = glm::dot(way, way);
        if (square > far) {
            return;
        }
        const double away = std::sqrt(square);
        if (away >= reach) {
            return;
        }
        // Its surface lies beyond it by its own depth at rest.
        const double surface = away + body.surface.at(rest);
        if (found.nearest == none || surface < found.distance) {
            found.nearest = e;
            found.distance = surface;
        }
        found.moved = found.moved || body.u[e] != Vec3f(0.0F);
        visit(e);
    });
    return found;
}

// Clearance between the tool's surface and the body [m], and the point of the tool's axis where it is least.
struct Gap {
    double clear = 0;
    Vec3 point{0.0};
};

// At rest the distance field answers for the axis itself: at the samples, then to a thousandth of the axis around the best.
Gap gapAtRest(const Body& body, const Capsule& tool) noexcept
{
    const int samples = axisSamples(body, tool);
    Gap gap;
    double best = 0.0;
    const auto see = [&](double t, bool first) {
        const Vec3 p = glm::mix(tool.b, tool.a, t);
        const double d = body.surface.distance(p) - tool.radius;
        if (first || d < gap.clear) {
            gap = {d, p};
            best = t;
        }
    };
    see(0.0, true);
    for (int i = 1; i < samples; ++i) {
        see(static_cast<double>(i) / (samples - 1), false);
    }
    for (double step = 0.5 / (samples - 1); samples > 1 && step > 1e-3; step *= 0.5) {
        const double middle = best;
        see(std::max(0.0, middle - step), false);
        see(std::min(1.0, middle + step), false);
    }
    return gap;
}

// Deformed tissue is known only where elements are: look from the point of the tool's surface that faces the nearest of
// them, and turn it towards the body's surface.
Gap gapDeformed(const Body& body, const Capsule& tool, const Surroundings& around) noexcept
{
    constexpr int turns = 2;
    const Axis axis(tool);
    Gap gap;
    gap.point = axis.nearest(body.position(around.nearest));
    const Vec3 facing = body.position(around.nearest) - gap.point;
    Vec3 normal = glm::dot(facing, facing) > 0.0 ? -glm::normalize(facing) : body.surface.normal(gap.point);
    for (int i = 0; i < turns; ++i) {
        normal = surfaceNormal(body, gap.point - tool.radius * normal);
        gap.point = axis.nearest(gap.point - tool.radius * normal);
    }
    gap.clear = distance(body, gap.point - tool.radius * normal);
    return gap;
}

// Where tissue would be at rest and is not, as in a dent, nothing is in reach.
Gap gapOf(const Body& body, const Capsule& tool, const Surroundings& around) noexcept
{
    if (around.moved) {
        return gapDeformed(body, tool, around);
    }
    Gap gap = gapAtRest(body, tool);
    const bool isDent = gap.clear <= 0.0 && around.nearest == none && displacementAt(body, gap.point) != Vec3(0.0);
    gap.clear = isDent ? 0.5 * body.grid.spacing : gap.clear;
    return gap;
}

}  // namespace

void touch(const Body& body, const Capsule& tool, ContactSet& out) noexcept
{
    const double reach = tool.radius + 0.5 * body.grid.spacing;
    out.count = 0;
    const auto around = look(body, tool, reach, [&](Element e) {
        if (out.count < ContactSet::capacity) {
            out.elements[out.count++] = e;
        }
    });
    out.depth = -gapOf(body, tool, around).clear;
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
        const Gap gap = gapOf(body, now, look(body, now, now.radius + reach, [](Element) {}));
        const double clear = gap.clear;
        result.point = gap.point;
        result.front = now.b;
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
