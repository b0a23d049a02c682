#include <experiments/press/pose_load.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::experiments {

using datasets::ToolKind;

namespace {

constexpr double tieSpacing = 4e-3;   // along a needle's shaft [m]
constexpr double tieStiffness = 8.0;  // in E h
constexpr double axisStep = 1e-3;     // along a capsule's axis, where its deepest place is looked for [m]
constexpr double asDeep = 0.25e-3;    // places of a capsule that are less apart in depth count as one [m]

}  // namespace

Vec3 plannedAxis(const haptics::SessionModel& model) noexcept
{
    const Vec3 way = model.approach.aim - model.approach.entry;
    return glm::length(way) > 0.0 ? glm::normalize(way) : -model.surface.normal(model.approach.entry);
}

PoseLoad::PoseLoad(const haptics::SessionModel& model, const datasets::ToolSpec& tool, const ToolPose& first)
    : model_(model), tool_(tool), first_(first)
{
    tool_.length = tool.kind == ToolKind::sphere ? 0.0 : tool.length;
    if (!isNeedle()) {
        surface_.friction = model.scene.model.elastic.friction;
        load_.tools = {&surface_, 1};
        return;
    }
    if (model.surface.distance(first.position) < 0.0) {
        hold(0.0);
    }
    for (double s = tieSpacing; holds() && s <= tool_.length && model.surface.distance(onShaft(first, s)) < 0.0;
         s += tieSpacing) {
        hold(s);
    }
    load_.ties = ties_;
}

// Near the surface the cell around a point may be half empty: the tie holds the tissue just under it, as in a session.
void PoseLoad::hold(double behind)
{
    const double h = model_.elastic->levels.front().nodes.spacing;
    const Vec3 at = onShaft(first_, behind);
    const double under = std::max(0.0, 0.5 * h + model_.surface.distance(at));
    const Vec3 rest = at - under * model_.surface.normal(at);
    if (const double stiffness = tieStiffnessAt(rest); stiffness > 0.0) {
        ties_.push_back({rest, Vec3(0.0), first_.axis, stiffness, stiffness});
        behind_.push_back(behind);
    }
}

double PoseLoad::tieStiffnessAt(Vec3 rest) const noexcept
{
    const chainmail::CellLevel& level = model_.elastic->levels.front();
    const Index3 cell(glm::floor((rest - level.nodes.origin) / level.nodes.spacing));
    const float mu = level.nodes.contains(cell) ? level.mu[level.nodes.offset(cell)] : 0.0F;
    return tieStiffness * chainmail::youngsModulusOf(mu) * level.nodes.spacing;
}

// The place on the tool's axis that is deepest in the body at rest, or nearest to it; the middle of several.
Vec3 PoseLoad::deepest(const ToolPose& pose) const noexcept
{
    const auto steps = static_cast<int>(std::ceil(tool_.length / axisStep));
    const auto placeAt = [&](int i) { return onShaft(pose, steps > 0 ? tool_.length * i / steps : 0.0); };
    double least = std::numeric_limits<double>::max();
    for (int i = 0; i <= steps; ++i) {
        least = std::min(least, model_.surface.distance(placeAt(i)));
    }
    Vec3 sum(0.0);
    int count = 0;
    for (int i = 0; i <= steps; ++i) {
        if (const Vec3 place = placeAt(i); model_.surface.distance(place) <= least + asDeep) {
            sum += place;
            ++count;
        }
    }
    return sum / static_cast<double>(count);
}

// For a tool that presses, around the point of the surface under it; for a needle, around the middle of what it holds.
chainmail::Focus PoseLoad::focusOf(const ToolPose& pose) const noexcept
{
    const volume::DistanceField& surface = model_.surface;
    if (isNeedle()) {
        return chainmail::focusAt(surface, 0.5 * (ties_.front().rest + ties_.back().rest));
    }
    const volume::NodeGrid& grid = surface.grid;
    const Vec3 at = glm::clamp(deepest(pose), grid.position(Index3(0)), grid.position(grid.size - 1));
    return chainmail::focusAt(surface, at - surface.distance(at) * surface.normal(at));
}

void PoseLoad::set(const ToolPose& pose) noexcept
{
    load_.focus = focusOf(pose);
    for (std::size_t i = 0; i < ties_.size(); ++i) {
        ties_[i].u = onShaft(pose, behind_[i]) - onShaft(first_, behind_[i]);
        ties_[i].axis = pose.axis;
    }
    surface_.shape = {onShaft(pose, tool_.length), pose.position, tool_.radius, tool_.radius};
    const Vec3 at = deepest(pose);
    const double depth = tool_.radius - model_.surface.distance(at);
    surface_.pushed = depth > 0.0 ? -depth * model_.surface.normal(at) : Vec3(0.0);
}

Vec3 PoseLoad::force(const chainmail::Elastic& elastic) const noexcept
{
    if (!isNeedle()) {
        return elastic.toolForce(0);
    }
    Vec3 sum(0.0);
    for (std::size_t i = 0; i < ties_.size(); ++i) {
        sum += elastic.tieForce(i);
    }
    return sum;
}

}  // namespace palpate::experiments
