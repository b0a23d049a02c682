#pragma once

#include <reference/tet_mesh.h>

namespace palpate::reference {

/// Replaces tetrahedra with dihedral angles under `target`, or over 180 degrees less that, together with their neighbours
/// by others that fill the same place with a larger worst angle: those around an edge, or on both sides of a face. Edges
/// and faces between tissues stay. Where that is not enough, a point of it merges with another on the same surfaces, if
/// the worst angle grows; surfaces may then move a little. One that is still bad then, and that two faces or more part from
/// one other tissue, goes over to that tissue: slivers on a surface, and those that are a piece of their own.
/// @param target  [degrees]
/// @returns       how many times something was changed
/// Source: J. R. Shewchuk, "Two discrete optimization algorithms for the topological improvement of tetrahedral meshes",
/// 2002 (edge removal by dynamic programming, after Klincsek).
std::size_t swapBad(TetMesh& mesh, double target);

}  // namespace palpate::reference
