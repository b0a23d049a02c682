#pragma once

#include <volume/geometry.h>
#include <volume/scalar_field.h>

namespace palpate::haptics {

/// A tool as its proxy sees it: all within `radius` of a segment that begins at the tool's front end and goes back against
/// `axis`. A sphere has no length, the tip of a needle no radius either.
struct ProxyTool {
    double radius = 0;    // [m]
    double length = 0;    // [m]
    Vec3 axis{0, 1, 0};   // unit vector, to the front
    double friction = 0;  // Coulomb [-]
};

/// Where a tool would lie if tissue at rest did not give way: it touches the surface, on the side that it came from. It
/// follows the tool from place to place, so that a tool that is pressed past the middle of a thin part, or over an edge,
/// keeps its side.
struct SurfaceProxy {
    Vec3 front{0.0};   // of the tool [m]
    Vec3 normal{0.0};  // out of the body, where it touches
    Vec3 place{0.0};   // of the tool's segment that is one radius off the surface [m]
};

/// The deepest place of the tool's segment; the weighted middle of several that are about as deep.
struct DeepestPlace {
    Vec3 at{0.0};         // [m]
    double distance = 0;  // from the surface at rest, negative inside [m]
};
DeepestPlace deepestPlace(const volume::DistanceField& surface, const ProxyTool& tool, Vec3 front) noexcept;

/// The tool with its front at `front`, moved along the normals until it touches the surface.
SurfaceProxy touching(const volume::DistanceField& surface, const ProxyTool& tool, Vec3 front) noexcept;

/// Turns the proxy with the tool, and lets it slip over the surface towards it, until the way between them is inside the
/// cone of friction: at most 8 steps of 1 mm.
/// Source: Zilles and Salisbury, "A constraint-based god-object method for haptic display", IROS 1995.
void slip(const volume::DistanceField& surface, const ProxyTool& tool, Vec3 front, SurfaceProxy& proxy) noexcept;

/// How deep the tool is under its proxy; contact ends where it is not over zero [m].
double depthUnder(const SurfaceProxy& proxy, Vec3 front) noexcept;

}  // namespace palpate::haptics
