#pragma once

#include <volume/relaxation.h>

#include <glm/vec2.hpp>

#include <cstddef>
#include <vector>

namespace palpate::studies {

/// What a needle meets in liver, as it is fitted.
struct LiverLaw {
    double cutting = 0;      // force at the tip [N]
    double wallSpacing = 0;  // mean distance between inner walls [m]; 0: none
    double wallForce = 0;    // mean of what they hold beyond the cutting force [N]
    volume::Relaxation relaxation = {};
};

/// Force of a needle that goes in at an even speed, is held, and comes out.
struct NeedleStroke {
    std::vector<double> in, out;  // size of the force at even steps of depth, along and against the way [N]
    std::vector<double> held;     // at each of `heldAt` [N]
    std::size_t falls = 0;        // of `minRupture` or more on the way in
};
inline constexpr double strokeStep = 2e-3;  // of depth [m]
inline constexpr double fineStep = 0.5e-3;  // the same, as finely as the measurements have it [m]
inline constexpr double minRupture = 0.15;  // [N]

/// Our needle in a block of liver, 80 mm wide.
/// @param aside    of the block's middle, where it goes in [m]
/// @param depth    how far in [m]
/// @param heldAt   seconds after it stands
NeedleStroke needleStroke(const LiverLaw& liver, glm::dvec2 aside, double depth, const std::vector<double>& heldAt);

/// Walls that give so many falls of `minRupture` or more, of that mean size, where what walls hold is exponentially
/// distributed: its excess over any limit has the same mean. No walls where there is no fall.
/// @param falls    per insertion [-]
/// @param size     mean of these [N], over `minRupture`
/// @param length   of the way through the tissue [m]
/// @return         with cutting force and relaxation left at 0
LiverLaw fittedWalls(double falls, double size, double length);

/// Falls of `minRupture` or more within 1 mm, from a peak to the least force after it [N].
/// @param most, least  of the force in each `fineStep` of depth [N]
std::vector<double> rupturesIn(const std::vector<double>& most, const std::vector<double>& least);

}  // namespace palpate::studies
