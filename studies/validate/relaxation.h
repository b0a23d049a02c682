#pragma once

#include <studies/validate/experiment.h>

namespace palpate::studies {

/// Tissue that relaxes at level `elastic`, beside closed forms of a generalised Maxwell solid; F_e is the force of the same
/// tissue right after a step, taken from a run without relaxation.
///
/// A ball is pressed in evenly and held: F(t) is the sum of G(t - s) dF_e(s), G the Prony series (a contact that grows
/// follows the hereditary integral, Lee and Radok 1960). And a ball that swings by a, deep in tissue, loses
/// pi a^2 F_e' (w_1 x_1 / (1 + x_1^2) + w_2 x_2 / (1 + x_2^2)) in a turn, x_i being the time t_i times 2 pi f.
/// @param quick  half as long
std::vector<Experiment> relaxation(bool quick, const ValidateProgress& progress);

}  // namespace palpate::studies
