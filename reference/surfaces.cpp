#include <reference/surfaces.h>

#include <reference/groups.h>
#include <reference/mesh_parts.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <functional>
#include <map>

namespace palpate::reference {

namespace {

// Middle and radius of the sphere that touches all four sides [m].
std::pair<Vec3, double> innerSphere(const TetMesh& mesh, std::size_t tet)
{
    const auto& t = mesh.tets[tet];
    Vec3 middle(0.0);
    double area = 0.0;
    for (std::size_t side = 0; side < 4; ++side) {
        const auto& c = faceCorners[side];
        const Vec3 a = mesh.points[t[c[0]]];
        const double twice = glm::length(glm::cross(mesh.points[t[c[1]]] - a, mesh.points[t[c[2]]] - a));
        middle += twice * mesh.points[t[side]];
        area += twice;
    }
    return {middle / area, sixVolumes(mesh, tet) / area};
}

// @param pieces  of one tissue that hang together by faces
void addSeeds(const TetMesh& mesh, Groups& pieces, Surfaces& out)
{
    std::map<std::uint32_t, double> radius;  // of the largest sphere so far, by the piece's root
    std::map<std::uint32_t, Surfaces::Seed> seeds;
    for (std::uint32_t t = 0; t < mesh.tets.size(); ++t) {
        const auto [middle, r] = innerSphere(mesh, t);
        double& best = radius[pieces.root(t)];
        if (r > best) {
            best = r;
            seeds[pieces.root(t)] = {middle, mesh.tissue[t]};
        }
    }
    for (const auto& [root, seed] : seeds) {
        out.seeds.push_back(seed);
    }
}

// Leaves the points that a facet has.
void dropUnused(Surfaces& surfaces)
{
    UsedPoints used(surfaces.points);
    for (auto& facet : surfaces.facets) {
        std::ranges::transform(facet.points, facet.points.begin(), std::ref(used));
    }
    surfaces.points = std::move(used.points);
}

}  // namespace

Surfaces surfacesOf(const TetMesh& mesh, AllPoints all)
{
    Surfaces out;
    out.points = mesh.points;
    Groups pieces(mesh.tets.size());
    const auto faces = sortedFaces(mesh);
    for (std::size_t i = 0; i < faces.size(); ++i) {
        const std::uint32_t tet = faces[i].tet;
        const bool shared = i + 1 < faces.size() && faces[i].key == faces[i + 1].key;
        const std::uint8_t other = shared ? mesh.tissue[faces[i + 1].tet] : Surfaces::outside;
        if (shared && other == mesh.tissue[tet]) {
            pieces.join(tet, faces[i + 1].tet);
        } else {
            Surfaces::Facet facet{{}, other, mesh.tissue[tet]};
            for (std::size_t c = 0; c < 3; ++c) {
                facet.points[c] = mesh.tets[tet][faceCorners[faces[i].side][c]];
            }
            out.facets.push_back(facet);
        }
        i += shared ? 1 : 0;
    }
    addSeeds(mesh, pieces, out);
    if (all == AllPoints::no) {
        dropUnused(out);
    }
    return out;
}

std::vector<double> enclosedVolumes(const Surfaces& surfaces)
{
    std::vector<double> volume(256, 0.0);
    for (const auto& facet : surfaces.facets) {
        const auto& p = facet.points;
        const double part = glm::dot(surfaces.points[p[0]], glm::cross(surfaces.points[p[1]], surfaces.points[p[2]])) / 6.0;
        volume[facet.back] += part;
        volume[facet.front] -= part;
    }
    volume[Surfaces::outside] = 0.0;
    return volume;
}

}  // namespace palpate::reference
