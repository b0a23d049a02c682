#pragma once

#include <studies/accuracy/accuracy.h>
#include <studies/kernel/baselines/tets.h>

#include <filesystem>
#include <vector>

namespace palpate::studies {

/// The body on a conforming mesh: borders of tissues are faces of tetrahedra, which are TetGen's. Each tetrahedron has its
/// tissue's stiffness; what a volume says of single voxels' does not count. Fixed tissue holds its points; a body without
/// lies on its back, as latticeTets() has it.
///
/// @param mesher      palpate-mesh; it runs as a child process
/// @param size        edges on the surfaces [m]
/// @param poissonCap  Poisson's ratios above are lowered to this [-], under 0.5
/// @throws std::runtime_error  when it cannot be meshed, or would have over `maxPoints`
TetBody conformingTets(const std::filesystem::path& mesher, const volume::Tissue& tissue, double size, double poissonCap,
                       std::size_t maxPoints);

/// Prefactored linear tetrahedra on such meshes ("tets_conforming"). The subject must outlive what they build.
std::vector<Baseline> conformingMethods(const AccuracySubject& subject, const std::filesystem::path& mesher);

}  // namespace palpate::studies
