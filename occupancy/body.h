#pragma once

#include <occupancy/occupancy_map.h>
#include <volume/scalar_field.h>

#include <cstdint>
#include <span>

namespace palpate::occupancy {

/// A deformed body, as the queries see it. Views only: whoever deforms owns the memory.
struct Body {
    const volume::NodeGrid& grid;          // of the elements at rest
    std::span<const std::uint8_t> solid;   // not 0 where there is an element      (count x 1)
    std::span<const Vec3f> u;              // displacement of each element [m]     (count x 3)
    const OccupancyMap& map;               // where the displaced elements are
    const volume::DistanceField& surface;  // signed distance to the surface at rest [m]

    Vec3 restPosition(Element e) const noexcept { return grid.position(grid.node(e)); }
    Vec3 position(Element e) const noexcept { return restPosition(e) + Vec3(u[e]); }
};

/// Positions at rest, for elements visited one after the other: most lie in the same row of the grid as the one before, and
/// then nothing is divided.
class RestPositions {
public:
    explicit RestPositions(const volume::NodeGrid& grid) noexcept
        : grid_(grid), nx_(static_cast<Element>(grid.size.x)), row_(grid.origin)
    {
    }

    /// As Body::restPosition(e), to the bit [m].
    Vec3 operator()(Element e) noexcept
    {
        if (e - first_ >= nx_) {
            const auto ny = static_cast<Element>(grid_.size.y);
            const Element row = e / nx_;
            first_ = row * nx_;
            row_ = grid_.position({0, static_cast<int>(row % ny), static_cast<int>(row / ny)});
        }
        return {grid_.origin.x + grid_.spacing * static_cast<double>(e - first_), row_.y, row_.z};
    }

private:
    const volume::NodeGrid& grid_;
    Element nx_;
    Element first_ = 0;  // of the row
    Vec3 row_;           // where that is [m]
};

/// Displacement of the material that is at `rest` when undeformed [m]: trilinear over the elements around it, those that
/// are not there left out; zero where there is none.
Vec3 displacementAt(const Body& body, Vec3 rest) noexcept;

/// The undeformed place of what is at `p` now [m]: solves X + u(X) = p by fixed-point steps, started at the nearest element
/// that the occupancy map finds, so that displacements of many elements are followed. Off the tissue, as far as there are
/// elements within about one of it, and in a dent, space is displaced as the tissue next to it; farther out X is p.
Vec3 restPoint(const Body& body, Vec3 p) noexcept;

/// As restPoint(), with as many steps as it takes (at most 60) until X + u(X) is within a thousandth of an element from
/// `p`: six leave some tenths of an element over in steep dimples. For exports and pictures, not for the servo path.
Vec3 exactRestPoint(const Body& body, Vec3 p) noexcept;

/// Signed distance from `p` to the deformed surface, to first order: the distance at rest of restPoint(p) [m].
double distance(const Body& body, Vec3 p) noexcept;

/// Differences of distance() over `h` [m] to both sides of `p` along each axis [m]: 2 h times its gradient. Costs much less
/// than six calls of distance().
Vec3 distanceDifference(const Body& body, Vec3 p, double h) noexcept;

}  // namespace palpate::occupancy
