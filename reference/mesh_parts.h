#pragma once

#include <reference/smooth_labels.h>
#include <reference/tet_mesh.h>

#include <span>
#include <vector>

namespace palpate::reference {

/// Six times the volume of a tetrahedron, positive when its points turn the right way [m^3].
double sixVolumes(const TetMesh& mesh, std::size_t tet) noexcept;
/// Volume of each tissue [m^3] (rows x 1).
std::vector<double> volumesOf(const TetMesh& mesh, std::span<const std::uint8_t> rows);
/// Of all tetrahedra [degrees].
double smallestDihedral(const TetMesh& mesh) noexcept;

/// Leaves the largest piece that hangs together by faces, and the points that it has. Returns the volume left out [m^3].
double keepLargestPiece(TetMesh& mesh);
/// Puts the points that lie on a flat side, but for rounding, exactly there, and takes tetrahedra away that have no volume
/// then.
void snapToSides(const SmoothLabels& labels, TetMesh& mesh);
/// Finds the faces on the outside, and which are held: those that look at bone or fixed tissue first.
void addFaces(const volume::Tissue& tissue, const SmoothLabels& labels, TetMesh& mesh);

}  // namespace palpate::reference
