#pragma once

#include <volume/geometry.h>

#include <cstdint>
#include <span>
#include <vector>

// Inside volume/ only.
namespace palpate::volume {

/// Parts of a structure that are a voxel thick, such as a flap, or a wall between air and air. The blur of blurredSurface()
/// leaves nothing of them.
struct ThinParts {
    std::vector<std::uint8_t> around;  // 1 at their nodes and those next to them (nodes x 1); empty where there are none
    std::vector<float> rest;           // of each node's cell without them (nodes x 1); empty where there are none
    double voxel = 0;                  // longest edge [spacings]
};

/// A node is of such a part if its cell is more than half full, and the blur leaves no cell within a voxel more than 0.6
/// full. 64 of them must touch: fewer are noise of a segmentation.
///
/// @param fraction  of each node's cell (nodes x 1)
/// @param blurred   the same, smoothed
/// @param voxel     longest edge [spacings]; parts thinner than a spacing are not found, or with holes
ThinParts thinParts(const NodeGrid& grid, std::span<const float> fraction, std::span<const float> blurred, double voxel);

/// Adds them to the signed distance of the rest [m] (nodes x 1). Their surface is where the fraction is a half, which is
/// the face of the voxels where it lies along these.
void addThinParts(const NodeGrid& grid, std::span<const float> fraction, const ThinParts& thin,
                  std::vector<float>& distance);

}  // namespace palpate::volume
