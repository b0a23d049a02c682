#pragma once

#include <volume/geometry.h>
#include <volume/label_image.h>

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace palpate::volume {

/// Where voxels are: a size and an affine.
struct VoxelGrid {
    Index3 size{0};
    Affine affine;
};

/// Cubic voxels of `spacing` [m] that cover all of `of`, around the same middle. They lie along its voxel axes; where these
/// are sheared, along the orthogonal axes nearest to them.
VoxelGrid isotropicGrid(const VoxelGrid& of, double spacing);

/// What resampling made of one structure.
struct StructureChange {
    std::uint16_t value = 0;
    double before = 0;           // [m^3]
    double after = 0;            // [m^3]; 0: the structure is lost
    std::uint64_t regained = 0;  // voxels that it got by the rule for thin structures
    bool beside = false;         // its only voxel is one beside that which it fills most of
};

struct ResampledLabels {
    LabelImage image;
    std::vector<StructureChange> changes;  // by value, without value 0
};

/// A label map on another grid.
///
/// The fraction of each label in a new voxel is the mean over that voxel of the label's indicator, trilinear along axes
/// that the old voxels are not finer on; along those that they are finer on, it is the part of the new voxel that the old
/// ones overlap, exactly where both grids lie along the same axes. The label with the largest share wins; of equal shares
/// that of the structure with fewer voxels, so that the values of the labels decide nothing.
///
/// New voxels that the image's border cuts go on as they are inside, where both grids lie along the same axes; what is
/// further out is label 0.
///
/// Thin structures: one that so has lost over a tenth of its volume gets more voxels, those that it fills most of first,
/// until it has its volume again; the smallest structure is served first and keeps what it got. A sheet much thinner than
/// the new voxels therefore has gaps, but its volume. Others give what they have over nine tenths of their volume. Who has
/// no voxel takes one of any structure with more than one; if there is none in the voxels that it is in, one beside that
/// which it fills most of. A structure is lost only where all of these are the only ones of others.
/// Throws std::runtime_error where there is not one value for each voxel.
/// @param progress  called with the share done, from 0 to 1, from one thread; may be empty
ResampledLabels resampled(const LabelImage& image, const VoxelGrid& grid, const std::function<void(double)>& progress = {});

/// Trilinear values of an image on another grid, `outside` where that reaches beyond its voxels (count x 1).
/// @param values  on `of`, x fastest
/// Throws std::runtime_error where there is not one for each voxel.
std::vector<float> resampledImage(const VoxelGrid& of, std::span<const float> values, const VoxelGrid& grid, float outside);

}  // namespace palpate::volume
