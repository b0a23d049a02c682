#pragma once

#include <reference/smooth_labels.h>

#include <array>
#include <cstdint>
#include <vector>

namespace palpate::reference {

/// Row of the tissue table of every voxel in a box; 0 where it is none that is kept.
struct SoftVoxels {
    Index3 low{0}, size{0};         // of the box [voxels]
    std::vector<std::uint8_t> row;  // x fastest
    bool held = false;              // there is tissue that holds the body

    std::size_t offset(Index3 n) const noexcept { return base::offsetOf(size, n); }
};

/// The voxels of a volume that are kept, in the smallest box. Throws std::runtime_error where there are none.
SoftVoxels readVoxels(const volume::Tissue& tissue, Keep keep);

/// Leaves out the rear of a body that nothing holds. Returns the side where it ends now, as in SmoothLabels::flat. Throws
/// std::runtime_error where the body has one layer only.
int layOnItsBack(const volume::Affine& affine, SoftVoxels& voxels);

/// Which sides are flat: a round end has few voxels in its last layer, a plane as many as further in.
std::array<bool, 6> flatSides(const SoftVoxels& voxels);

}  // namespace palpate::reference
