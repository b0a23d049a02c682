#pragma once

#include <volume/tissue_impl.h>

#include <cstdint>
#include <vector>

namespace palpate::volume {

/// Says where all voxels have one label, so that a field need not read each of them. A small array: a value for each block
/// of 4 x 4 x 4 voxels.
class LabelBlocks {
public:
    static constexpr int several = -1;

    /// Of the voxels of `box`, which lies in the volume. Reads each of them once, on all cores.
    LabelBlocks(const TissueData& tissue, const IndexBox& box);

    /// The label that all voxels of `box` have; `several` where that is not known: also near borders between labels, and
    /// where a part of `box` is outside of this one.
    int labelOf(const IndexBox& box) const noexcept;

private:
    IndexBox box_;                      // voxels
    Index3 first_;                      // block
    NodeGrid blocks_;                   // from the first one on, in steps of one
    std::vector<std::int32_t> labels_;  // of each block (blocks x 1)
};

}  // namespace palpate::volume
