#pragma once

#include <chainmail/elastic.h>
#include <datasets/scene.h>
#include <haptics/session_model.h>
#include <haptics/surface_proxy.h>
#include <studies/kernel/kernel_trial.h>
#include <studies/press/path_file.h>

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

namespace palpate::studies {

/// What a tool does to an elastic body as it goes from pose to pose. Sphere and capsule press with their surface, from
/// where they first touch the surface at rest until their proxy is clear of them; a capsule's proxy is the whole capsule,
/// which touches at the deepest place of its axis. A needle has hold of the tissue where it is at its first pose: it is a
/// rigid rod, of the tool's radius, that the tissue sticks to from the tip to the surface, in pieces of some 4 mm
/// (chainmail::ringOf). Without radius or length it is a point at the tip on springs of 8 E h (E of the cell that it lies
/// in). Pieces where there is no tissue hold nothing.
///
/// Not to be copied: the load refers to it. The model must outlive it.
class PoseLoad {
public:
    /// @param first  where a needle takes hold
    /// @pre          the model's level is elastic
    PoseLoad(const haptics::SessionModel& model, const datasets::ToolSpec& tool, const ToolPose& first);
    PoseLoad& operator=(PoseLoad&&) = delete;

    /// False for a needle whose tip is not in tissue at `first`: then it may not be used.
    bool holds() const noexcept { return !isNeedle() || !ties_.empty(); }
    /// @param pose  the next on the way
    void set(const ToolPose& pose) noexcept;
    const chainmail::ElasticLoad& load() const noexcept { return load_; }
    /// Of the tissue on the tool in the last call [N].
    Vec3 force(const chainmail::Elastic& elastic) const noexcept;
    /// The tool presses on the surface.
    bool inContact() const noexcept { return proxy_.has_value(); }
    /// It does so from the far side: all of the tool lies beyond the body as that is at rest.
    bool isBeyond(const ToolPose& pose) const noexcept;
    /// Where windows shall be while the tool is there: at the surface under its proxy, or under itself where it has none;
    /// for a needle, around the middle of what it holds.
    chainmail::Focus focusAt(const ToolPose& pose) const noexcept;

private:
    bool isNeedle() const noexcept { return tool_.kind == datasets::ToolKind::needle; }
    double inserted() const noexcept;
    void hold(double behind, const chainmail::RodPiece& piece);
    Vec3 onShaft(const ToolPose& pose, double behind) const noexcept { return pose.position - behind * pose.axis; }
    void moveProxy(const ToolPose& pose) noexcept;
    std::optional<Vec3> firstTouch(const haptics::ProxyTool& tool, Vec3 from, Vec3 to) const noexcept;
    chainmail::Focus focusUnder(Vec3 deepest) const noexcept;
    haptics::ProxyTool proxyTool(const ToolPose& pose) const noexcept { return {tool_.radius, tool_.length, pose.axis}; }

    const haptics::SessionModel& model_;
    datasets::ToolSpec tool_;
    chainmail::ElasticTool surface_;
    std::optional<haptics::SurfaceProxy> proxy_;  // while the tool presses
    std::optional<Vec3> last_;                    // its front end in the last pose [m]
    ToolPose first_;
    std::vector<chainmail::Tie> ties_;
    std::vector<double> behind_;  // the tip, along the shaft: where each tie is held [m]
    chainmail::ElasticLoad load_;
};

/// From entry to aim of the scene; nothing where there is no way between them.
std::optional<Vec3> plannedAxis(const haptics::SessionModel& model) noexcept;

struct PressOptions {
    datasets::ToolSpec tool;
    std::size_t every = 1;  // a sample in every n-th tick, and in the last; at least 1
    bool converge = false;  // ticks with a sample are solved to convergence
};

/// The elastic body's answer to one pose, raw: without contact law, stabiliser and device.
struct PressSample {
    ToolPose pose;
    Vec3 force{0.0};                 // of the tissue on the tool [N]
    double contactArea = 0;          // [m^2]
    double energy = 0;               // of tissue and contacts [J]
    double residual = 0;             // forces out of balance before the tick's last step, fraction of the contacts' forces
    double depth = 0;                // of the deepest point of tissue inside the tool [m]
    double behind = 0;               // by how much the tool is held back, see chainmail::Elastic [m]
    double took = 0;                 // this thread's processor time [s]
    std::vector<Vec3> displacement;  // of the points asked for [m] (count x 1)
};

/// What all ticks say, also those without a sample.
struct PressSummary {
    std::size_t ticks = 0;
    std::size_t inContact = 0;     // of them
    std::size_t windowMoves = 0;   // in contact
    std::size_t notConverged = 0;  // samples that were to be solved to convergence and are not
    TickTimes times;               // of ticks in contact
    double peakForce = 0;          // magnitude [N]
    ToolPose peakAt;
    std::optional<double> heldFrom;    // when the tool is first held back [s]
    std::optional<double> passedFrom;  // when it first touches tissue from beyond the body as that is at rest [s]
};

/// Residual to which PressOptions::converge solves, fraction of the contacts' forces.
inline constexpr double pressTolerance = 1e-4;

/// Area of the surface that a tool presses, as it is stretched [m^2].
double contactArea(const chainmail::Elastic& elastic) noexcept;

/// Drives the elastic body along the path from rest, tick by tick, and hands over the samples.
/// @param asked  points at rest whose displacement is in each sample [m]
/// @pre  the model's level is elastic
/// Throws std::runtime_error for a needle that begins outside of the tissue, points outside of it, and a force that is not
/// finite. Deterministic but for times.
PressSummary press(const haptics::SessionModel& model, const PosePath& path, std::span<const FilePoint> asked,
                   const PressOptions& options, const std::function<void(const PressSample&)>& sample);

}  // namespace palpate::studies
