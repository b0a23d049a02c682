#include <occupancy/body.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace palpate::occupancy {

Vec3 displacementAt(const Body& body, Vec3 rest) noexcept
{
    const auto& grid = body.grid;
    const Vec3 g = (rest - grid.origin) / grid.spacing;
    const Vec3 low = glm::floor(g);
    const Index3 n(low);
    const Vec3 t = g - low;

    Vec3 sum(0.0);
    double weights = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
        const Index3 step(corner & 1, corner >> 1 & 1, corner >> 2);
        const Index3 m = n + step;
        if (!grid.contains(m) || body.solid[grid.offset(m)] == 0) {
            continue;
        }
        const Vec3 w = glm::mix(Vec3(1.0) - t, t, Vec3(step));
        const double weight = w.x * w.y * w.z;
        sum += weight * Vec3(body.u[grid.offset(m)]);
        weights += weight;
    }
    return weights > 0.0 ? sum / weights : Vec3(0.0);
}

Vec3 restPoint(const Body& body, Vec3 p) noexcept
{
    const double h = body.grid.spacing;
    Vec3 start = p;
    double nearest = 4.0 * h * h;
    bool moved = false;
    body.map.visit(p - 0.5 * h, p + 0.5 * h, [&](Element e) {
        const Vec3 away = p - body.position(e);
        const double square = glm::dot(away, away);
        moved = moved || body.u[e] != Vec3f(0.0F);
        if (square < nearest) {
            nearest = square;
            start = body.restPosition(e) + away;
        }
    });
    if (!moved) {
        return p;
    }
    constexpr int steps = 6;
    Vec3 rest = start;
    for (int i = 0; i < steps; ++i) {
        // Half a step keeps the iteration a contraction for gradients of u up to 3.
        const Vec3 miss = p - displacementAt(body, rest) - rest;
        rest += 0.5 * miss;
    }
    return rest;
}

double distance(const Body& body, Vec3 p) noexcept
{
    return body.surface.distance(restPoint(body, p));
}

}  // namespace palpate::occupancy
