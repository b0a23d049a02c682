#pragma once

#include <chainmail/multigrid.h>
#include <chainmail/window_stack.h>

#include <vector>

namespace palpate::chainmail {

/// A whole elastic body under dead loads at its nodes, in equilibrium at finite strain: no tool, no windows that follow
/// one, no clock. For what a body does before a session, such as sag under its weight.
///
/// QuasiNewton over the cells of the finest level; its first guess of the inverse is one multigrid cycle.
class LoadedBody {
public:
    /// The body must outlive it. Allocates some 300 bytes per node.
    explicit LoadedBody(const ElasticBody& body);

    /// Adds a dead load [N] at a node of the finest level; held nodes take none.
    void load(Index3 node, Vec3 force) noexcept;

    /// How far a solution came.
    struct Outcome {
        bool balanced = false;  // within the tolerance
        int steps = 0;          // evaluations of the force
        double residual = 0;    // forces out of balance, fraction of the loads (norms) [-]
        double lastStep = 0;    // largest displacement in it [m]
    };
    /// Goes on from the displacement that is there until a step moves no node by more than `tolerance` [m] and under 0.1 %
    /// of the load is out of balance; in a slender body, which moves far by its weight, what single precision leaves so (up
    /// to 3 %). That is noise from node to node, which hardly moves anything.
    /// @param most  steps
    Outcome solve(double tolerance, int most);

    /// Of a node of the finest level [m].
    Vec3 displacement(Index3 node) const noexcept;
    /// A start for solve() [m]; held nodes stay.
    void place(Index3 node, Vec3 displacement) noexcept;
    /// What holds the fixed nodes, all together, after solve() [N].
    Vec3 reaction() const noexcept;

private:
    void evaluate();
    double rounding() const noexcept;
    void precondition(std::vector<double>& values);

    const ElasticBody& body_;
    WindowStack stack_;
    Multigrid multigrid_;
    std::vector<double> u_, load_, gradient_;  // by Layout of the finest window (3 count x 1)
    double residual_ = 0;                      // norm of the gradient over that of the load [-]
};

}  // namespace palpate::chainmail
