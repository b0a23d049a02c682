#pragma once

#include <sweep/design.h>

#include <span>
#include <vector>

namespace palpate::sweep {

/// How much of an output's variance an axis makes: by itself, and with all that it has a part in.
struct SobolIndex {
    double first = 0, firstError = 0;  // half of the 95 % interval of a bootstrap over samples
    double total = 0, totalError = 0;
};

/// Indices of every axis from the outputs at saltelliPoints(), in their order: first order by Saltelli et al. 2010, total
/// by Jansen 1999. A sample with a value that is not finite is left out. Empty when fewer than two are left, or nothing
/// varies.
std::vector<SobolIndex> sobolIndices(std::span<const double> outputs, std::size_t axes);
/// How many samples of so many outputs in a row have only values that are finite.
std::size_t wholeSamples(std::span<const double> outputs, std::size_t block);

/// Elementary effects of an axis, over its whole range.
struct MorrisEffect {
    double mean = 0;      // mu
    double absolute = 0;  // mu*, Campolongo, Cariboni and Saltelli 2007
    double spread = 0;    // sigma: other than 0 where the axis acts with others, or not in proportion
};

/// Effects of every axis from the outputs at `points`: those of morrisPoints(), at the places that the axes could take
/// (Axis::placeAt). A trajectory in which an axis keeps its place says nothing about it; one that never moves has no
/// effect. Steps from or to a value that is not finite are left out. Empty when an axis that moves has none other, or
/// nothing varies.
std::vector<MorrisEffect> morrisEffects(const UnitPoints& points, std::span<const double> outputs);

/// Fraction of the variance over a full grid that the mean at each value of an axis makes: the first-order index there.
/// `level[i]` is the value's index at output i.
double mainEffect(std::span<const double> outputs, std::span<const std::size_t> level);

}  // namespace palpate::sweep
