#pragma once

#include <reference/solve.h>

#include <string>

namespace palpate::reference {

/// Makes what each law has beyond neo-Hookean's energy known to GetFEM; it keeps that as long as the program runs.
void defineLaws();

/// The energy density of FiniteElements in GetFEM's language: of u, mu and K, with pressures of p, at finite strain of the
/// macros F and I, and where tissue stiffens of b.
std::string tissueEnergy(const SolveOptions& options, bool stiffens);
/// Cauchy stress of the same, times Test_s.
std::string testedStress(const SolveOptions& options, bool stiffens);

}  // namespace palpate::reference
