#include <studies/press/press.h>

#include <base/error.h>
#include <base/folds.h>
#include <base/mapped.h>
#include <base/processor_time.h>
#include <chainmail/level.h>
#include <haptics/simulation.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <ranges>

namespace palpate::studies {

using datasets::ToolKind;

constexpr double insertedStep = 0.1e-3;  // to which it is known how much of it is in the body [m]
constexpr double touchStep = 0.25e-3;    // at most so deep a tool is found that comes to the surface [m]

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

bool PoseLoad::isBeyond(const ToolPose& pose) const noexcept
{
    return proxy_ && haptics::deepestPlace(model_.surface, proxyTool(pose), pose.position).distance > tool_.radius;
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
    return base::sumOf(
        std::views::iota(0UL, ties_.size()), [&](auto i) { return elastic.tieForce(i); }, Vec3(0.0));
}

using chainmail::Elastic;
using chainmail::ElasticResult;

namespace {

constexpr int maxPressCycles = 500;  // of a pose that is solved to convergence

// Where the tissue is that was asked for.
std::vector<Vec3> anchorsOf(const haptics::SessionModel& model, std::span<const FilePoint> asked)
{
    const chainmail::CellLevel& level = model.elastic->levels.front();
    std::vector<Vec3> anchors;
    for (const FilePoint& point : asked) {
        const double outside = model.surface.distance(point.at);
        base::failIf(outside > 0.5 * level.nodes.spacing,
                     "{}: the point lies {:.2f} mm outside of the tissue: it must lie inside, as the tissue is at rest",
                     point.where, 1e3 * outside);
        anchors.push_back(nearestTissue(level, point.at));
    }
    return anchors;
}

chainmail::ElasticOptions optionsFor(const haptics::SessionModel& model, const datasets::ToolSpec& tool)
{
    chainmail::ElasticOptions options = haptics::elasticOptions(model.scene.model.elastic);
    options.touches = haptics::touchedBy(tool, *model.elastic);
    return options;
}

// Which way is in, for the windows, is decided where the tool first touches, or where it comes nearest to the body.
chainmail::Focus startOf(const PosePath& path, const haptics::SessionModel& model, const PressOptions& options)
{
    PoseLoad load(model, options.tool, path.poses.front());
    base::failIf(!load.holds(), "{}: the needle's tip is not in tissue at the first pose: begin the path inside the tissue",
                 path.origin);
    const bool presses = options.tool.kind != datasets::ToolKind::needle;
    for (std::size_t tick = 0; presses && tick < path.ticks(); ++tick) {
        load.set(path.at(tick));
        if (load.inContact()) {
            return load.load().focus;
        }
    }
    const auto distance = [&](const ToolPose& pose) { return model.surface.distance(pose.position); };
    return load.focusAt(*std::ranges::min_element(path.poses, {}, distance));
}

class Press {
public:
    Press(const haptics::SessionModel& model, const PosePath& path, std::span<const FilePoint> asked,
          const PressOptions& options)
        : options_(options),
          path_(path),
          anchors_(anchorsOf(model, asked)),
          load_(model, options.tool, path.poses.front()),
          elastic_(*model.elastic, optionsFor(model, options.tool), startOf(path, model, options))
    {
    }

    PressSummary run(const std::function<void(const PressSample&)>& sample)
    {
        summary_.ticks = path_.ticks();
        for (std::size_t tick = 0; tick < summary_.ticks; ++tick) {
            const bool wanted = tick % options_.every == 0 || tick + 1 == summary_.ticks;
            PressSample s = solve(path_.at(tick), wanted && options_.converge);
            count(s, wanted || !options_.converge);
            if (wanted) {
                s.displacement = base::mapped<Vec3>(anchors_, [&](Vec3 anchor) { return elastic_.displacement(anchor); });
                sample(s);
            }
        }
        summary_.times = tickTimes(std::move(seconds_));
        return summary_;
    }

private:
    PressSample solve(const ToolPose& pose, bool converge)
    {
        const double start = base::processorTime();
        load_.set(pose);
        const ElasticResult result =
            converge ? elastic_.relax(load_.load(), maxPressCycles, pressTolerance) : elastic_.relax(load_.load());
        PressSample s;
        s.took = base::processorTime() - start;
        s.pose = pose;
        s.force = load_.force(elastic_);
        s.contactArea = contactArea(elastic_);
        s.energy = result.energy;
        s.residual = shareLeft(elastic_, result);
        s.depth = result.depth;
        s.behind = result.behind;
        base::failIf(!std::isfinite(glm::length(s.force)) || !std::isfinite(s.energy),
                     "{}: {:.3f} s: the force is not a number: move the tool less deep or more slowly", path_.origin,
                     pose.seconds);
        summary_.notConverged += converge && s.residual > pressTolerance ? 1 : 0;
        summary_.windowMoves += result.moved && !elastic_.atRest() ? 1 : 0;
        return s;
    }

    // Of a path that is solved to convergence only those samples are `given`: between them the solution is on its way.
    void count(const PressSample& s, bool given)
    {
        if (s.behind > 0.0 && given && !summary_.heldFrom) {
            summary_.heldFrom = s.pose.seconds;
        }
        if (!summary_.passedFrom && load_.isBeyond(s.pose)) {
            summary_.passedFrom = s.pose.seconds;
        }
        if (elastic_.atRest()) {
            return;
        }
        ++summary_.inContact;
        if (!given) {
            return;
        }
        seconds_.push_back(s.took);
        if (const double force = glm::length(s.force); force > summary_.peakForce) {
            summary_.peakForce = force;
            summary_.peakAt = s.pose;
        }
    }

    const PressOptions& options_;
    const PosePath& path_;
    std::vector<Vec3> anchors_;
    PoseLoad load_;
    Elastic elastic_;
    PressSummary summary_;
    std::vector<double> seconds_;  // of ticks in contact
};

}  // namespace

double contactArea(const Elastic& elastic) noexcept
{
    double area = 0.0;
    chainmail::StretchAt stretchAt(elastic.stack(), volume::SmallStrain{});
    for (const chainmail::ContactSite& site : elastic.sites()) {
        if (!site.isTie && !site.isSubsurface && site.active()) {
            area += stretchAt(site).area * static_cast<double>(site.area);
        }
    }
    return area;
}

PressSummary press(const haptics::SessionModel& model, const PosePath& path, std::span<const FilePoint> asked,
                   const PressOptions& options, const std::function<void(const PressSample&)>& sample)
{
    assert(model.elastic && !path.poses.empty() && options.every > 0);
    return Press(model, path, asked, options).run(sample);
}

}  // namespace palpate::studies
