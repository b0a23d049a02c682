#include <studies/press/pose_load.h>

#include <chainmail/level.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>

namespace palpate::studies {

using datasets::ToolKind;

namespace {

constexpr double insertedStep = 0.1e-3;  // to which it is known how much of it is in the body [m]
constexpr double touchStep = 0.25e-3;    // at most so deep a tool is found that comes to the surface [m]

}  // namespace

std::optional<Vec3> plannedAxis(const haptics::SessionModel& model) noexcept
{
    if (!model.approach.isPlanned) {
        return std::nullopt;
    }
    const Vec3 way = model.approach.aim - model.approach.entry;
    return glm::length(way) > 0.0 ? glm::normalize(way) : -model.surface.normal(model.approach.entry);
}

PoseLoad::PoseLoad(const haptics::SessionModel& model, const datasets::ToolSpec& tool, const ToolPose& first)
    : model_(model), tool_(tool), first_(first)
{
    tool_.length = isNeedle() ? tool.length : tool.pressedLength();
    if (!isNeedle()) {
        surface_.friction = model.scene.model.elastic.friction;
        surface_.stiffest = chainmail::stiffnessUncapped(*model.elastic, tool.radius);
        load_.tools = {&surface_, 1};
        load_.led = 0;
        return;
    }
    if (model.surface.distance(first.position) < 0.0) {
        const double length = tool_.radius > 0.0 ? inserted() : 0.0;
        const double pieces = chainmail::piecesOfRod(length);
        for (double i = 0.5; i < pieces; ++i) {
            hold(i * length / pieces, {tool_.radius, length / pieces, length});
        }
    }
    load_.ties = ties_;
}

// How much of the shaft is in the body: from the tip to where it first comes out.
double PoseLoad::inserted() const noexcept
{
    double length = 0.0;
    while (length < tool_.length && model_.surface.distance(onShaft(first_, length)) < 0.0) {
        length = std::min(length + insertedStep, tool_.length);
    }
    return length;
}

// Near the surface the cell around a point may be half empty: the tie holds the tissue just under it, as in a session.
void PoseLoad::hold(double behind, const chainmail::RodPiece& piece)
{
    const double h = model_.elastic->levels.front().nodes.spacing;
    const Vec3 at = onShaft(first_, behind);
    const double under = std::max(0.0, 0.5 * h + model_.surface.distance(at));
    const Vec3 rest = at - under * model_.surface.normal(at);
    if (const double stiffness = chainmail::tieStiffnessAt(*model_.elastic, rest); stiffness > 0.0) {
        ties_.push_back({rest, Vec3(0.0), first_.axis, stiffness, stiffness, piece, first_.axis});
        behind_.push_back(behind);
    }
}

// Where the front end is when the tool first touches the surface at rest on this way.
std::optional<Vec3> PoseLoad::firstTouch(const haptics::ProxyTool& tool, Vec3 from, Vec3 to) const noexcept
{
    const double length = glm::distance(from, to);
    for (double gone = 0.0;;) {
        const Vec3 at = length > 0.0 ? glm::mix(from, to, gone / length) : to;
        const double gap = haptics::deepestPlace(model_.surface, tool, at).distance - tool.radius;
        if (gap < 0.0) {
            return at;
        }
        if (gone >= length) {
            return std::nullopt;
        }
        gone = std::min(length, gone + std::max(gap, touchStep));
    }
}

void PoseLoad::moveProxy(const ToolPose& pose) noexcept
{
    const haptics::ProxyTool tool = proxyTool(pose);
    if (!proxy_) {
        if (const auto touched = firstTouch(tool, last_.value_or(pose.position), pose.position)) {
            proxy_ = haptics::touching(model_.surface, tool, *touched);
        }
    }
    if (proxy_) {
        haptics::slip(model_.surface, tool, pose.position, *proxy_);
        if (haptics::depthUnder(*proxy_, pose.position) <= 0.0) {
            proxy_.reset();
        }
    }
    last_ = pose.position;
}

// Around the point of the surface under a place of the tool's axis.
chainmail::Focus PoseLoad::focusUnder(Vec3 deepest) const noexcept
{
    const volume::DistanceField& surface = model_.surface;
    const volume::NodeGrid& grid = surface.grid;
    const Vec3 at = glm::clamp(deepest, grid.position(Index3(0)), grid.position(grid.size - 1));
    return chainmail::focusAt(surface, at - surface.distance(at) * surface.normal(at));
}

chainmail::Focus PoseLoad::focusAt(const ToolPose& pose) const noexcept
{
    if (isNeedle()) {
        return chainmail::focusAt(model_.surface, 0.5 * (ties_.front().rest + ties_.back().rest));
    }
    return focusUnder(proxy_ ? proxy_->place : haptics::deepestPlace(model_.surface, proxyTool(pose), pose.position).at);
}

void PoseLoad::set(const ToolPose& pose) noexcept
{
    for (std::size_t i = 0; i < ties_.size(); ++i) {
        ties_[i].u = onShaft(pose, behind_[i]) - onShaft(first_, behind_[i]);
        ties_[i].axis = pose.axis;
    }
    if (!isNeedle()) {
        moveProxy(pose);
        surface_.shape = {onShaft(pose, tool_.length), pose.position, tool_.radius, tool_.radius};
        surface_.pushed = proxy_ ? pose.position - proxy_->front : Vec3(0.0);
    }
    load_.focus = focusAt(pose);
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

}  // namespace palpate::studies
