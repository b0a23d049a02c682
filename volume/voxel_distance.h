#pragma once

#include <volume/resample.h>

#include <cstdint>
#include <vector>

// Inside volume/ only: distances between voxels.
namespace palpate::volume {

/// Squared distance [m^2] of every voxel's centre to the nearest marked one's, exact up to `reach` [m]; beyond, it is that,
/// more, or infinite. Along one axis after the other; the steps of the voxels must be orthogonal.
/// @param marked  not 0 for the voxels that distances are to (voxels x 1, x fastest)
/// @param reach   [m]; infinite is allowed
/// Source: P. F. Felzenszwalb, D. P. Huttenlocher, "Distance Transforms of Sampled Functions", Theory of Computing 8, 2012;
/// where `reach` is a few voxels, the lower envelope of parabolas is found by trying all of them.
std::vector<float> squaredDistance(const VoxelGrid& grid, const std::vector<std::uint8_t>& marked, double reach);

}  // namespace palpate::volume
