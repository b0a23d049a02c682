#pragma once

#include <channel/layout.h>

#include <glm/vec3.hpp>

#include <array>

namespace palpate::channel {

/// A needle's middle line [m] from its hub to its tip: straight outside the body and, inside, bent by the square of the
/// way from the entry, as a needle whose path has a constant curvature.
using NeedleShape = std::array<glm::dvec3, 18>;
NeedleShape needleShape(const Scenery& scenery, const State& state) noexcept;

}  // namespace palpate::channel
