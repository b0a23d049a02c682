#pragma once

#include <reference/mesher.h>
#include <reference/solve.h>
#include <studies/kernel/kernel_trial.h>

#include <functional>
#include <string>

namespace palpate::reference {

/// A sphere's path through a body, or a capsule's, whose shaft points back along the press.
struct PressProblem {
    const volume::Tissue& tissue;
    const volume::DistanceField& surface;  // of the body at rest [m]
    const studies::TrialPath& path;
    double speed = 20e-3;      // the looks are those of schedule(path, speed) [m/s]
    double poissonCap = 0.49;  // Poisson's ratios above are lowered to this [-]
    SolveOptions solve;
    std::vector<studies::TrialPose> looks{};  // where to solve; none: as speed says
};

/// Where to look at the solution: the points of a lattice 2 mm apart within 30 mm of the contact's path, and of one 6 mm
/// apart beyond, that lie in soft tissue at least 0.5 mm under the surface [m].
std::vector<Vec3f> referencePoints(const PressProblem& problem);

/// Options that make the mesh fine where the path touches the body.
MeshOptions meshOptions(const PressProblem& problem, double size);

/// By row of the tissue table, then of the mixtures.
std::vector<Material> materialsOf(const PressProblem& problem, const BodyMesh& body);

/// The tool in a pose of the path.
RigidTool toolAt(const PressProblem& problem, studies::TrialPose pose);

/// Called after every look: its number from 0, of how many, and the state.
using LookSink = std::function<void(const Solver&, std::size_t look, std::size_t looks, const studies::ReferenceState&)>;

/// Solves all looks of the path in order, from the path's start. Of a body that is mirrored, force and energy are of all of
/// it. Throws std::runtime_error where that does not converge.
studies::Reference solvePath(const PressProblem& problem, const BodyMesh& body, const LookSink& sink);

}  // namespace palpate::reference
