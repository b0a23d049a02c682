#pragma once

#include <reference/tet_mesh.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

namespace palpate::reference {

/// Tetrahedra of ten nodes: corners as in the mesh that they are made of, then the middles of edges 01 12 02 03 13 23. This
/// is the order of VTK's quadratic tetrahedron and of CalculiX' C3D10.
class QuadraticMesh {
public:
    /// Corners of each edge, in the order of its nodes.
    static constexpr std::array<std::array<std::size_t, 2>, 6> edges{{{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}}};

    explicit QuadraticMesh(const TetMesh& mesh);

    /// Node in the middle of an edge.
    std::uint32_t middle(std::uint32_t a, std::uint32_t b);
    /// Corners of a face, then the middles of its edges.
    std::array<std::uint32_t, 6> face(const TetMesh::Face& face);

    std::vector<Vec3> nodes;                          // corners, then middles of edges [m] (count x 3)
    std::vector<std::array<std::uint32_t, 10>> tets;  // (count x 10)

private:
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles_;  // by corners in order
};

}  // namespace palpate::reference
