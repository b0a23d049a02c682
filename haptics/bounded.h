#pragma once

#include <volume/geometry.h>

#include <glm/geometric.hpp>

namespace palpate::haptics {

/// `v`, or a vector of its direction and length `most` where it is longer.
inline Vec3 bounded(Vec3 v, double most) noexcept
{
    const double length = glm::length(v);
    return length > most ? v * (most / length) : v;
}

}  // namespace palpate::haptics
