#pragma once

#include <reference/surfaces.h>
#include <reference/tet_mesh.h>

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::reference {

/// How TetGen fills surfaces.
struct TetGenOptions {
    std::filesystem::path program;  // palpate-mesh, which runs it as a process of its own; "": beside this program
    std::string switches = "pq1.4/12AaYMO9";  // of TetGen; the facets stay as they are (Y)
    double largest = 0;                       // edge of a tetrahedron away from the surfaces [m]; 0: no bound
    double seconds = 3600;                    // after which it is ended [s]
};

/// Tetrahedra that fill `surfaces`, by TetGen in a process of its own. Their facets are faces of the mesh, their other
/// points are points of it, each tetrahedron
/// is of one tissue, and the volume of every tissue is the enclosed one. Faces are left out. Throws std::runtime_error, one
/// line, when TetGen fails, breaks down or takes too long, or its mesh is not what was asked for.
TetMesh fillSurfaces(const Surfaces& surfaces, const TetGenOptions& options);

/// Facets that cross others, by TetGen's switch `-d`; each as its three points in order.
std::vector<std::array<std::uint32_t, 3>> crossingFacets(const Surfaces& surfaces, const TetGenOptions& options);

}  // namespace palpate::reference
