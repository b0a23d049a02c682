#pragma once

#include <volume/tissue.h>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate::reference {

/// Soft tissues of a volume as regions with smooth borders: what a mesh is made of, without the staircase of the voxels.
///
/// Each tissue has the share that it has of every voxel, blurred by a Gaussian of one voxel, and trilinear between voxels.
/// A point is inside the body where the shares of all soft tissue add up to half or more, and belongs to the tissue with
/// the largest share after a bias of each; the biases keep the volumes that the voxels have. Where the body ends in a plane
/// across a voxel axis, as phantoms and cropped scans do, the voxels are mirrored in that plane, and the body is cut by it:
/// faces stay exactly where they are, and the edges between them sharp.
///
///     shares  sample (i, j, k) is the voxel low + (i, j, k); x runs fastest, then y, then z; of each sample the regions
///             that are there, in order
struct SmoothLabels {
    struct Share {
        std::uint8_t region = 0;     // in `rows`
        std::uint16_t fraction = 0;  // of 65535
    };

    volume::Affine affine;           // of the voxels
    Index3 low{0};                   // voxel of sample (0, 0, 0)
    Index3 size{0};                  // samples along each axis
    std::array<bool, 6> flat{};      // sides -i +i -j +j -k +k: the body ends half a voxel beyond the samples
    std::vector<std::uint8_t> rows;  // of the tissue table: soft ones that are there   (rows x 1)
    std::vector<std::size_t> first;  // of each sample, in `shares`                     (samples + 1)
    std::vector<Share> fractions;
    std::vector<double> bias;    // of each row's share                             (rows x 1)
    double bodyBias = 0;         // of all shares together
    int largest = 0;             // region with the most volume: others fill their place with it at last
    std::vector<double> volume;  // of the voxels [m^3]                             (rows x 1)
    int heldSide = -1;           // of the six: where a body that nothing holds is held; -1 none

    // Where a region is one of its own: within this of a line [m] (rows x 1; empty: everywhere). Beyond, its neighbours
    // fill its place.
    std::vector<double> within;
    Vec3 from{0.0}, to{0.0};  // ends of the line [m]

    std::size_t offset(Index3 n) const noexcept { return base::offsetOf(size, n); }
    std::size_t samples() const noexcept { return offset({0, 0, size.z}); }
    std::span<const Share> at(std::size_t sample) const noexcept
    {
        return {fractions.data() + first[sample], first[sample + 1] - first[sample]};
    }
};

/// Which tissues are regions: those that deform, or all but air.
enum class Keep : std::uint8_t { soft, all };

/// Soft is what is neither air, nor bone, nor fixed. A body of which nothing is fixed lies on its back, as in
/// volume::Tissue::support(): its rear 5 %, in whole layers of voxels and at least one, are left out, and it is held there.
/// With Keep::all everything but air is a region, and nothing is left out.
/// Throws std::runtime_error where there is no such tissue, or where a body that nothing holds has one layer only.
SmoothLabels smoothLabels(const volume::Tissue& tissue, Keep keep = Keep::soft);

/// Chooses the biases so that the regions have these volumes [m^3] (rows x 1).
void fitVolumes(SmoothLabels& labels, std::span<const double> wanted);

/// Where a voxel is looked into to count volumes, from its centre [voxels]: one point in each eighth of it. From voxel to
/// voxel they differ, so that those of a flat layer lie at all depths: else thin plates would get a volume in steps.
/// @param n       sample of SmoothLabels
/// @param eighth  bit a: in the upper half along axis a
Vec3 countedAt(Index3 n, int eighth) noexcept;

/// Which of SmoothLabels::rows a point [m] belongs to; -1 outside.
int regionAt(const SmoothLabels& labels, Vec3 p) noexcept;
/// Distance from a point to a line from one point to another [m].
double distanceToLine(Vec3 p, Vec3 from, Vec3 to) noexcept;

/// Whether a tissue stays where it is and so is no part of the mesh.
bool isHeld(const volume::TissueRow& row) noexcept;

}  // namespace palpate::reference
