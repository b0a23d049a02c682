#pragma once

#include <channel/layout.h>

#include <glm/vec3.hpp>

#include <cstdint>
#include <span>
#include <vector>

namespace palpate::render {

/// How far a ray may leap through the volume at rest without missing a border: per block of 2 x 2 x 2 voxels the distance
/// to the nearest block in which the label is not the same everywhere, counted in blocks along the axis where it is
/// largest (Chebyshev). 0: that block itself.
struct LeapGrid {
    static constexpr int side = 2;                            // of a block [voxels]
    static constexpr std::uint8_t airBit = 0x80, most = 127;  // nothing to see in the whole block; the longest distance

    glm::ivec3 size{0};
    std::vector<std::uint8_t> blocks;  // distance and airBit, x fastest
};

/// `labels`: per voxel of `grid`, x fastest; only channel::rowBits and channel::shellBit count. A block counts as mixed
/// also where its neighbouring voxels differ, which a sampler blends in. Cost O(voxels).
/// Source: G. Borgefors, "Distance Transformations in Digital Images", Computer Vision, Graphics, and Image Processing 34,
/// 1986: the chessboard distance, exact in two passes.
LeapGrid leapGrid(const channel::Grid& grid, std::span<const std::uint8_t> labels);

}  // namespace palpate::render
