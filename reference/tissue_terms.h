#pragma once

#include <reference/solve.h>
#include <volume/geometry.h>

#include <string>

namespace palpate::reference {

/// Makes what each law has beyond neo-Hookean's energy known to GetFEM; it keeps that as long as the program runs.
void defineLaws();

/// The energy density of FiniteElements in GetFEM's language: of u, mu and K, with pressures of p, at finite strain of the
/// macros F and I, and where tissue stiffens of b.
std::string tissueEnergy(const SolveOptions& options, bool stiffens);
/// Cauchy stress of the same, times Test_s.
std::string testedStress(const SolveOptions& options, bool stiffens);

/// A RigidTool in the units of FiniteElements: all that is within `radius` of a line.
struct Obstacle {
    Vec3 centre{0.0};   // where the line begins [mm]
    double radius = 0;  // 0: none [mm]
    Vec3 shaft{0.0};    // from there to the line's end [mm]

    /// To its surface, negative inside [mm].
    double distance(Vec3 p) const noexcept;
    /// A place on the line, times this, is its fraction of the line's length; 0 where it has none [1/mm].
    Vec3 fractions() const noexcept;
};

}  // namespace palpate::reference
