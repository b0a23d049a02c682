#include <reference/mesh_quality.h>

#include <base/quantiles.h>
#include <reference/mesh_parts.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace palpate::reference {

namespace {

constexpr double small = 10.0;  // dihedral angle that is counted [degrees]

// Three times the radius of the inner sphere by that of the outer one: 1 for a regular tetrahedron.
double radiiOf(const TetMesh& mesh, std::size_t tet)
{
    const auto& t = mesh.tets[tet];
    const Vec3 a = mesh.points[t[0]];
    const Vec3 b = mesh.points[t[1]] - a, c = mesh.points[t[2]] - a, d = mesh.points[t[3]] - a;
    const double six = sixVolumes(mesh, tet);
    const double area = 0.5 * (glm::length(glm::cross(b, c)) + glm::length(glm::cross(c, d)) +
                               glm::length(glm::cross(d, b)) + glm::length(glm::cross(c - b, d - b)));
    const double outer = glm::length(glm::dot(b, b) * glm::cross(c, d) + glm::dot(c, c) * glm::cross(d, b) +
                                     glm::dot(d, d) * glm::cross(b, c)) /
                         (2.0 * std::abs(six));
    return six > 0.0 ? 3.0 * (0.5 * six / area) / outer : 0.0;
}

void countFaces(const TetMesh& mesh, MeshQuality& q)
{
    const auto faces = sortedFaces(mesh);
    for (std::size_t i = 0; i < faces.size();) {
        std::size_t end = i + 1;
        while (end < faces.size() && faces[end].key == faces[i].key) {
            ++end;
        }
        q.outside += end == i + 1 ? 1U : 0U;
        q.between += end == i + 2 && mesh.tissue[faces[i].tet] != mesh.tissue[faces[i + 1].tet] ? 1U : 0U;
        q.overShared += end > i + 2 ? 1U : 0U;
        i = end;
    }
}

void measureEdges(const TetMesh& mesh, MeshQuality& q)
{
    q.shortest = std::numeric_limits<double>::infinity();
    for (const auto& tet : mesh.tets) {
        for (std::size_t i = 0; i < 4; ++i) {
            for (std::size_t j = 0; j < i; ++j) {
                const double length = glm::distance(mesh.points[tet[i]], mesh.points[tet[j]]);
                q.shortest = std::min(q.shortest, length);
                q.longest = std::max(q.longest, length);
            }
        }
    }
}

std::pair<double, double> dihedralsOf(const TetMesh& mesh, const std::array<std::uint32_t, 4>& tet) noexcept
{
    std::array<Vec3, 4> normals;
    for (std::size_t side = 0; side < 4; ++side) {
        const auto& c = faceCorners[side];
        const Vec3 a = mesh.points[tet[c[0]]];
        const Vec3 n = glm::cross(mesh.points[tet[c[1]]] - a, mesh.points[tet[c[2]]] - a);
        const double length = glm::length(n);
        normals[side] = length > 0.0 ? n / length : Vec3(0.0);
    }
    double low = 1.0, high = -1.0;
    for (std::size_t i = 0; i < 4; ++i) {
        for (std::size_t j = 0; j < i; ++j) {
            const double cosine = -glm::dot(normals[i], normals[j]);
            low = std::min(low, cosine);
            high = std::max(high, cosine);
        }
    }
    const double degrees = 180.0 / std::numbers::pi;
    return {std::acos(std::clamp(high, -1.0, 1.0)) * degrees, std::acos(std::clamp(low, -1.0, 1.0)) * degrees};
}

}  // namespace

std::pair<double, double> dihedralsOf(const TetMesh& mesh, std::size_t tet) noexcept
{
    return dihedralsOf(mesh, mesh.tets[tet]);
}

double smallestDihedral(const TetMesh& mesh) noexcept
{
    double least = 180.0;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        least = std::min(least, dihedralsOf(mesh, t).first);
    }
    return least;
}

double worstDihedral(const TetMesh& mesh, const std::array<std::uint32_t, 4>& tet) noexcept
{
    if (!(sixVolumes(mesh, tet) > 0.0)) {
        return -1.0;
    }
    const auto [low, high] = dihedralsOf(mesh, tet);
    return std::min(low, 180.0 - high);
}

MeshQuality qualityOf(const TetMesh& mesh, std::vector<TissueQuality> tissues, double edge)
{
    MeshQuality q;
    q.points = mesh.points.size();
    q.tets = mesh.tets.size();
    q.minDihedral = 180.0;
    q.worstRadii = 1.0;
    std::array<double, 256> volume{}, least{};
    std::array<std::size_t, 256> count{};
    least.fill(180.0);
    std::vector<double> leasts;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const auto [low, high] = dihedralsOf(mesh, t);
        const double six = sixVolumes(mesh, t);
        const std::uint8_t row = mesh.tissue[t];
        leasts.push_back(low);
        volume[row] += six / 6.0;
        least[row] = std::min(least[row], low);
        ++count[row];
        q.flipped += six > 0.0 ? 0U : 1U;
        q.under10 += low < small ? 1U : 0U;
        q.largestDihedral = std::max(q.largestDihedral, high);
        q.worstRadii = std::min(q.worstRadii, radiiOf(mesh, t));
        if (low < q.minDihedral) {
            q.minDihedral = low;
            q.worst = t;
        }
    }
    if (mesh.tets.empty()) {
        return q;
    }
    q.medianDihedral = base::upperMedian(std::move(leasts));
    for (const std::uint32_t p : mesh.tets[q.worst]) {
        q.worstAt += 0.25 * mesh.points[p];
    }
    countFaces(mesh, q);
    measureEdges(mesh, q);
    for (TissueQuality& tissue : tissues) {
        tissue.mesh = volume[tissue.row];
        tissue.tets = count[tissue.row];
        tissue.minDihedral = tissue.tets > 0 ? least[tissue.row] : 0.0;
        tissue.thin = tissue.thickness < edge;
    }
    q.tissues = std::move(tissues);
    return q;
}

}  // namespace palpate::reference
