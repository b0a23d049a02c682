#pragma once

#include <volume/tissue.h>

#include <array>

namespace palpate::reference {

/// The part of a volume on the positive side of planes of symmetry: with SolveOptions::mirrored, a solution of it is one
/// of the whole.
/// @param mirrored  the planes x, y, z = 0 that are planes of symmetry
/// Throws std::runtime_error where a plane does not run between voxels, or tissues differ across it.
volume::Tissue mirroredPart(const volume::Tissue& tissue, std::array<bool, 3> mirrored);

}  // namespace palpate::reference
