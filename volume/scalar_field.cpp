#include <volume/scalar_field.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace palpate::volume {

double ScalarField::at(Vec3 p) const noexcept
{
    const Vec3 last(grid.size - Index3(1));
    const Vec3 g = glm::clamp((p - grid.origin) / grid.spacing, Vec3(0.0), last);
    const Index3 n = glm::min(Index3(g), glm::max(grid.size - Index3(2), Index3(0)));
    const Vec3 t = g - Vec3(n);
    const Index3 step = glm::min(Index3(1), grid.size - Index3(1));

    const std::size_t base = grid.offset(n);
    const auto dx = static_cast<std::size_t>(step.x);
    const auto dy = static_cast<std::size_t>(step.y * grid.size.x);
    const auto dz =
        static_cast<std::size_t>(step.z) * static_cast<std::size_t>(grid.size.x) * static_cast<std::size_t>(grid.size.y);
    const float* v = values.data() + base;
    const auto alongX = [&](std::size_t o) {
        return static_cast<double>(v[o]) * (1.0 - t.x) + static_cast<double>(v[o + dx]) * t.x;
    };
    const double low = alongX(0) * (1.0 - t.y) + alongX(dy) * t.y;
    const double high = alongX(dz) * (1.0 - t.y) + alongX(dz + dy) * t.y;
    return low * (1.0 - t.z) + high * t.z;
}

Vec3 ScalarField::gradient(Vec3 p) const noexcept
{
    const double h = 0.5 * grid.spacing;
    return Vec3(at(p + Vec3(h, 0, 0)) - at(p - Vec3(h, 0, 0)), at(p + Vec3(0, h, 0)) - at(p - Vec3(0, h, 0)),
                at(p + Vec3(0, 0, h)) - at(p - Vec3(0, 0, h))) /
           grid.spacing;
}

double DistanceField::distance(Vec3 p) const noexcept
{
    const Box box = grid.box();
    const Vec3 inside = glm::clamp(p, box.low, box.high);
    return at(inside) + glm::length(p - inside);
}

Vec3 DistanceField::normal(Vec3 p) const noexcept
{
    const Box box = grid.box();
    const Vec3 inside = glm::clamp(p, box.low, box.high);
    const Vec3 g = gradient(inside) + (p - inside) / grid.spacing;
    const double length = glm::length(g);
    return length > 1e-9 ? g / length : Vec3(0, 0, 1);
}

}  // namespace palpate::volume
