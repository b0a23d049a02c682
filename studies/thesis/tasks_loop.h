#pragma once

#include <haptics/dffb.h>
#include <studies/thesis/tasks_scene.h>

#include <array>
#include <cstddef>
#include <utility>
#include <vector>

namespace palpate::studies {

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
