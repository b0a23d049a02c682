#pragma once

#include <datasets/scene.h>
#include <haptics/dffb.h>
#include <haptics/session_model.h>
#include <volume/label_image.h>
#include <volume/tissue.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
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

/// The haptic scene of the thesis: spheres that do not overlap, and in every tick every one of them is asked whether the
/// tip is in it. The baseline whose time grows with their number.
///
/// The servo loop of a scene graph goes over its nodes and tests the tip against each; nothing says beforehand which are
/// near. This is the leanest such loop: one array of centres and radii, no transforms, no virtual calls. GHOST's took 1 us
/// per object and tick on a 300 MHz Pentium, and a bare driver's a quarter of that.
class ObjectScene {
public:
    /// @param stiffness  K of equation 2, of every object [N/m]
    ObjectScene(std::vector<PlacedInclusion> objects, double stiffness)
        : objects_(std::move(objects)), stiffness_(stiffness)
    {
    }

    static constexpr std::size_t none = static_cast<std::size_t>(-1);
    static constexpr std::size_t monitored = 4;  // objects that the thesis has in the monitored scene at any instant

    /// H3: the object in which the tip is deepest, or none. Cost O(objects).
    std::size_t collide(Vec3 tip) const noexcept;
    /// H4: K d out of the object (equation 2); no force for `none` [N].
    Vec3 feedback(std::size_t object, Vec3 tip) const noexcept;
    /// H6: how near the first of the lookup table are.
    std::array<haptics::Proximity, haptics::maxStructures> monitor(Vec3 tip) const noexcept;

    const std::vector<PlacedInclusion>& objects() const noexcept { return objects_; }

private:
    std::vector<PlacedInclusion> objects_;
    double stiffness_;
};

}  // namespace palpate::studies
