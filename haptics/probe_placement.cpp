#include <haptics/probe_placement.h>

#include <base/error.h>
#include <base/units.h>
#include <datasets/crossing.h>
#include <haptics/probe.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

namespace palpate::haptics {

namespace {

using units::degree;
constexpr double flattest = 10 * degree, steepest = 50 * degree;          // between needle and face
constexpr double enoughMargin = 4e-3;                                     // from a vital structure [m]
constexpr double minBeside = 2e-3, maxBeside = 14e-3, besideStep = 3e-3;  // from the probe's edge to the entry [m]
constexpr int directions = 24;
constexpr double wayStep = 0.5e-3;   // [m]
constexpr double skinReach = 60e-3;  // along the probe's axis, to find the skin beside it [m]

// The middle of the target; of one that is not there, its deepest place.
Vec3 middleOf(const volume::DistanceField& target)
{
    Vec3 sum(0.0), deepest(0.0);
    std::size_t inside = 0;
    float least = 0.0F;
    for (std::size_t i = 0; i < target.values.size(); ++i) {
        if (target.values[i] < 0.0F) {
            const Vec3 at = target.grid.position(target.grid.node(i));
            sum += at;
            ++inside;
            deepest = target.values[i] < least ? at : deepest;
            least = std::min(least, target.values[i]);
        }
    }
    const Vec3 middle = sum / static_cast<double>(std::max<std::size_t>(inside, 1));
    return target.distance(middle) < 0.0 ? middle : deepest;
}

// Out of the body along its own normals.
Vec3 nearestSkin(const volume::DistanceField& surface, Vec3 from)
{
    Vec3 at = from;
    for (int i = 0; i < 64 && std::abs(surface.distance(at)) > 1e-5; ++i) {
        at -= surface.distance(at) * surface.normal(at);
    }
    return at;
}

// Where a line from outside meets the skin.
std::optional<Vec3> skinAlong(const volume::DistanceField& surface, Vec3 from, Vec3 inward)
{
    double before = surface.distance(from);
    for (double t = 0.0; t < 2.0 * skinReach; t += wayStep) {
        const double now = surface.distance(from + t * inward);
        if (before > 0.0 && now <= 0.0) {
            return from + (t - wayStep * now / (now - before)) * inward;
        }
        before = now;
    }
    return std::nullopt;
}

struct Way {
    Vec3 entry{0.0}, lateral{0.0};
    double margin = 0, length = 0;  // [m]
};

double marginOf(std::span<const GuardedStructure> structures, Vec3 entry, Vec3 end)
{
    double margin = enoughMargin;
    const double length = glm::distance(entry, end);
    for (double t = 0.0; t <= length; t += wayStep) {
        for (const GuardedStructure& s : structures.subspan(1)) {
            margin = std::min(margin, s.distance.distance(glm::mix(entry, end, t / length)));
        }
    }
    return margin;
}

}  // namespace

ProbePlan planProbe(const datasets::Scene& scene, const volume::Tissue& tissue, const volume::DistanceField& surface,
                    std::span<const GuardedStructure> structures)
{
    ProbePlan plan;
    plan.approach.aim = scene.aim.value_or(middleOf(structures[0].distance));
    const Vec3 aim = plan.approach.aim;
    plan.face = nearestSkin(surface, aim);
    plan.direction = glm::normalize(aim - plan.face);
    const Vec3 other = std::abs(plan.direction.x) < 0.8 ? Vec3(1, 0, 0) : Vec3(0, 1, 0);
    const Vec3 first = glm::normalize(other - glm::dot(other, plan.direction) * plan.direction);
    const Vec3 second = glm::cross(plan.direction, first);
    if (scene.entry) {
        plan.approach.entry = *scene.entry;
        const Vec3 way = *scene.entry - plan.face;
        const Vec3 side = way - glm::dot(way, plan.direction) * plan.direction;
        plan.lateral = glm::length(side) > 1e-3 ? glm::normalize(side) : first;
        return plan;
    }
    const datasets::WayJudge judge(scene, tissue);
    const volume::Tissue::Reader reader(tissue);
    const double half = Probe(scene.probe).halfLength();
    std::optional<Way> best;
    for (int i = 0; i < directions; ++i) {
        const double a = 2.0 * std::numbers::pi * i / directions;
        const Vec3 lateral = std::cos(a) * first + std::sin(a) * second;
        for (double beside = minBeside; beside <= maxBeside; beside += besideStep) {
            const Vec3 from = plan.face + (half + beside) * lateral - skinReach * plan.direction;
            const auto entry = skinAlong(surface, from, plan.direction);
            if (!entry) {
                continue;
            }
            const Vec3 way = aim - *entry;
            const double length = glm::length(way);
            const double angle = std::asin(glm::dot(way, plan.direction) / length);
            const Vec3 end = aim + 0.5 * scene.tool.notchLength * way / length;
            const double margin = marginOf(structures, *entry, end);
            const bool better = !best || margin > best->margin || (margin == best->margin && length < best->length);
            if (angle >= flattest && angle <= steepest && length < scene.tool.length && margin > 0.0 && better &&
                judge.judge(reader, *entry, aim, end).refusals.empty()) {
                best = Way{*entry, lateral, margin, length};
            }
        }
    }
    base::failIf(!best,
                 "{}: [probe] over_target: no needle reaches the target beside the probe at {:.0f} to {:.0f} degrees to "
                 "its face: give face_mm, direction and lateral",
                 scene.name, flattest / degree, steepest / degree);
    plan.lateral = best->lateral;
    plan.approach.entry = best->entry;
    return plan;
}

}  // namespace palpate::haptics
