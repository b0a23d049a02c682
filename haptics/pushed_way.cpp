#include <haptics/pushed_way.h>

#include <glm/common.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace palpate::haptics {

namespace {

constexpr double step = 4e-3;   // from sample to sample [m]
constexpr double band = 10.0;   // the others' force passes a low-pass at this frequency [Hz]
constexpr double least = 1e-3;  // force by which others displace anything [N]
constexpr double most = 3.0;    // times what was displaced at first

}  // namespace

void PushedWay::look(const occupancy::Body& body, Vec3 entry, Vec3 axis, double others) noexcept
{
    *this = {};
    if (!(others > least)) {
        return;
    }
    others_ = others;
    share_ = 1.0;
    for (std::size_t i = 0; i < displaced_.size(); ++i) {
        displaced_[i] = Vec3f(occupancy::displacementAt(body, entry + static_cast<double>(i) * step * axis));
    }
}

void PushedWay::follow(double others, double dt) noexcept
{
    if (others_ > 0.0) {
        const double now = std::min(others / others_, most);
        share_ += (1.0 - 1.0 / (1.0 + 2.0 * std::numbers::pi * band * dt)) * (now - share_);
    }
}

Vec3 PushedWay::at(double length) const noexcept
{
    const double place = std::clamp(length / step, 0.0, static_cast<double>(displaced_.size() - 1));
    const auto before = std::min(static_cast<std::size_t>(place), displaced_.size() - 2);
    return share_ * glm::mix(Vec3(displaced_[before]), Vec3(displaced_[before + 1]), place - static_cast<double>(before));
}

}  // namespace palpate::haptics
