#pragma once

#include <volume/geometry.h>

#include <vector>

namespace palpate::volume {

/// Scalar samples on a cubic grid, trilinear between nodes. Plain memory, so that the servo path can read it.
struct ScalarField {
    NodeGrid grid;              // where the values are
    std::vector<float> values;  // one per node

    /// Trilinear value at `p` [m]; points outside take the value at the nearest point of the border.
    double at(Vec3 p) const noexcept;

    /// Central difference of at() over one spacing, per metre. Smooth enough for a contact normal.
    Vec3 gradient(Vec3 p) const noexcept;
};

/// A signed distance [m], negative inside.
struct DistanceField : ScalarField {
    /// As ScalarField::at(). Outside of the grid it is the distance to the structure's nearest point, which follows from
    /// the border's values; where the structure reaches the border, to there.
    double distance(Vec3 p) const noexcept;

    /// From `p` to the grid, 0 inside [m]. Where the structure lies in the grid, no more than distance(), in a
    /// twentieth of its time there.
    double besideGrid(Vec3 p) const noexcept;

    /// Unit vector away from the structure; +z where the field is flat.
    Vec3 normal(Vec3 p) const noexcept;

private:
    Vec3 slopeAt(Vec3 p) const noexcept;
    // To `p` outside of the grid, from the structure's nearest point; `c` is the border's point that is nearest to `p`.
    Vec3 fromNearest(Vec3 p, Vec3 c) const noexcept;
};

}  // namespace palpate::volume
