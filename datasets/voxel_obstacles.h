#pragma once

#include <volume/tissue.h>

#include <cstddef>
#include <vector>

namespace palpate::datasets {

/// The voxels of some labels, made ready to be asked how near a needle comes to them.
class VoxelObstacles {
public:
    /// Cost O(voxels), and memory for a copy of the labels until it is made; it keeps nothing of the tissue.
    /// @param tissue    whose voxels they are
    /// @param obstacle  not 0 for the labels that count (65536 x 1)
    VoxelObstacles(const volume::Tissue& tissue, const std::vector<char>& obstacle);

    /// Distance from the segment to the nearest of these voxels, each a whole box, 0 inside of one; `most` where it is more
    /// [m]. Exact where the axes of the voxels are at right angles; else a voxel is the box around it, and the distance
    /// never too large. Cost O(surface voxels / 50), and of those within `most`.
    double distance(Vec3 from, Vec3 to, double most) const noexcept;

private:
    struct Block {
        Vec3 centre{0.0};  // own frame [m]
        double radius = 0;
        std::size_t first = 0, count = 0;  // of voxels_
    };
    void addLayer(const volume::LabelImage& labels, const std::vector<char>& obstacle, int z, std::vector<Block>& blocks,
                  std::vector<Vec3>& voxels) const;
    Vec3 own(Vec3 p) const noexcept { return p * frame_; }

    volume::Affine affine_;
    Mat3 frame_{1.0};  // its columns: the voxels' axes, made orthogonal
    Vec3 half_{0.0};   // extent of a voxel along each [m]
    std::vector<Block> blocks_;
    std::vector<Vec3> voxels_;  // centres of those at a surface, own frame [m]
};

}  // namespace palpate::datasets
