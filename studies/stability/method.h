#pragma once

#include <haptics/session_model.h>
#include <haptics/simulation.h>
#include <studies/stability/scene.h>

#include <functional>
#include <string>

namespace palpate::studies {

/// Where a method runs. The model must outlive it.
struct MethodScene {
    const haptics::SessionModel& model;  // of the method's level
    const haptics::DeviceParameters& device;
    double period = 1e-3;  // of the force loop [s]
};

/// A running method. tick() is called once per period, in order, allocates nothing and does not throw.
struct RunningMethod {
    std::function<Vec3(const haptics::DeviceSample&)> tick;  // the force on the hand, capped [N]
    std::function<double()> residue = {};  // largest displacement of its tissue now [m]; empty: it has none
    std::function<const haptics::TickRecord*()> record = {};  // of a Simulation: its last tick; else empty
    std::function<Vec3()> tissue = {};                        // of a Simulation: force before its controller; else empty
};

/// Ours, or one that a user might take instead, as its authors would write it: no stabiliser but the cap.
struct StabilityMethod {
    std::string name;  // "god_object"
    std::function<RunningMethod(const MethodScene&)> start;
    datasets::ModelLevel level = datasets::ModelLevel::spring;  // of the model it runs on
    bool pierces = false;                                       // a needle can pierce its tissue
};

/// Ours first, the default level at the front.
std::vector<StabilityMethod> stabilityMethods();

/// Parts of stabilityMethods().
std::vector<StabilityMethod> ourMethods();
StabilityMethod lateUpdates();
StabilityMethod superposedNormals();
StabilityMethod godObject();
StabilityMethod penalty();
StabilityMethod layers();
StabilityMethod chainMailForce();

/// The largest force that a method may give on this device [N].
double capOf(const MethodScene& scene) noexcept;
/// Stiffness that baselines give a contact at `point` [N/m]: of a flat punch, 2 E R / (1 - nu^2), as level `spring`.
double contactStiffness(const MethodScene& scene, const volume::Tissue::Reader& reader, Vec3 point, Vec3 inward) noexcept;

/// Voxels in which the middle of the tool is in contact with the body at rest: for a ball, its body is one radius larger.
/// Air outside.
struct ContactVoxels {
    explicit ContactVoxels(const haptics::SessionModel& model);

    bool solid(Index3 n) const noexcept { return grid.contains(n) && full[grid.offset(n)] != 0; }
    Index3 voxel(Vec3 p) const noexcept;
    /// The place of `p` in voxels: voxel n takes [n, n + 1).
    Vec3 inVoxels(Vec3 p) const noexcept { return (p - grid.origin) / grid.spacing + 0.5; }

    volume::NodeGrid grid;           // nodes: the middles of voxels
    std::vector<std::uint8_t> full;  // (count x 1)
};

}  // namespace palpate::studies
