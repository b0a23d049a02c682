#include <reference/obstacle.h>

#include <glm/geometric.hpp>

#include <algorithm>

namespace palpate::reference {

Vec3 Obstacle::shares() const noexcept
{
    const double square = glm::dot(shaft, shaft);
    return square > 0.0 ? shaft / square : Vec3(0.0);
}

double Obstacle::distance(Vec3 p) const noexcept
{
    const double share = std::clamp(glm::dot(p - centre, shares()), 0.0, 1.0);
    return glm::distance(p, centre + share * shaft) - radius;
}

}  // namespace palpate::reference
