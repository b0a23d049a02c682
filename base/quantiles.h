#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace palpate::base {

/// The value that a fraction of all values in any order does not exceed: of two neighbours the lower. 0 of none.
inline double lowerQuantile(std::vector<double> values, double fraction)
{
    if (values.empty()) {
        return 0.0;
    }
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

/// The middle one of values in any order, of two the upper.
/// @pre  there is one
inline double upperMedian(std::vector<double> values)
{
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

}  // namespace palpate::base
