#pragma once

#include <studies/validate/experiment.h>

namespace palpate::studies {

/// Viscosity of level `elastic` as it is, Kelvin-Voigt with one time T, beside its closed form: a ball is pressed in
/// evenly, F(t) = F_e(t) + T dF_e/dt, and held, F = F_e, F_e being the force without viscosity.
/// @param quick  half as deep
Experiment kelvinVoigt(bool quick, const ValidateProgress& progress);

}  // namespace palpate::studies
