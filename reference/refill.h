#pragma once

#include <reference/mesher.h>

#include <functional>

namespace palpate::reference {

/// Makes the tetrahedra of a mesh anew: outside and borders between tissues stay.
using Refill = std::function<TetMesh(const TetMesh& mesh)>;

/// meshBody() whose tetrahedra `refill` then makes from CGAL's: two meshers share the surfaces.
BodyMesh meshBody(const volume::Tissue& tissue, const MeshOptions& options, const Refill& refill);

}  // namespace palpate::reference
