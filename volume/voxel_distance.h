#pragma once

#include <volume/resample.h>

#include <cstdint>
#include <vector>

// Inside volume/ only: distances between voxels.
namespace palpate::volume {

/// Squared distance [m^2] of every voxel's centre to the nearest marked one's, infinite beyond `reach` [m], along one axis
/// after the other; the steps of the voxels must be orthogonal.
/// @param marked  not 0 for the voxels that distances are to (voxels x 1, x fastest)
/// Source: P. F. Felzenszwalb, D. P. Huttenlocher, "Distance Transforms of Sampled Functions", Theory of Computing 8, 2012;
/// the lower envelope of parabolas is found by trying all of them, for `reach` is a few voxels.
std::vector<float> squaredDistance(const VoxelGrid& grid, const std::vector<std::uint8_t>& marked, double reach);

}  // namespace palpate::volume
