#include <chainmail/held_tool.h>

#include <chainmail/free_way.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::chainmail {

namespace {

constexpr double smallStrain = 1.0;  // deepest that small strain is pressed, in the tool's radii
constexpr double maxStretch = 6.5;   // of the area under a tool,
constexpr double perCell = 1.7;      // but at most 1 and this for each cell of its radius, by the square of them up to this
constexpr double mostUnder = 0.2;    // of a tool's load, on nodes under the surface
constexpr double sinkRadii = 0.03;   // the surface sinks into a tool by at most this fraction of its radius ...
constexpr double sinkSpacings = 0.15;  // ... and of the spacing,
constexpr double maxSink = 0.25;       // but not over this fraction of the radius
constexpr double onBone = 3.0;         // sinks into a contact that is as stiff as may be: in load over stiffness,
constexpr double mostOnBone = 0.35;  // but not over this fraction of the radius: from one on it would slip around the tool
constexpr double ease = 0.11;        // by which a tool goes deeper per call, in its radii, by what is left of its limits,
constexpr double swing = 0.2;        // and by the square close to them, where less than this is left:
constexpr double deeperBy = 1.0;     // as if its radius were at most so many cells;
constexpr double backBy = 2.5;       // beyond a limit tissue slips around it, so it goes back faster
constexpr double leastGiven = 0.1;   // from which depth Hertz's law goes on at least, in the tool's radii
constexpr double still = 0.05;       // change of a tool's depth in a call that its patch does not follow, of the depth
constexpr double stop = 4e3;         // of what is held, stiffness [N/m]

}  // namespace

ElasticTool HeldTool::place(const ElasticTool& tool, const ElasticBody& body, bool isSmall, bool holdsBack) noexcept
{
    const double radius = tool.shape.widest();
    const double wanted = glm::length(tool.pushed);
    friction = tool.friction;
    inward = wanted > 0.0 ? tool.pushed / wanted : Vec3(0.0);
    const double free = holdsBack ? freeWay(body, tool, inward, wanted) : wanted;
    const double most = isSmall ? std::min(free, smallStrain * radius) : free;
    const double spacing = body.levels.front().nodes.spacing;
    const double sink = std::min(sinkRadii * radius + sinkSpacings * spacing, maxSink * radius);
    const double bears = std::min(sink + onBone * load / tool.stiffest, std::max(sink, mostOnBone * radius));
    const double squeezed = load > 0.0 ? under / (mostUnder * load) : 0.0;
    const double cells = radius / spacing;
    const double bearable = std::min(1.0 + cells * std::min(cells, perCell), maxStretch);
    const double left = 1.0 - std::max(std::max(stretch - 1.0, 0.0) / (bearable - 1.0), squeezed);
    // The body answers some calls later: in proportion alone, a tool swings around its limit.
    const double near = std::min(radius, (left > 0.0 ? deeperBy : backBy) * spacing) * std::abs(left) / swing;
    const double further = std::min(bears - sunk, ease * std::min(radius, near) * left);
    // A tool that is led sideways into what is held, over an edge, was stopped by no force on its way there: its depth
    // counts as far as it goes further in itself.
    stopped = stop * std::clamp(stopped / stop + wanted - given - behind, 0.0, wanted - free);
    given = holdsBack ? std::clamp(given + further, 0.0, most) : wanted;
    behind = wanted - given;
    inHeld = wanted - free;
    deeper = 1.0 + (free - given) / std::max(given, leastGiven * radius);
    ElasticTool felt = tool;
    felt.shape.a -= behind * inward;
    felt.shape.b -= behind * inward;
    felt.pushed = given * inward;
    return felt;
}

double HeldTool::changed() const noexcept
{
    if (!(loaded > 0.0) || !(given > 0.0)) {
        return 1.0;
    }
    const double change = given / loaded;
    return std::pow(change / std::clamp(change, 1.0 - still, 1.0 + still), 1.5);
}

Vec3 HeldTool::ownForce() const noexcept
{
    // Hertz: a ball's force grows with the depth to the power of 3/2, that of a cylinder on its side in proportion.
    const double power = load > 0.0 ? 1.0 + 0.5 * std::min(onEnds / load, 1.0) : 1.5;
    return outward(std::pow(deeper, power) * (felt - lag) - stopped * inward);
}

Vec3 HeldTool::outward(Vec3 force) const noexcept
{
    const double into = glm::dot(force, inward);
    return friction > 0.0 || into <= 0.0 ? force : force - into * inward;
}

}  // namespace palpate::chainmail
