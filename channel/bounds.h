#pragma once

#include <channel/layout.h>

#include <cstdint>

/// What a viewer takes from a segment: whoever owns it may have written anything. Not part of the interface.
namespace palpate::channel {

/// Voxels along a side of a grid, at most.
inline constexpr std::int32_t longestSide = 4096;

/// Voxels of a grid; 0 where a side has none or more than longestSide.
std::uint64_t voxelsOf(const Grid& grid) noexcept;

/// Grids, names, colours, numbers of tissues, structures and windows, tool, line, acoustics and probe as a session has
/// them.
bool sound(const Scenery& scenery) noexcept;

/// Whether a viewer can show it: numbers that are, places within 100 m, rows that the scenery has.
bool sound(const State& state, const Scenery& scenery) noexcept;

bool sound(const Input& input) noexcept;

/// `nodes`: of the lattice
bool sound(const Displacement& displacement, std::uint64_t nodes) noexcept;

}  // namespace palpate::channel
