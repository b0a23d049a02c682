#pragma once

#include <haptics/falcon/kinematics.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>

namespace palpate::falcon {

/// The arms' angles that put the grip at a position (inverse kinematics, in closed form, elbows outside); nothing where the
/// legs do not reach.
inline std::optional<Angles> anglesAt(Vec3 position)
{
    constexpr Geometry delta;
    constexpr double widestSide = 0.95;  // of the shin's way sideways, over its length
    Angles angles{};
    for (std::size_t leg = 0; leg < 3; ++leg) {
        const double bearing = delta.bearing[leg] * std::numbers::pi / 180.0;
        const Vec3 radial(std::cos(bearing), std::sin(bearing), 0.0), tangent(-radial.y, radial.x, 0.0);
        const double side = glm::dot(position, tangent) - delta.s + delta.f;
        const double across = glm::dot(position, radial) - delta.r + delta.c, reach = std::hypot(across, position.z);
        const double shin = delta.d + delta.e + std::sqrt(std::max(delta.b * delta.b - side * side, 0.0));
        const double cosine = (reach * reach + delta.a * delta.a - shin * shin) / (2.0 * delta.a * std::max(reach, 1e-9));
        // The negation also catches what is not a number.
        if (!(std::abs(side) < widestSide * delta.b) || !(std::abs(cosine) <= 1.0)) {
            return std::nullopt;
        }
        angles[leg] = std::atan2(position.z, across) - std::acos(cosine);
    }
    return angles;
}

/// What the encoders count there.
inline Triple countsAt(const Angles& angles)
{
    Triple count{};
    for (std::size_t i = 0; i < 3; ++i) {
        count[i] =
            static_cast<std::int16_t>(std::clamp(std::lround((angles[i] - zeroAngle) / radPerCount), -32768L, 32767L));
    }
    return count;
}

}  // namespace palpate::falcon
