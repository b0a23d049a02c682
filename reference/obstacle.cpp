#include <reference/obstacle.h>

#include <glm/geometric.hpp>

#include <algorithm>

namespace palpate::reference {

Vec3 Obstacle::fractions() const noexcept
{
    const double square = glm::dot(shaft, shaft);
    return square > 0.0 ? shaft / square : Vec3(0.0);
}

double Obstacle::distance(Vec3 p) const noexcept
{
    const double fraction = std::clamp(glm::dot(p - centre, fractions()), 0.0, 1.0);
    return glm::distance(p, centre + fraction * shaft) - radius;
}

}  // namespace palpate::reference
