#pragma once

#include <algorithm>
#include <array>

namespace palpate::base {

inline constexpr double ctNumberOfAir = -1000, ctNumberOfSteel = 12000;  // [HU]; steel's own is off every scale

/// CT number of a tissue of `density` [kg/m^3], in Hounsfield units: Schneider, Bortfeld and Schlegel, Phys Med Biol
/// 45:459, 2000, the other way round and without its steps. What is as dense as steel has what steel has.
inline float ctNumberOf(double density) noexcept
{
    struct Point {
        double density, number;
    };
    constexpr std::array<Point, 7> table{{{1.21, ctNumberOfAir},
                                          {930, -98},
                                          {1030, 18.5},
                                          {1110, 91.5},
                                          {1160, 241.6},
                                          {1925, 1534},
                                          {7900, ctNumberOfSteel}}};
    const auto next = std::find_if(table.begin() + 1, table.end() - 1, [&](const Point& p) { return density < p.density; });
    const Point &from = *(next - 1), &to = *next;
    const double fraction = std::clamp((density - from.density) / (to.density - from.density), 0.0, 1.0);
    return static_cast<float>(from.number + fraction * (to.number - from.number));
}

}  // namespace palpate::base
