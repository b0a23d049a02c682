#pragma once

#include <channel/layout.h>

#include <cstdint>

namespace palpate::render {

/// Colours of tissues: those of the table, which are as in the body, or a set that people with protanopia, deuteranopia and
/// tritanopia tell apart, with patterns in slices for what must not be taken for anything else.
enum class Palette : std::uint8_t { standard, colourBlind };

/// What is laid over a tissue in a slice, for whom its colour is not enough.
enum class Pattern : std::uint8_t { none, dots, rising, falling, level, checks };

/// Gives the tissues of a scenery the colours of a palette; opacities stay. Tissues that the palette does not know keep
/// theirs, and have a pattern.
void paint(Palette palette, channel::Scenery& scenery);

/// Of a tissue by its name; none in the standard palette.
Pattern patternOf(Palette palette, const channel::Name& tissue);

/// Whether the pattern is dark at a pixel of the screen. A stripe is as wide as a space between two.
bool isMarked(Pattern pattern, int column, int row) noexcept;

}  // namespace palpate::render
