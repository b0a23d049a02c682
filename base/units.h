#pragma once

#include <numbers>

/// Factors between SI units, which all code of ours computes in, and those that people read.
namespace palpate::units {

inline constexpr double mm = 1e3;                           ///< millimetres in a metre
inline constexpr double kPa = 1e-3;                         ///< kilopascals in a pascal
inline constexpr double degree = std::numbers::pi / 180.0;  ///< radians in a degree

}  // namespace palpate::units
