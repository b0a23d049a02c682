#pragma once

#include <chainmail/elastic.h>
#include <datasets/scene.h>
#include <experiments/press/path_file.h>
#include <haptics/session_model.h>

#include <vector>

namespace palpate::experiments {

/// What a tool at a pose does to an elastic body. Sphere and capsule press with their surface. A needle has hold of the
/// tissue where it is at its first pose: the tip of the point that lies there, and its shaft, from the surface to the tip,
/// of one point every 4 mm behind it. Later poses carry these points along as parts of one rigid needle, on springs of 8 E
/// h (E of the cell that the point lies in). Points where there is no tissue are not held.
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
    void set(const ToolPose& pose) noexcept;
    const chainmail::ElasticLoad& load() const noexcept { return load_; }
    /// Of the tissue on the tool in the last call [N].
    Vec3 force(const chainmail::Elastic& elastic) const noexcept;
    /// Signed distance from the surface at rest to the deepest place on the tool's axis, negative inside [m].
    double axisOutside(const ToolPose& pose) const noexcept { return model_.surface.distance(deepest(pose)); }
    /// Where windows shall be while the tool is there.
    chainmail::Focus focusOf(const ToolPose& pose) const noexcept;

private:
    bool isNeedle() const noexcept { return tool_.kind == datasets::ToolKind::needle; }
    void hold(double behind);
    Vec3 onShaft(const ToolPose& pose, double behind) const noexcept { return pose.position - behind * pose.axis; }
    Vec3 deepest(const ToolPose& pose) const noexcept;
    double tieStiffnessAt(Vec3 rest) const noexcept;

    const haptics::SessionModel& model_;
    datasets::ToolSpec tool_;
    chainmail::ElasticTool surface_;
    ToolPose first_;
    std::vector<chainmail::Tie> ties_;
    std::vector<double> behind_;  // the tip, along the shaft: where each tie is held [m]
    chainmail::ElasticLoad load_;
};

/// From entry to aim of the scene.
Vec3 plannedAxis(const haptics::SessionModel& model) noexcept;

}  // namespace palpate::experiments
