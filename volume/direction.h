#pragma once

#include <volume/geometry.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::volume {

/// A direction whose length can be computed with: `direction` itself where its length is 1e-100 to 1e100, else divided by
/// its largest component, so that no square overflows or vanishes. Zero and what is not finite stay what they are.
inline Vec3 rescaled(Vec3 direction) noexcept
{
    constexpr double least = 1e-100, most = 1e100;
    const double length = glm::length(direction);
    const double largest = std::max({std::abs(direction.x), std::abs(direction.y), std::abs(direction.z)});
    const bool usable = length >= least && length <= most;
    return usable || largest == 0 || !std::isfinite(largest) ? direction : direction / largest;
}

}  // namespace palpate::volume
