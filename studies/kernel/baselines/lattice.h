#pragma once

#include <studies/kernel/baselines/baseline.h>

namespace palpate::studies {

/// The table with all slack of links multiplied by `fraction`.
volume::TissueTable withLimits(const volume::TissueTable& table, double fraction);

/// Plain ChainMail from rest in every tick, first in, first out; the sphere pushes the tissue in its way inward. All
/// models here throw std::runtime_error where the body would need too many nodes.
/// @param spacing     of the nodes [m]
/// @param fraction       of the table's limits, see withLimits()
/// @param meanSweeps  of relaxation towards the neighbours' mean, after ChainMail
TrialModel fifoMailModel(const BaselineScene& scene, double spacing, double fraction, int meanSweeps);

/// Our level 1: ChainMail in the order of violation with the table's limits, and room to finish in every tick.
TrialModel orderedMailModel(const BaselineScene& scene, double spacing);

/// Linear elasticity relaxed by projected sweeps, from tick to tick.
/// @param predict  ChainMail takes each tick's increment through the tissue before the sweeps
TrialModel relaxedModel(const BaselineScene& scene, double spacing, int sweeps, bool predict);

}  // namespace palpate::studies
