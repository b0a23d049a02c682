#pragma once

#include <reference/smooth_labels.h>

#include <vector>

namespace palpate::reference {

/// Twice the volume by the surface of each region, among the samples [m] (rows x 1).
std::vector<double> thicknesses(const SmoothLabels& labels);

/// A point well inside each connected piece of each region, larger than `least` [m^3].
struct RegionSeed {
    int region = 0;
    Vec3 point{0.0};    // [m]
    double volume = 0;  // [m^3]
};
std::vector<RegionSeed> regionSeeds(const SmoothLabels& labels, double least);

}  // namespace palpate::reference
