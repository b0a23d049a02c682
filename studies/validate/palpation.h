#pragma once

#include <studies/validate/experiment.h>

#include <filesystem>
#include <vector>

namespace palpate::studies {

/// A lump in a block of fat under a fingertip that is pressed 6 mm deep, as in the sweep `palpation`.
struct Lump {
    double diameter = 0;       // [m]
    double youngsModulus = 0;  // [Pa]; 0: it is of fat, as all around it
    double depth = 0;          // from the surface to its nearest point [m]
};

/// Force of the tissue on the fingertip [N]. Throws as a scene does.
double forceOver(const Lump& lump);

/// Spearman's rank correlation; ties share their mean rank. NaN for fewer than two values.
double rankCorrelation(const std::vector<double>& a, const std::vector<double>& b);

/// Order in which 80 physicians detected lumps (by size and hardness) beside the order of the contrast of force.
/// @param file  literature_facts_read.csv, see datasets/measured/README.md
/// Throws as Measurements does.
Experiment palpationOrder(const std::filesystem::path& file, const ValidateProgress& progress);

}  // namespace palpate::studies
