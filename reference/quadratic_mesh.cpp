#include <reference/quadratic_mesh.h>

#include <algorithm>

namespace palpate::reference {

QuadraticMesh::QuadraticMesh(const TetMesh& mesh) : nodes(mesh.points)
{
    for (const auto& tet : mesh.tets) {
        std::array<std::uint32_t, 10> ten{tet[0], tet[1], tet[2], tet[3]};
        for (std::size_t e = 0; e < edges.size(); ++e) {
            ten[4 + e] = middle(tet[edges[e][0]], tet[edges[e][1]]);
        }
        tets.push_back(ten);
    }
}

std::uint32_t QuadraticMesh::middle(std::uint32_t a, std::uint32_t b)
{
    const auto [at, isNew] = middles_.emplace(std::minmax(a, b), static_cast<std::uint32_t>(nodes.size()));
    if (isNew) {
        nodes.push_back(0.5 * (nodes[a] + nodes[b]));
    }
    return at->second;
}

std::array<std::uint32_t, 6> QuadraticMesh::face(const TetMesh::Face& face)
{
    const auto& p = face.points;
    return {p[0], p[1], p[2], middle(p[0], p[1]), middle(p[1], p[2]), middle(p[2], p[0])};
}

}  // namespace palpate::reference
