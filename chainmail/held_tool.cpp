#include <chainmail/held_tool.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::chainmail {

namespace {

constexpr double smallStrain = 1.0;    // deepest that small strain is pressed, in the tool's radii
constexpr double maxStretch = 6.5;     // of the area under a tool
constexpr double sinkRadii = 0.03;     // the surface sinks into a tool by at most this fraction of its radius ...
constexpr double sinkSpacings = 0.15;  // ... and of the spacing,
constexpr double maxSink = 0.25;       // but not over this fraction of the radius
constexpr double onBone = 3.0;         // sinks into a contact that is as stiff as may be: in load over stiffness,
constexpr double mostOnBone = 0.35;  // but not over this fraction of the radius: from one on it would slip around the tool
constexpr double ease = 0.02;        // by which a tool goes deeper per call, in its radii, by what is left of maxStretch
constexpr double leastGiven = 0.1;   // from which depth Hertz's law goes on at least, in the tool's radii
constexpr int maxSteps = 256;        // along a way through the tissue

bool isHeld(const CellLevel& level, Vec3 at) noexcept
{
    const Index3 node(glm::round((at - level.nodes.origin) / level.nodes.spacing));
    return level.nodes.contains(node) && level.fixed[level.nodes.offset(node)] != 0;
}

Vec3 foremost(const occupancy::RoundCone& shape, Vec3 inward) noexcept
{
    const Vec3 a = shape.a + shape.radiusA * inward;
    const Vec3 b = shape.b + shape.radiusB * inward;
    return glm::dot(a, inward) > glm::dot(b, inward) ? a : b;
}

// How far the foremost point of the real tool is inside of what is held in space, on its way from where the body's is [m].
double insideHeld(const CellLevel& level, Vec3 from, Vec3 inward, double way) noexcept
{
    const double step = std::max(0.25 * level.nodes.spacing, way / maxSteps);
    for (double t = 0.0; t < way; t += step) {
        if (isHeld(level, from + t * inward)) {
            return way - t;
        }
    }
    return 0.0;
}

}  // namespace

ElasticTool HeldTool::place(const ElasticTool& tool, const CellLevel& finest, bool isSmall, bool holdsBack) noexcept
{
    const double radius = tool.shape.widest();
    const double wanted = glm::length(tool.pushed);
    const double most = isSmall ? std::min(wanted, smallStrain * radius) : wanted;
    const double sink = std::min(sinkRadii * radius + sinkSpacings * finest.nodes.spacing, maxSink * radius);
    const double bears = std::min(sink + onBone * load / tool.stiffest, std::max(sink, mostOnBone * radius));
    const double further = std::min(bears - sunk, ease * radius * (maxStretch - stretch));
    given = holdsBack ? std::clamp(given + further, 0.0, most) : wanted;
    behind = wanted - given;
    deeper = 1.0 + behind / std::max(given, leastGiven * radius);
    friction = tool.friction;
    inward = wanted > 0.0 ? tool.pushed / wanted : Vec3(0.0);
    stopped = 0.0;
    ElasticTool felt = tool;
    felt.shape.a -= behind * inward;
    felt.shape.b -= behind * inward;
    felt.pushed = given * inward;
    if (behind > 0.0) {
        stopped = std::min(tool.stiffest, ElasticTool().stiffest) *
                  insideHeld(finest, foremost(felt.shape, inward), inward, behind);
    }
    return felt;
}

Vec3 HeldTool::ownForce(Vec3 felt) const noexcept
{
    return outward(std::pow(deeper, 1.5) * (felt - lag) - stopped * inward);
}

Vec3 HeldTool::outward(Vec3 force) const noexcept
{
    const double into = glm::dot(force, inward);
    return friction > 0.0 || into <= 0.0 ? force : force - into * inward;
}

}  // namespace palpate::chainmail
