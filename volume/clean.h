#pragma once

#include <volume/label_image.h>

#include <cstdint>
#include <vector>

namespace palpate::volume {

/// Voxels that a cleaning step took from one label.
struct Relabelled {
    std::uint16_t value = 0;  // the label that they had
    std::uint64_t voxels = 0;
    std::uint64_t pieces = 0;  // of the label, where the step works on pieces
};

/// Keeps the largest piece (joined by faces) of every label that is marked in `wanted` (65536 x 1); of pieces of one size
/// the first in memory. Each other piece gets the label that most of the faces around it have (of labels that have as
/// many: the smallest value); a piece around it that is itself loose counts with the label that it gets. Every marked label
/// is one piece then.
std::vector<Relabelled> keepLargestPieces(LabelImage& image, const std::vector<std::uint8_t>& wanted);

/// What the skin's steps need to know of labels (65536 x 1 each).
struct SkinLabels {
    std::vector<std::uint8_t> air;  // not 0: no tissue
    std::uint16_t skin = 0;         // the label to give
    std::vector<std::uint8_t> isSkin;
};

struct ClosedHoles {
    std::vector<Relabelled> taken;  // from which tissue
    std::uint64_t closed = 0;       // holes
    std::uint64_t left = 0;         // holes that are larger
    double largestLeft = 0;         // across [m]
    double thickness = 0;           // of the skin on the mean, and of what closes the holes [m]
};

/// Closes holes in the skin: patches of other tissue that have a face to the outside. Those no larger than `across` [m]
/// (diagonal of the box around them) and what lies under them become skin, as deep as the skin is thick on the mean (the
/// distance of its innermost voxels to the outside, to the nearest layer of voxels), one voxel at least. The outside is the
/// air that reaches the border of the volume; the border itself is a cut, no surface.
ClosedHoles closeSkinHoles(LabelImage& image, const SkinLabels& labels, double across);

/// What addSkin() did.
struct AddedSkin {
    std::vector<Relabelled> taken;  // from which tissue
    double thickness = 0;           // of all skin on the mean [m]; 0 where no other tissue is under it
};

/// Makes the outermost `thickness` [m] of tissue skin: every voxel of tissue whose centre is no further than that from the
/// centre of an outside voxel, and every one with a face to the outside. So it is as many whole voxels thick as
/// `thickness` holds, one at least. The body keeps its size.
AddedSkin addSkin(LabelImage& image, const SkinLabels& labels, double thickness);

/// The voxels from `low` to `high`, both included.
LabelImage cropped(const LabelImage& image, Index3 low, Index3 high);

/// `by` voxels of label 0 more on every side.
LabelImage padded(const LabelImage& image, Index3 by);

}  // namespace palpate::volume
