#pragma once

#include <reference/smooth_labels.h>
#include <reference/tet_mesh.h>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate::reference {

/// Corners of the face across from each corner, counterclockwise seen from outside.
inline constexpr std::array<std::array<std::size_t, 3>, 4> faceCorners{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

/// A face of a tetrahedron.
struct SortedFace {
    std::array<std::uint32_t, 3> key{};  // points in order
    std::uint32_t tet = 0;
    std::uint8_t side = 0;  // corner across from it
};
/// All faces, by key and then by tetrahedron: those that are shared follow each other (4 tets x 1).
std::vector<SortedFace> sortedFaces(const TetMesh& mesh);

/// Six times the volume of a tetrahedron, positive when its points turn the right way [m^3].
double sixVolumes(const TetMesh& mesh, std::size_t tet) noexcept;
double sixVolumes(const TetMesh& mesh, const std::array<std::uint32_t, 4>& tet) noexcept;
/// Volume of each tissue [m^3] (rows x 1).
std::vector<double> volumesOf(const TetMesh& mesh, std::span<const std::uint8_t> rows);

/// Numbers points anew, those that are asked for only, in the order of their first use.
class UsedPoints {
public:
    /// @param all  must outlive this
    explicit UsedPoints(const std::vector<Vec3>& all) : all_(all), to_(all.size(), unused) {}

    std::uint32_t operator()(std::uint32_t p);  // number in `points` of one of all

    std::vector<Vec3> points;  // used so far [m]

private:
    static constexpr std::uint32_t unused = ~0U;
    const std::vector<Vec3>& all_;
    std::vector<std::uint32_t> to_;  // (all x 1)
};

/// Leaves the points that tetrahedra have, in the order of their first use.
void dropUnusedPoints(TetMesh& mesh);
/// Leaves the largest piece that hangs together by faces, and the points that it has. Returns the volume left out [m^3].
double keepLargestPiece(TetMesh& mesh);
/// Puts the points that lie on a flat side, but for rounding, exactly there, and takes tetrahedra away that have no volume
/// then.
void snapToSides(const SmoothLabels& labels, TetMesh& mesh);
/// Finds the faces on the outside, and which are held: those that look at bone or fixed tissue first.
void addFaces(const volume::Tissue& tissue, const SmoothLabels& labels, TetMesh& mesh);

}  // namespace palpate::reference
