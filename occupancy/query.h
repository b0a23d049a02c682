#pragma once

#include <occupancy/body.h>
#include <occupancy/tool_shape.h>

#include <array>
#include <cstddef>

namespace palpate::occupancy {

/// What a tool touches. Fixed size: the servo path allocates nothing.
struct ContactSet {
    static constexpr std::size_t capacity = 1024;
    std::array<Element, capacity> elements;  // whose middles are within the tool, widened by half an element (count x 1)
    std::size_t count = 0;                   // further ones are left out
    double depth = 0;  // of the tool's deepest point below the body's surface [m]; negative: clearance
};

/// Fills `out` with the elements that the tool touches, and with the depth from the distance field.
/// Cost O(cells in the tool's box); allocates nothing.
void touch(const Body& body, const Capsule& tool, ContactSet& out) noexcept;

/// How far a tool gets on its way.
struct Sweep {
    double fraction = 1;  // of the way, up to the first touch or to the end
    bool hit = false;
    Vec3 point{0.0};  // of the tool's axis that touches [m]
    Vec3 front{0.0};  // where the tool's end b is then [m]
};

/// Moves the tool from `from` to `to` and stops at the first touch, however fast it goes: steps are never longer than half
/// the clearance or a quarter of an element, whichever is more, so that a wall of one element cannot be jumped. Work is
/// bounded: a way that needs more than `sweepSteps` steps ends where they end, and counts as a hit. Both poses have the
/// same length.
inline constexpr int sweepSteps = 512;
Sweep sweep(const Body& body, const Capsule& from, const Capsule& to) noexcept;

}  // namespace palpate::occupancy
