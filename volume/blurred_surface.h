#pragma once

#include <volume/geometry.h>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

// Inside volume/ only: the surface of a structure from the fractions of cells that it fills.
namespace palpate::volume {

/// A point on a surface and the unit normal there, in node units; a zero normal means "unknown".
struct SurfacePoint {
    Vec3f at{0.0F};
    Vec3f normal{0.0F};
};

/// What spreads the edge of a structure over neighbouring cells, along each axis of the grid. In spacings.
struct Blur {
    Vec3 box{1.0};     // width of a box with the variance of a cell's samples and of the voxels that they read
    Vec3 face{1.0};    // the same for a plane along the faces of voxels, which has no steps of voxels
    Index3 passes{1};  // of [1 2 1] / 4
    double voxel = 0;  // longest edge of a voxel: how far steps of voxels are to be smoothed
    /// Mean over the axes [spacings^2].
    double variance() const noexcept;
};

/// Depth of a plane under the middle of a cell, from the blurred fraction of the cell that is behind the plane.
///
/// Along the plane's normal n the blur is a sum of independent boxes and steps. Its distribution is computed for directions
/// that are even in (n_x^2, n_y^2), in which its variance is linear; between them depths are interpolated.
class PlaneDepth {
public:
    explicit PlaneDepth(const Blur& blur);
    /// Depth of the middle below the plane, negative above it [spacings].
    /// @param fraction  0 to 1; beyond `lowest` and 1 - `lowest` as there
    /// @param normal    unit vector
    float at(float fraction, Vec3f normal) const noexcept;

    static constexpr float lowest = 1.0F / 256.0F;

private:
    static constexpr int directions = 16;  // steps along each side of the triangle of directions
    static constexpr int bins = 127;       // of fractions from 0.5 to 1 - lowest
    using Curve = std::array<float, bins + 1>;
    const Curve& curve(int i, int j) const noexcept;
    std::vector<Curve> curves_;
};

/// The surface from blurred fractions, as points near the nodes that are next to it.
struct BlurredSurface {
    std::vector<std::uint32_t> nodes;  // ascending
    std::vector<SurfacePoint> points;  // of `nodes`, where the blur has left the surface
    std::vector<float> back;           // way of each along its normal to where it was before the blur [spacings]
    double shell = 0;                  // volume that all of it adds, about [spacings^3]
};

/// Points are exact on planes. On curved surfaces `back` is what blurring and trilinear interpolation between nodes have
/// moved them, to first order in the curvature. Steps of voxels are smoothed by paraboloids through the points around each;
/// their width follows the size of the voxels and the surface's radius. Surfaces nearer to each other than the blur is wide
/// are not resolved.
/// @param fraction  of each node's cell (count x 1)
BlurredSurface blurredSurface(const NodeGrid& grid, std::span<const float> fraction, const Blur& blur);

}  // namespace palpate::volume
