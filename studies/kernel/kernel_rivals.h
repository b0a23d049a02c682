#pragma once

#include <chainmail/deformation.h>
#include <datasets/scene.h>
#include <studies/kernel/kernel_trial.h>

#include <memory>

namespace palpate::studies {

/// Nodes of a body that a model is tried on, at most.
inline constexpr std::size_t maxTrialNodes = 4U << 20;

/// An elastic body for trials, with the grid of its cells.
struct TrialBody {
    volume::NodeGrid cells;
    chainmail::ElasticBody body;
};

/// @param wanted    spacing of the finest nodes; widened where the body would need over `maxNodes` [m]
/// @param shift     of the grid of cells, while tissue and surface stay where they are [cells]
TrialBody trialBody(const volume::Tissue& tissue, const volume::DistanceField& surface, double wanted, double poissonCap,
                    std::size_t maxNodes, Vec3 shift = Vec3(0.0));

/// The trial with windows around the tool, or with the whole grid, by its options.
TrialResult elasticTrial(const chainmail::ElasticBody& body, const TrialPath& path, double speed,
                         const Reference& reference, const chainmail::ElasticOptions& options);

/// Plain ChainMail in one lattice, held as in a session: level 1 of the ladder. `touched` counts moved nodes. The surface
/// of the path must outlive the model.
TrialModel chainMailModel(std::shared_ptr<const chainmail::Lattice> lattice, const TrialPath& path, std::uint32_t maxMoves);
/// The trial of that model.
TrialResult chainMailTrial(const chainmail::Lattice& lattice, const TrialPath& path, double speed,
                           const Reference& reference, std::uint32_t maxMoves);

/// One run of a rival of the windows.
struct RivalRun {
    int coarsening = 1;  // spacing of its only grid, in spacings of the reference
    int cycles = 0;      // per tick
    std::size_t nodes = 0;
    TrialResult result;
};

/// Whole grids of 2, 3 and 4 times the spacing, 1 to `maxCycles` cycles per tick, against the reference on the fine one;
/// and the fine one itself, with 1 and 2 cycles. Strain and the bound of Poisson's ratio are those of `settings`.
std::vector<RivalRun> singleGridTrials(const volume::Tissue& tissue, const volume::DistanceField& surface,
                                       const TrialBody& fine, const TrialPath& path, double speed,
                                       const Reference& reference, const datasets::ElasticSettings& settings,
                                       int maxCycles);

/// Time of the fastest run whose median error in `figure` is not over `error`, in units of `seconds`; 0 when none is.
double ratioAtEqualError(std::span<const RivalRun> runs, double TrialErrors::*figure, double error, double seconds);

}  // namespace palpate::studies
