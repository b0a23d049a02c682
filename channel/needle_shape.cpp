#include <channel/needle_shape.h>

#include <channel/deformation.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::channel {

NeedleShape needleShape(const Scenery& scenery, const State& state) noexcept
{
    const glm::dvec3 bend = vec(state.bend), straight = vec(state.tip) - bend;
    const double norm = glm::length(vec(state.axis));
    const glm::dvec3 axis = norm > 0 && std::isfinite(norm) ? vec(state.axis) / norm : glm::dvec3(0, 1, 0);
    const double inside = std::clamp(state.inserted, 0.0, scenery.toolLength);
    NeedleShape shape;
    shape[0] = straight - scenery.toolLength * axis;
    const std::size_t steps = shape.size() - 2;
    for (std::size_t i = 0; i <= steps; ++i) {
        const double fraction = static_cast<double>(i) / static_cast<double>(steps);
        shape[i + 1] = straight - (1 - fraction) * inside * axis + fraction * fraction * bend;
    }
    return shape;
}

}  // namespace palpate::channel
