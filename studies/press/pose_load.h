#pragma once

#include <chainmail/elastic.h>
#include <datasets/scene.h>
#include <haptics/session_model.h>
#include <haptics/surface_proxy.h>
#include <studies/press/path_file.h>

#include <optional>
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
    PoseLoad(const PoseLoad&) = delete;
    PoseLoad& operator=(const PoseLoad&) = delete;

    /// False for a needle whose tip is not in tissue at `first`: then it may not be used.
    bool holds() const noexcept { return !isNeedle() || !ties_.empty(); }
    /// @param pose  the next on the way
    void set(const ToolPose& pose) noexcept;
    const chainmail::ElasticLoad& load() const noexcept { return load_; }
    /// Of the tissue on the tool in the last call [N].
    Vec3 force(const chainmail::Elastic& elastic) const noexcept;
    /// The tool presses on the surface.
    bool inContact() const noexcept { return proxy_.has_value(); }
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

}  // namespace palpate::studies
