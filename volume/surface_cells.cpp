#include <volume/surface_cells.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace palpate::volume {

SurfaceCells::SurfaceCells(const DistanceField& surface, const NodeGrid& cells, const Affine& voxels)
    : surface_(surface), voxels_(voxels.linear), edge_(cells.spacing)
{
    const Vec3 voxel = voxels.spacing();
    noise_ = std::min(0.3 * std::max({voxel.x, voxel.y, voxel.z}) / edge_, 0.5);
    leastNoise_ = std::min(0.3 * std::min({voxel.x, voxel.y, voxel.z}) / edge_, 0.5);
}

double SurfaceCells::behind(Vec3 middle) const
{
    constexpr int side = 4;
    const double part = edge_ / side;
    double sum = 0.0;
    forEachIndex(Index3(0), Index3(side - 1), [&](Index3 n) {
        const Vec3 at = middle + part * (Vec3(n) + 0.5 - 0.5 * side);
        sum += std::clamp(0.5 - surface_.at(at) / part, 0.0, 1.0);
    });
    return sum / (side * side * side);
}

bool SurfaceCells::isThickAt(Vec3 middle, double distance) const
{
    constexpr double inside = 0.9, deep = 0.75;  // of a voxel
    const Vec3 n = surface_.normal(middle);
    const double voxel = glm::dot(glm::abs(n * voxels_), Vec3(1.0));
    return surface_.at(middle - (distance + inside * voxel) * n) < -deep * voxel;
}

}  // namespace palpate::volume
