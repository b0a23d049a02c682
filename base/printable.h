#pragma once

#include <cmath>

namespace palpate::base {

/// `value`, and plain zero where so many decimals print it as zero: no text reads "-0.0".
inline double printable(double value, int decimals) noexcept
{
    return std::nearbyint(value * std::pow(10.0, decimals)) == 0.0 ? 0.0 : value;
}

}  // namespace palpate::base
