#pragma once

#include <datasets/scene.h>
#include <haptics/session_model.h>
#include <volume/label_image.h>
#include <volume/tissue.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace palpate::studies {

/// A block of fat on bone with many stiff balls in it, none of which touches another: the many objects of the thesis as a
/// voxel volume. Whatever their number the balls fill a tenth of the block, so that more of them are smaller, and the block
/// as a whole stays as stiff as it is.
struct InclusionSpec {
    std::size_t inclusions = 100;
    int voxelsPerSide = 0;  // along the block's width; 0: as few as tell the balls apart, 64 at least
    std::uint64_t seed = 1;
};

inline constexpr double inclusionBlockSide = 64e-3;  // width, height and thickness [m]
inline constexpr double inclusionBase = 4e-3;        // thickness of the bone behind [m]
/// Voxels from one ball to the next, at least: three across, and one between.
inline constexpr int minPitch = 4;

/// The fewest voxels along the block's width that tell so many balls apart.
int voxelsFor(std::size_t inclusions) noexcept;

struct PlacedInclusion {
    Vec3 centre{0.0};   // middle of a voxel [m]
    double radius = 0;  // [m]
};

// Same spec, same block. All throw std::runtime_error where so many voxels cannot tell so many balls apart.

std::vector<PlacedInclusion> inclusionsOf(const InclusionSpec& spec);
/// Labels: 0 air, which is all around; 1 fat, 2 bone, 3 the balls. The front is at y = 0, its middle at the origin.
volume::LabelImage inclusionLabels(const InclusionSpec& spec);
std::shared_ptr<const volume::Tissue> inclusionTissue(const InclusionSpec& spec);

/// A 14 G needle before the middle of the block's front. Every ball is a vital structure: warnings and additional force.
/// The target is the bone.
datasets::Scene inclusionScene(const datasets::ModelSettings& settings);

}  // namespace palpate::studies
