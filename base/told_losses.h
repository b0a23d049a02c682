#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace palpate::base {

/// Losses of no more are not told to people, but for toldLosses(): beside a total without decimals they would contradict
/// it.
inline constexpr double toldPoints = 0.5;

/// Of losses, those that people are told beside a total without decimals: over half a point, as less would contradict it;
/// where none is, those that a decimal shows, so that nobody reads of no loss beside a bar that is not full.
/// @param points   the largest first
/// @returns        their places in `points`
std::vector<std::size_t> toldLosses(std::span<const double> points);

/// "-12"; "-0.4" for half a point or less.
std::string lossInWords(double points);

/// What stands above them, in the user's language.
/// @param total  points of 100
/// @param told   how many are told
const char* headingOfLosses(double total, std::size_t told) noexcept;

}  // namespace palpate::base
