#pragma once

#include <reference/solve.h>
#include <reference/tet_mesh.h>

#include <string>

namespace palpate::reference {

/// A solved state as a VTK unstructured grid (.vtu, XML) for ParaView: quadratic tetrahedra at rest, with `displacement`
/// [m] at their points, and `stress` (Cauchy, mean, [Pa]) and `tissue` (see BodyMesh) of each.
std::string vtuText(const TetMesh& mesh, const Solver& solver);

}  // namespace palpate::reference
