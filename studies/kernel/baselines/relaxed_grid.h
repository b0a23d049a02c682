#pragma once

#include <chainmail/window.h>
#include <studies/kernel/baselines/fifo_mail.h>

#include <span>
#include <vector>

namespace palpate::studies {

/// A rigid sphere that tissue cannot enter.
struct RigidSphere {
    Vec3 centre{0.0};   // [m]
    double radius = 0;  // [m]
};

/// A surface node that the sphere may touch.
struct ContactNode {
    std::size_t at = 0;    // in the layout
    chainmail::Node node;  // in the level
    Vec3 rest{0.0};        // [m]
    double surface =
        0;             // signed distance at rest to the body's surface [m]: what the sphere meets lies so much further out
    Vec3 normal{0.0};  // out of the sphere, where the node is now
    bool active = false;  // the sphere holds it
};

/// Linear elasticity on the nodes of one grid, relaxed by projected Jacobi sweeps under a frictionless sphere:
///
///     u <- u - w D^-1 A u,   then nodes that the sphere would cover are put on its surface, along the normal
///
/// A is the trilinear brick of chainmail/kernels.h. A node on the sphere stays there while its residual pushes, and leaves
/// it when the residual pulls. With more than one sweep the weights w are those of Chebyshev's polynomial over the upper
/// part of the spectrum, in cycles of five at most. Sources: O. L. Mangasarian, "Solution of Symmetric Linear
/// Complementarity Problems by Iterative Methods", J. Optim. Theory Appl. 22, 1977 (projected sweeps); D. Young, "On
/// Richardson's Method for Solving Linear Systems with Positive Definite Matrices", J. Math. Phys. 32, 1953 (the weights).
class RelaxedGrid {
public:
    /// @param level    outlives it
    /// @param surface  signed distance to the body's surface at rest [m]
    /// @param reach    box that holds all that the sphere may touch [m]
    RelaxedGrid(const chainmail::CellLevel& level, const volume::DistanceField& surface, const volume::Box& reach);

    /// The sphere has moved: puts the nodes that it covers on its surface, and forgets which it held.
    /// @returns  how many
    std::size_t project(const RigidSphere& sphere) noexcept;
    void sweep(const RigidSphere& sphere, int count) noexcept;
    /// Force on the sphere [N]: what the held nodes push back, along their normals.
    Vec3 force();

    /// Nodes that the sphere covers, with the displacement that puts each on its surface: the seeds of a predictor.
    std::size_t wayTo(const RigidSphere& sphere, std::vector<chainmail::Seed>& out) const;
    /// Adds to the displacement of a node of the level [m].
    void add(chainmail::Node node, Vec3f du) noexcept;

    /// Of the material that is at `rest`, see valueAt() [m].
    Vec3 displacement(Vec3 rest) const noexcept;
    /// Largest displacement that a sweep of weight 1 would still make [m]. Lets nodes go that pull.
    double imbalance() noexcept;
    std::span<const ContactNode> contacts() const noexcept { return contacts_; }
    /// Nodes that are tissue.
    std::size_t nodes() const noexcept { return nodes_; }

private:
    void findContacts(const volume::DistanceField& surface, const volume::Box& reach);
    std::size_t putOn(const RigidSphere& sphere) noexcept;
    void letGo(double fraction) noexcept;

    const chainmail::CellLevel& level_;
    chainmail::Window window_;  // the box of the body's nodes
    chainmail::Floats scratch_;
    std::vector<ContactNode> contacts_;
    std::size_t nodes_ = 0;
    // For force(): the cells around the contacts.
    chainmail::Floats partMu_, partLambda_, partU_, partA_;
};

/// Plain ChainMail on the nodes of a level, for the increment of one tick. All links let pass the same strain, whatever the
/// tissue: an increment follows the shape of the body more than its moduli. In proportion to softness a stiff skin would
/// take the increment all over the body, with ten times the error.
class IncrementMail {
public:
    explicit IncrementMail(const chainmail::CellLevel& level);

    /// The increment that these seeds cause.
    /// @param strain  that links let pass [-]
    /// @returns  nodes that moved, seeds included
    std::span<const chainmail::Node> spread(std::span<const chainmail::Seed> seeds, double strain);
    Vec3f increment(chainmail::Node n) const noexcept { return du_[n]; }

private:
    chainmail::Lattice lattice_;
    FifoScratch scratch_;
    std::vector<Vec3f> du_;  // [m] (count x 3)
};

}  // namespace palpate::studies
