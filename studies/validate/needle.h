#pragma once

#include <studies/validate/experiment.h>
#include <studies/validate/needle_stroke.h>
#include <volume/relaxation.h>

#include <filesystem>
#include <vector>

namespace palpate::studies {

/// The weights whose Prony series is nearest to these ratios G(t) / G(0), least squares; none is under 0.
volume::Relaxation fittedRelaxation(const std::vector<double>& seconds, const std::vector<double>& ratios);

/// A needle into human liver: tip force, force on the way in, ruptures, held force. Fitted on the curves with even numbers,
/// compared with those with odd ones.
/// @param curves, hold  measurements, see datasets/measured/README.md
/// Throws as Measurements does.
std::vector<Experiment> needleInLiver(const std::filesystem::path& curves, const std::filesystem::path& hold,
                                      const ValidateProgress& progress);

}  // namespace palpate::studies
