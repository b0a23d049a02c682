#pragma once

#include <studies/kernel/baselines/baseline.h>

namespace palpate::studies {

/// Plain ChainMail from rest in every tick, first in, first out; the sphere pushes the tissue in its way inward. All
/// models here throw std::runtime_error where the body would need too many nodes.
/// @param spacing     of the nodes [m]
/// @param fraction    by which the slack of all links is multiplied
TrialModel fifoMailModel(const BaselineScene& scene, double spacing, double fraction);

/// Our level 1: ChainMail in the order of violation with the table's limits, and room to finish in every tick.
TrialModel orderedMailModel(const BaselineScene& scene, double spacing);

}  // namespace palpate::studies
