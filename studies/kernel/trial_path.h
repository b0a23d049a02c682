#pragma once

#include <chainmail/elastic_contact.h>
#include <volume/scalar_field.h>
#include <volume/tissue.h>

#include <string>
#include <vector>

namespace palpate::studies {

/// Where a trial meets the body.
struct TrialPlace {
    Vec3 entry{0.0};       // on the surface [m]
    Vec3 inward{0, 1, 0};  // unit vector into the tissue: against the surface's normal
    Vec3 sideways{0.0};    // unit vector across it, as near to the patient's left as can be
    Vec3 approach{0.0};    // unit vector along the planned line
    double thickness = 0;  // of the tissue from the entry along `inward` to what is held, bone or air [m]
    double shaft = 0;      // the same along `approach` [m]
};

/// Throws std::runtime_error when there is no soft tissue under the entry.
TrialPlace trialPlace(const volume::Tissue& tissue, const volume::DistanceField& surface, Vec3 entry, Vec3 aim);

/// `sphere` and `capsule` press; `needle`: its tip is stuck to the tissue; `shaft`: it is inserted, and stuck all along.
enum class TrialKind : std::uint8_t { sphere, capsule, needle, shaft };

struct TrialTool {
    std::string name;
    TrialKind kind = TrialKind::sphere;
    double radius = 0;  // of sphere and capsule [m]
    double length = 0;  // of the capsule between the middles of its ends [m]
};

/// Spheres of 5 and 10 mm radius, needle and shaft.
std::vector<TrialTool> trialTools();

/// How far a tool has gone.
struct TrialPose {
    double pressed = 0;  // into the tissue [m]
    double dragged = 0;  // and then sideways [m]

    bool operator==(const TrialPose&) const = default;
};

/// Part of a path that a tick belongs to: the press, just after the turn, the drag, and the rest at its end.
enum class TrialPhase : std::uint8_t { press, turn, drag, rest };

/// One tick of a path.
struct TrialTick {
    TrialPose pose;
    TrialPhase phase = TrialPhase::press;
    bool look = false;  // errors are measured after it
};

/// The prescribed way of a tool: straight in, then sideways, then 50 ms at rest. Spheres start 0.5 mm from the surface and
/// press 0.8 of their radius, but not over 40 % of the tissue's thickness; a needle pulls 5 mm along the planned line and 3
/// mm sideways, an inserted shaft 2 and 3 mm. A needle's ties are 8 E h stiff.
struct TrialPath {
    TrialTool tool;
    Vec3 start{0.0};     // of a sphere's middle [m]
    Vec3 inward{0.0};    // unit vectors
    Vec3 sideways{0.0};  //
    double press = 0;    // from the start [m]
    double drag = 0;     // [m]
    double gap = 0;      // from the start to the surface [m]
    std::vector<chainmail::Tie> ties;
    const volume::DistanceField* surface = nullptr;

    Vec3 way(TrialPose pose) const noexcept { return pose.pressed * inward + pose.dragged * sideways; }
    Vec3 at(TrialPose pose) const noexcept { return start + way(pose); }
};

/// @param spacing  of the finest nodes: how stiff a needle's ties are [m]
/// The surface must outlive the path.
TrialPath trialPath(const volume::Tissue& tissue, const volume::DistanceField& surface, const TrialPlace& place,
                    const TrialTool& tool, double spacing);

/// The path tick by tick, 1 ms each. Looks: four in the press, 5 and 20 ticks after the turn, four in the drag, at rest.
/// The speed is met but for rounding to whole ticks between looks.
std::vector<TrialTick> schedule(const TrialPath& path, double speed);

/// The load of a pose. Not to be copied: the load refers to it.
class TrialLoad {
public:
    explicit TrialLoad(const TrialPath& path);
    TrialLoad& operator=(TrialLoad&&) = delete;

    void set(TrialPose pose) noexcept;
    const chainmail::ElasticLoad& load() const noexcept { return load_; }
    const TrialPath& path() const noexcept { return path_; }
    TrialPose pose() const noexcept { return pose_; }

private:
    const TrialPath& path_;
    TrialPose pose_;
    chainmail::ElasticTool tool_;
    std::vector<chainmail::Tie> ties_;
    chainmail::ElasticLoad load_;
};

}  // namespace palpate::studies
