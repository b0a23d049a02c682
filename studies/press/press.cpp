#include <studies/press/press.h>

#include <base/error.h>
#include <base/processor_time.h>
#include <haptics/simulation.h>
#include <studies/press/pose_load.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cassert>
#include <cmath>

namespace palpate::studies {

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
                for (const Vec3& anchor : anchors_) {
                    s.displacement.push_back(elastic_.displacement(anchor));
                }
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
        if (!site.isTie && site.active()) {
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
