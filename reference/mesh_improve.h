#pragma once

#include <reference/tet_mesh.h>

namespace palpate::reference {

/// Which points may move: those inside a tissue, or also those on surfaces, along them where they are smooth.
enum class Moving : std::uint8_t { inner, surfaces };

/// Moves the points of tetrahedra with dihedral angles under `target` or over 180 degrees less that, one by one, to where
/// the worst angle around them is largest. What is shared by whom stays; nothing gets worse or turns over. Points on lines
/// where surfaces meet or bend stay where they are.
/// @param target  [degrees]
/// Source: L. A. Freitag, C. Ollivier-Gooch, "Tetrahedral mesh improvement using swapping and smoothing", Int. J. Numer.
/// Methods Eng. 40, 1997; here by search along directions in place of their linear programme.
void improveAngles(TetMesh& mesh, double target, Moving moving);

}  // namespace palpate::reference
