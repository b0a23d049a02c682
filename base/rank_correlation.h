#pragma once

#include <base/error.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

namespace palpate::base {

/// Mean ranks from 1 up.
/// @pre  none of the values is NaN
inline std::vector<double> ranksOf(std::span<const double> values)
{
    std::vector<std::size_t> order(values.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::sort(order, {}, [&](std::size_t i) { return values[i]; });
    std::vector<double> rank(values.size());
    for (std::size_t first = 0, last = 0; first < order.size(); first = last) {
        ++last;
        while (last < order.size() && values[order[last]] == values[order[first]]) {
            ++last;
        }
        for (std::size_t i = first; i < last; ++i) {
            rank[order[i]] = 0.5 * static_cast<double>(first + 1 + last);
        }
    }
    return rank;
}

/// Spearman's rank correlation; equal values share their mean rank. NaN when either does not vary or has a NaN. Throws
/// std::runtime_error when there are not as many of both.
inline double rankCorrelation(std::span<const double> x, std::span<const double> y)
{
    failIf(x.size() != y.size(), "rank correlation: {} values do not fit {}", x.size(), y.size());
    const auto isNan = [](double v) { return std::isnan(v); };
    if (std::ranges::any_of(x, isNan) || std::ranges::any_of(y, isNan)) {
        return std::numeric_limits<double>::quiet_NaN();
    }
    const auto a = ranksOf(x), b = ranksOf(y);
    const double mean = 0.5 * static_cast<double>(a.size() + 1);
    double ab = 0, aa = 0, bb = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        ab += (a[i] - mean) * (b[i] - mean);
        aa += (a[i] - mean) * (a[i] - mean);
        bb += (b[i] - mean) * (b[i] - mean);
    }
    return aa > 0 && bb > 0 ? ab / std::sqrt(aa * bb) : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace palpate::base
