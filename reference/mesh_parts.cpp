#include <reference/mesh_parts.h>

#include <base/mapped.h>
#include <reference/groups.h>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

namespace palpate::reference {

namespace {

constexpr double onSide = 1e-3;    // nearer to a flat side means on it [voxels]
constexpr double lookFrom = 0.25;  // how far before a face what lies behind it is looked for,
constexpr double lookUntil = 2.5;  // and where that ends [voxels]
constexpr double flat = 1e-5;      // six volumes of a tetrahedron by the cube of an edge: less is none

// Whether the first that is not soft before a face holds the body.
bool looksAtHeld(const volume::Tissue& tissue, const volume::Tissue::Reader& reader, Vec3 centre, Vec3 step)
{
    const auto& rows = tissue.table().rows;
    for (double t = lookFrom; t <= lookUntil; t += lookFrom) {
        const auto& row = rows[reader.tissue(centre + t * step)];
        if (isHeld(row)) {
            return true;
        }
        if (row.role == volume::Role::air) {
            return false;
        }
    }
    return false;
}

// Place of a side along its axis [voxels].
double placeOf(const SmoothLabels& labels, int side)
{
    return labels.low[side / 2] - 0.5 + (side % 2 == 0 ? 0 : labels.size[side / 2]);
}

}  // namespace

std::vector<SortedFace> sortedFaces(const TetMesh& mesh)
{
    std::vector<SortedFace> faces;
    faces.reserve(4 * mesh.tets.size());
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        for (std::uint8_t side = 0; side < 4; ++side) {
            SortedFace f{{}, static_cast<std::uint32_t>(t), side};
            for (std::size_t i = 0; i < 3; ++i) {
                f.key[i] = mesh.tets[t][faceCorners[side][i]];
            }
            std::ranges::sort(f.key);
            faces.push_back(f);
        }
    }
    std::ranges::sort(
        faces, [](const SortedFace& a, const SortedFace& b) { return std::tie(a.key, a.tet) < std::tie(b.key, b.tet); });
    return faces;
}

double sixVolumes(const TetMesh& mesh, std::size_t tet) noexcept
{
    return sixVolumes(mesh, mesh.tets[tet]);
}

double sixVolumes(const TetMesh& mesh, const std::array<std::uint32_t, 4>& t) noexcept
{
    const Vec3 a = mesh.points[t[0]];
    return glm::determinant(Mat3(mesh.points[t[1]] - a, mesh.points[t[2]] - a, mesh.points[t[3]] - a));
}

std::vector<double> volumesOf(const TetMesh& mesh, std::span<const std::uint8_t> rows)
{
    std::array<double, 256> volume{};
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        volume[mesh.tissue[t]] += sixVolumes(mesh, t) / 6.0;
    }
    return base::mapped<double>(rows, [&](const std::uint8_t row) { return volume[row]; });
}

std::uint32_t UsedPoints::operator()(std::uint32_t p)
{
    if (to_[p] == unused) {
        to_[p] = static_cast<std::uint32_t>(points.size());
        points.push_back(all_[p]);
    }
    return to_[p];
}

void dropUnusedPoints(TetMesh& mesh)
{
    UsedPoints used(mesh.points);
    for (auto& tet : mesh.tets) {
        std::ranges::transform(tet, tet.begin(), std::ref(used));
    }
    mesh.points = std::move(used.points);
}

double keepLargestPiece(TetMesh& mesh)
{
    Groups pieces(mesh.tets.size());
    const auto faces = sortedFaces(mesh);
    for (std::size_t i = 1; i < faces.size(); ++i) {
        if (faces[i].key == faces[i - 1].key) {
            pieces.join(faces[i].tet, faces[i - 1].tet);
        }
    }
    std::vector<double> volume(mesh.tets.size(), 0.0);
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        volume[pieces.root(static_cast<std::uint32_t>(t))] += sixVolumes(mesh, t) / 6.0;
    }
    const auto largest = static_cast<std::uint32_t>(std::max_element(volume.begin(), volume.end()) - volume.begin());
    TetMesh kept;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        if (pieces.root(static_cast<std::uint32_t>(t)) == largest) {
            kept.tets.push_back(mesh.tets[t]);
            kept.tissue.push_back(mesh.tissue[t]);
        }
    }
    kept.points = std::move(mesh.points);
    mesh = std::move(kept);
    dropUnusedPoints(mesh);
    return std::accumulate(volume.begin(), volume.end(), 0.0) - volume[largest];
}

void snapToSides(const SmoothLabels& labels, TetMesh& mesh)
{
    for (Vec3& p : mesh.points) {
        Vec3 index = labels.affine.toIndex(p);
        bool moved = false;
        for (int side = 0; side < 6; ++side) {
            const int axis = side / 2;
            const double at = placeOf(labels, side);
            if (labels.flat[static_cast<std::size_t>(side)] && std::abs(index[axis] - at) < onSide) {
                index[axis] = at;
                moved = true;
            }
        }
        p = moved ? labels.affine.toPatient(index) : p;
    }
    // What had all four corners on a side is flat now.
    std::size_t kept = 0;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const double edge = glm::distance(mesh.points[mesh.tets[t][0]], mesh.points[mesh.tets[t][1]]);
        if (sixVolumes(mesh, t) > flat * edge * edge * edge) {
            mesh.tets[kept] = mesh.tets[t];
            mesh.tissue[kept++] = mesh.tissue[t];
        }
    }
    mesh.tets.resize(kept);
    mesh.tissue.resize(kept);
}

void addFaces(const volume::Tissue& tissue, const SmoothLabels& labels, TetMesh& mesh)
{
    const volume::Tissue::Reader reader(tissue);
    const Vec3 spacing = labels.affine.spacing();
    const double voxel = std::max({spacing.x, spacing.y, spacing.z});
    const auto faces = sortedFaces(mesh);
    mesh.faces.clear();
    for (std::size_t i = 0; i < faces.size(); ++i) {
        const bool shared =
            (i > 0 && faces[i].key == faces[i - 1].key) || (i + 1 < faces.size() && faces[i].key == faces[i + 1].key);
        if (shared) {
            continue;
        }
        TetMesh::Face face;
        face.tet = faces[i].tet;
        std::array<Vec3, 3> p;
        for (std::size_t c = 0; c < 3; ++c) {
            face.points[c] = mesh.tets[face.tet][faceCorners[faces[i].side][c]];
            p[c] = mesh.points[face.points[c]];
        }
        const Vec3 centre = (p[0] + p[1] + p[2]) / 3.0;
        const Vec3 normal = glm::normalize(glm::cross(p[1] - p[0], p[2] - p[0]));
        const int side = labels.heldSide;
        const bool onHeldSide =
            side >= 0 && std::abs(labels.affine.toIndex(centre)[side / 2] - placeOf(labels, side)) < onSide;
        face.held = onHeldSide || looksAtHeld(tissue, reader, centre, voxel * normal);
        mesh.faces.push_back(face);
    }
}

}  // namespace palpate::reference
