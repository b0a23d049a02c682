#pragma once

#include <volume/prepare/masks.h>

#include <vector>

// Inside volume/ only: bone in a CT.
namespace palpate::prepare {

/// CT number from which a voxel is bone more often than not [HU]. Half of a voxel at a bone's face is bone, and a shell of
/// a millimetre fills little of a large voxel: 150 HU for voxels of a millimetre, 125 HU for those of 3 mm and more.
float boneThreshold(const volume::VoxelGrid& grid);

/// For each voxel the fraction of 26 rays, along axes and diagonals, that meet the mask no further than `reach` [m] away.
/// Rays that leave the grid before are not counted, up to nine of them: so many leave at a face of the grid.
std::vector<float> enclosure(const volume::VoxelGrid& grid, const Mask& mask, double reach);

/// Bone among the voxels `may`: what attenuates as bone does and hangs together with something that can be nothing else,
/// and marrow, dark or bright, which walls of bone surround on nearly all sides. What is near the limit goes with its
/// neighbours.
///
/// @param hu    the CT [HU] (voxels x 1)
/// @param known bone that is there already: it surrounds marrow too, and is never in the result
Mask findBone(const volume::VoxelGrid& grid, const std::vector<float>& hu, const Mask& may, const Mask& known);

}  // namespace palpate::prepare
