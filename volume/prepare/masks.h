#pragma once

#include <volume/resample.h>

#include <cstdint>
#include <vector>

// Inside volume/ only: sets of voxels, and what mathematical morphology does with them. Source of the operations: J. Serra,
// "Image Analysis and Mathematical Morphology", Academic Press, 1982; balls by distances between voxel centres.
namespace palpate::prepare {

/// Not 0 for the voxels of the set (voxels x 1, x fastest).
using Mask = std::vector<std::uint8_t>;

/// A connected piece (faces) of a mask.
struct MaskPiece {
    std::uint64_t voxels = 0;
    double mean = 0;  // of the image over it
    double low = 0;   // fraction of its voxels whose image is below the `below` of piecesOf()
};

/// The pieces of a mask.
struct MaskPieces {
    std::vector<std::uint32_t> of;  // which piece each voxel is in, from 1; 0: none (voxels x 1)
    std::vector<MaskPiece> pieces;  // that of number n is pieces[n - 1]
};

/// @param image  may be empty: then mean and low are 0
MaskPieces piecesOf(const volume::VoxelGrid& grid, const Mask& mask, const std::vector<float>& image, float below = 0);

/// Voxels whose centre lies over `radius` [m] from that of any voxel outside the set; beyond the grid nothing is outside.
Mask eroded(const volume::VoxelGrid& grid, const Mask& mask, double radius);
/// Voxels whose centre lies no further than `radius` [m] from one of the set.
Mask dilated(const volume::VoxelGrid& grid, const Mask& mask, double radius);
/// The set and the voxels that share a face with it.
Mask touching(const volume::VoxelGrid& grid, const Mask& mask);
/// The set dilated, then eroded.
Mask closed(const volume::VoxelGrid& grid, const Mask& mask, double radius);

/// Mean of the image over the voxels no further than `reach` [m] along each axis.
std::vector<float> boxMeans(const volume::VoxelGrid& grid, const std::vector<float>& image, double reach);

/// The voxel axis nearest to the patient's long axis: slices across it are axial.
int axialAxis(const volume::Affine& affine) noexcept;

/// What is not in the set and hangs together with the border of its axial slice inside that slice. Slice by slice, so that
/// lungs cut by the first or last slice stay inside the body.
/// @param below  a region with less than half of its image below it is a lung that the field of view cuts: it stays inside
Mask outsideBySlices(const volume::VoxelGrid& grid, const Mask& mask, const std::vector<float>& image, float below);

/// Adds to the set what it encloses in an axial slice.
void fillHolesBySlices(const volume::VoxelGrid& grid, Mask& mask);

}  // namespace palpate::prepare
