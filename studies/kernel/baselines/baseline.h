#pragma once

#include <studies/kernel/kernel_trial.h>
#include <volume/tissue.h>

#include <functional>
#include <string>
#include <vector>

namespace palpate::studies {

/// What a baseline is built for. All must outlive what is built.
struct BaselineScene {
    const volume::Tissue& tissue;
    const volume::DistanceField& surface;  // of the body at rest [m]
    const TrialPath& path;                 // of a sphere that presses
    double poissonCap = 0.49;              // Poisson's ratios above are lowered to this [-]
};

/// A method that a user might pick instead of ours, at one of its settings.
struct Baseline {
    std::string method;                 // "xpbd"
    std::string setting;                // "4 mm, 10 substeps"
    std::function<TrialModel()> build;  // at rest; throws std::runtime_error when the scene is too large for it
};

/// Methods on a lattice: ChainMail.
std::vector<Baseline> latticeBaselines(const BaselineScene& scene);
/// Methods on tetrahedra: prefactored linear finite elements, and XPBD.
std::vector<Baseline> tetBaselines(const BaselineScene& scene);

}  // namespace palpate::studies
