#pragma once

#include <studies/validate/experiment.h>
#include <volume/relaxation.h>

#include <filesystem>
#include <vector>

namespace palpate::studies {

/// Force of a needle that goes in at an even speed, is held, and comes out.
struct NeedleStroke {
    std::vector<double> in, out;  // size of the force at even steps of depth, along and against the way [N]
    std::vector<double> held;     // at each of `heldAt` [N]
    std::size_t falls = 0;        // of 0.15 N or more on the way in
};
inline constexpr double strokeStep = 2e-3;  // of depth [m]

/// Our needle in a block of liver.
/// @param cutting  force at its tip inside [N]
/// @param depth    how far in [m]
/// @param relaxation  of that liver
/// @param heldAt   seconds after it stands
NeedleStroke needleStroke(double cutting, double depth, const volume::Relaxation& relaxation,
                          const std::vector<double>& heldAt);

/// The weights whose Prony series is nearest to these ratios G(t) / G(0), least squares; none is under 0.
volume::Relaxation fittedRelaxation(const std::vector<double>& seconds, const std::vector<double>& ratios);

/// A needle into human liver: tip force, force on the way in, ruptures, held force. Fitted on the curves with even numbers,
/// compared with those with odd ones.
/// @param curves, hold  measurements, see datasets/measured/README.md
/// Throws as Measurements does.
std::vector<Experiment> needleInLiver(const std::filesystem::path& curves, const std::filesystem::path& hold,
                                      const ValidateProgress& progress);

}  // namespace palpate::studies
