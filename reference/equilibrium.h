#pragma once

#include <reference/factor.h>
#include <reference/finite_elements.h>

#include <memory>
#include <vector>

namespace palpate::reference {

/// A body with some of its state held or prescribed, and the rest to be found by Newton's method. Units of FiniteElements.
struct Equilibrium {
    Equilibrium(const TetMesh& mesh, std::span<const Material> materials, const SolveOptions& options);

    /// Numbers the unknowns anew: all that is neither held nor `prescribed` (state x 1).
    void drive(const std::vector<char>& prescribed);
    /// Makes tissue heavy: dead loads at the nodes, exact for a quadratic displacement.
    /// @param mesh          that the body was made of
    /// @param densities     of each row of the tissue table [kg/m^3]
    /// @param acceleration  [m/s^2]
    void weigh(const TetMesh& mesh, std::span<const double> densities, Vec3 acceleration);
    /// Finds equilibrium from `state`, with the multipliers as they are.
    /// @param tolerance  residual, fraction of the forces that hold the body
    /// @returns  whether it got there; the state is anything otherwise
    bool find(double tolerance);
    /// Computes `residual`.
    void evaluate();
    /// Norm of the residual where it ought to vanish [mN].
    double unbalanced() const noexcept;
    bool finite() const noexcept;

    SolveOptions options;
    FiniteElements fem;
    std::vector<double> state;
    std::vector<double> residual;       // derivative of the energies of tissue and contact (state x 1) [mN]
    std::vector<double> load;           // dead loads; none: no weight                      (displacements x 1) [mN]
    std::vector<char> held;             // 0 for ever                                       (state x 1)
    std::vector<std::uint32_t> free;    // unknowns, by their place in the state
    std::vector<int> number;            // in `free`, or -1                                 (state x 1)
    std::vector<int> blocks;            // first in `free` of each node, and the end
    std::vector<std::uint32_t> driven;  // prescribed, by their place in the state
    std::vector<double> goal;           // of `driven` [mm]
    int steps = 0;                      // of Newton's method, since the owner set it to 0
    std::unique_ptr<Factor> factor;     // of some step before, while it serves

private:
    double holding() const noexcept;
    std::vector<double> direction();
    double slope(const std::vector<double>& step) const noexcept;
    bool advance(const std::vector<double>& step);

    double lastUnbalanced_ = 0;  // before the last step [mN]
};

}  // namespace palpate::reference
