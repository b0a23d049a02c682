#pragma once

#include <base/cells.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <algorithm>
#include <cstddef>

namespace palpate {

/// Patient frame LPS (x to the patient's left, y to the back, z to the head), as in ITK and DICOM [m], unless said
/// otherwise.
using Vec3 = glm::dvec3;
using Vec3f = glm::vec3;
using Mat3 = glm::dmat3;
using Index3 = glm::ivec3;

namespace volume {

/// Axis-aligned box in the patient frame [m].
struct Box {
    Vec3 low{0.0};   // the corner with the smallest coordinates
    Vec3 high{0.0};  // that with the largest
};

/// Voxel index to patient frame: patient = linear * index + origin. Oblique and left-handed directions are kept.
/// Integer indices are voxel centres.
struct Affine {
    Mat3 linear{1.0};  // column k is the step along voxel axis k [m]
    Vec3 origin{0.0};  // centre of voxel (0, 0, 0) [m]

    Vec3 toPatient(Vec3 index) const noexcept { return linear * index + origin; }  // place of a voxel index [m]
    Vec3 toIndex(Vec3 patient) const noexcept;                                     // the reverse, of a place [m]
    /// Edge lengths of a voxel [m].
    Vec3 spacing() const noexcept;
    /// Volume of a voxel [m^3], positive also for left-handed directions.
    double voxelVolume() const noexcept;
};

/// A plane on which a body rests: what lies behind it is held in space.
struct Support {
    Vec3 point{0.0};   // on it [m]
    Vec3 normal{0.0};  // unit vector to where the body is free

    double height(Vec3 p) const noexcept { return glm::dot(p - point, normal); }  // above it [m]
};

/// A cubic grid of nodes aligned with the patient axes; x runs fastest.
///
///     position(i, j, k) = origin + spacing * (i, j, k)
struct NodeGrid {
    Index3 size{0};      // nodes along each axis
    Vec3 origin{0.0};    // position of node (0, 0, 0) [m]
    double spacing = 0;  // [m]

    /// How many nodes.
    std::size_t count() const noexcept { return base::countOf(size); }
    /// Of a node in arrays over the grid.
    std::size_t offset(Index3 n) const noexcept { return base::offsetOf(size, n); }
    Index3 node(std::size_t offset) const noexcept { return base::cellOf(size, offset); }  // the reverse of offset()
    Vec3 position(Index3 n) const noexcept { return origin + spacing * Vec3(n); }          // of a node [m]
    /// The lowest node of the cell that a place lies in, which may be outside of the grid.
    Index3 cellAt(Vec3 at) const noexcept { return Index3(glm::floor((at - origin) / spacing)); }
    /// Whether there is such a node.
    bool contains(Index3 n) const noexcept { return base::holds(size, n); }
    /// From the first node to the last [m].
    Box box() const noexcept { return {origin, position(size - Index3(1))}; }
};

/// Of the components of a vector that with the largest amount; of equal ones the first.
inline int longestAxis(Vec3 v) noexcept
{
    const Vec3 size = glm::abs(v);
    return size.z > std::max(size.x, size.y) ? 2 : size.y > size.x ? 1 : 0;
}

/// Calls visit(index) for every index from `first` to `last`, both included, x fastest.
template <typename Visit>
void forEachIndex(Index3 first, Index3 last, Visit&& visit)
{
    for (int k = first.z; k <= last.z; ++k) {
        for (int j = first.y; j <= last.y; ++j) {
            for (int i = first.x; i <= last.x; ++i) {
                visit(Index3(i, j, k));
            }
        }
    }
}

/// The grid with nodes `spacing` [m] apart that covers `box` and `margin` [m] around it. Nodes lie at half-odd multiples of
/// the spacing, whatever the box: the same body gets the same nodes at any resolution of its voxels, and faces through the
/// origin lie between nodes.
NodeGrid coveringGrid(const Box& box, double spacing, double margin);

/// The smallest spacing, not under `wanted` [m], with which a covering grid of `box` has at most `maxNodes` nodes.
double affordableSpacing(const Box& box, double wanted, double margin, std::size_t maxNodes);

/// The covering grid of `box` with that spacing and two of them around it.
NodeGrid affordableGrid(const Box& box, double wanted, std::size_t maxNodes);

}  // namespace volume
}  // namespace palpate
