#pragma once

#include <cmath>
#include <vector>

namespace palpate::base {

/// The next of 1, 2, 5 times a power of ten, from `value` upwards or downwards.
/// @pre  value > 0
inline double roundStep(double value, bool up)
{
    const double decade = std::pow(10, std::floor(std::log10(value)));
    double below = decade;
    for (const double step : {1.0, 2.0, 5.0, 10.0}) {
        if (up && step * decade >= value) {
            return step * decade;
        }
        below = step * decade <= value ? step * decade : below;
    }
    return up ? 10 * decade : below;
}

/// Multiples of `step` from `low` to `high`, both included. Few also where the doubles there lie further apart than a step.
/// @pre  step > 0
inline std::vector<double> multiplesIn(double low, double high, double step)
{
    constexpr double nearly = 1e-9;  // of a step
    const double first = std::ceil(low / step - nearly), most = (high - low) / step + 1;
    std::vector<double> all;
    for (int n = 0; n <= most; ++n) {
        const double at = (first + n) * step;
        if (at <= high + nearly * step && (all.empty() || at > all.back())) {
            all.push_back(at);
        }
    }
    return all;
}

}  // namespace palpate::base
