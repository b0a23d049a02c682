#pragma once

#include <volume/label_image.h>

namespace palpate::volume {

inline constexpr double minSpacing = 0.999e-6;  // of voxels: below a cell, and units were mistaken [m]
inline constexpr double maxSpacing = 10.0;      // [m]
inline constexpr double farthestPlace = 10.0;   // from the origin of the patient frame: no pose is farther away [m]
inline constexpr double maxShear = 2e-3;        // cosine between voxel axes; beyond, labels have to be resampled

/// Largest departure of two voxel axes from a right angle [rad].
double shearOf(const Affine& affine) noexcept;

/// Throws std::runtime_error for voxels that can be of no body: none of them, places that are not finite or beyond
/// farthestPlace, and voxels without volume or of no patient's size. Axes may be sheared.
void checkGrid(Index3 size, const Affine& affine);

/// The same for a label map, and for one with another number of values.
void checkImage(const LabelImage& image);

}  // namespace palpate::volume
