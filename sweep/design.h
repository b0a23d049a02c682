#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string_view>
#include <vector>

namespace palpate::sweep {

/// How the points of a sweep lie in the unit cube of its axes.
enum class DesignKind : std::uint8_t { grid, latinHypercube, sobol, saltelli, morris, list };
inline constexpr std::array<std::string_view, 6> designNames{"grid",     "latin_hypercube", "sobol",
                                                             "saltelli", "morris",          "list"};

/// Points of the unit cube [0, 1)^d, one row each.
using UnitPoints = std::vector<std::vector<double>>;

/// One point in each of `samples` strata of every axis (McKay, Beckman and Conover 1979).
UnitPoints latinHypercube(std::size_t samples, std::size_t axes, std::uint64_t seed);

/// Columns that Sobol's sequence has numbers for (Joe and Kuo 2008).
inline constexpr std::size_t maxSobolAxes = 3667;

/// The first points of Sobol's sequence with a digital shift by the seed: of the first 2^m points each interval
/// [k, k + 1) / 2^m of every axis holds one.
/// @pre  no more than `maxSobolAxes` axes
UnitPoints sobolPoints(std::size_t samples, std::size_t axes, std::uint64_t seed);

/// For each of `samples` pairs of points a, b: a, b, and for each axis i the point a with b's coordinate i (Saltelli 2010).
/// samples x (axes + 2) points, of 2 x axes columns of Sobol's sequence.
UnitPoints saltelliPoints(std::size_t samples, std::size_t axes, std::uint64_t seed);

/// `samples` trajectories of axes + 1 points; from one to the next one axis moves by `morrisStep`, each once (Morris 1991).
UnitPoints morrisPoints(std::size_t samples, std::size_t axes, std::uint64_t seed);
inline constexpr int morrisLevels = 4;
inline constexpr double morrisStep = 0.5 * morrisLevels / (morrisLevels - 1.0);  // of levels 0, 1/3, 2/3, 1

/// Mixes numbers into one seed: every bit of each counts (SplitMix64, Steele, Lea and Flood 2014).
std::uint64_t mixedSeed(std::initializer_list<std::uint64_t> parts) noexcept;

}  // namespace palpate::sweep
