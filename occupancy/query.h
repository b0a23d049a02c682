#pragma once

#include <occupancy/body.h>

#include <array>
#include <cstddef>

namespace palpate::occupancy {

/// A tool: all points within `radius` of the segment from `a` to `b` [m]. A sphere has a == b.
struct Capsule {
    Vec3 a{0.0};
    Vec3 b{0.0};
    double radius = 0;
};

/// One element that a tool touches.
struct Contact {
    Element element = none;
    double depth = 0;  // of the element's middle below the tool's surface, widened by half an element [m]
};

/// What a tool touches, deepest point first. Fixed size: the servo path allocates nothing.
struct ContactSet {
    static constexpr std::size_t capacity = 1024;
    std::array<Contact, capacity> contacts;
    std::size_t count = 0;
    bool touching = false;  // the tool's surface is below the body's
    double depth = 0;       // of the deepest point, from the distance field [m]
    Vec3 point{0.0};        // of the tool's axis where it is deepest [m]
    Vec3 normal{0, 0, 1};   // unit vector out of the body there, smooth
};

/// Fills `out` with the elements that the tool touches, and with depth and normal from the distance field.
/// Cost O(cells in the tool's box); allocates nothing.
void touch(const Body& body, const Capsule& tool, ContactSet& out) noexcept;

/// How far a tool gets on its way.
struct Sweep {
    double fraction = 1;  // of the way, up to the first touch or to the end
    bool hit = false;
    Vec3 point{0.0};  // of the tool's axis that touches [m]
};

/// Moves the tool from `from` to `to` and stops at the first touch, however fast it goes: steps are never longer than half
/// the clearance or a quarter of an element, whichever is more, so that a wall of one element cannot be jumped. Work is
/// bounded: a way that needs more than `sweepSteps` steps ends where they end, and counts as a hit. Both poses have the
/// same length.
inline constexpr int sweepSteps = 512;
Sweep sweep(const Body& body, const Capsule& from, const Capsule& to) noexcept;

}  // namespace palpate::occupancy
