#pragma once

#include <studies/kernel/baselines/tets.h>
#include <studies/kernel/kernel_trial.h>

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace palpate::studies {

/// The stiffness of linear tetrahedra, factored (Eigen's sparse Cholesky decomposition).
class TetFactor {
public:
    static constexpr std::uint32_t held = ~0U;

    /// @param unknown  number of each point, `held` for those that do not move (count x 1)
    /// Throws std::runtime_error when the matrix is not positive definite: nothing holds the body.
    TetFactor(const TetBody& mesh, std::span<const std::uint32_t> unknown, std::size_t unknowns);
    ~TetFactor();

    /// Solves for several right sides at once, in place.
    /// @param columns  (count x 3 unknowns), each column contiguous
    void solve(std::span<double> columns) const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// Linear finite elements that are solved beforehand: what a unit force on each point that the tool may meet does to all
/// points. A tick finds the contact forces on the columns' rows of those points alone, and adds up the columns that push:
/// so it needs no substitution with the factors, which would read many times as much.
///
/// Flattering for the method: the tool's way is known beforehand. Columns for a whole body's surface cost the same time per
/// tick, and some ten times the memory.
///
/// The sphere is a unilateral contact without friction at the surface's points: Newton's method with an active set, from
/// the last tick's forces. Normals turn as the points move, from one of its steps to the next.
///
/// Sources: M. Bro-Nielsen, S. Cotin, "Real-time volumetric deformable models for surgery simulation using finite elements
/// and condensation", Computer Graphics Forum 15, 1996; G. Saupin, C. Duriez, S. Cotin, L. Grisoni, "Efficient contact
/// modeling using compliance warping", Computer Graphics International 2008 (contacts on a precomputed compliance).
class FactoredTets {
public:
    static constexpr std::size_t maxPoints = 30000;  // of a body: minutes to factor
    struct Contact {
        std::uint32_t point = 0;
        Vec3 u{0.0};      // [m]
        Vec3 force{0.0};  // of the tool on the tissue [N]
    };

    /// Throws std::runtime_error when the path's tool is no sphere or meets no point, and what TetFactor throws.
    FactoredTets(TetBody mesh, const TrialPath& path);

    chainmail::ElasticResult press(Vec3 centre, double radius);
    Vec3 displacement(Vec3 rest) const;  // [m]
    Vec3 force() const;                  // on the tool [N]
    std::size_t touched() const noexcept { return touched_; }
    std::span<const Contact> contacts() const noexcept { return contacts_; }  // points that may be met
    const TetBody& mesh() const noexcept { return mesh_; }

private:
    // A contact that pushes, or that is inside.
    struct Active {
        std::uint32_t contact = 0;
        Vec3 normal{0.0};  // out of the sphere
        double gap = 0;    // [m]
    };

    void findContacts(const TrialPath& path);
    void solveColumns();
    void follow();
    double meet(Vec3 centre, double radius);
    void balance();
    void addColumns();
    Vec3 pointAt(std::uint32_t p) const noexcept;

    TetBody mesh_;
    std::vector<std::uint32_t> unknown_;  // of each point, TetFactor::held for held ones
    std::size_t unknowns_ = 0;            // points
    std::vector<Contact> contacts_;
    std::vector<Active> active_;
    std::vector<Mat3> compliance_;  // [m/N]                                 (contacts x contacts)
    std::vector<float> columns_;    // displacements by unit forces [m/N]    (3 contacts x 3 unknowns)
    std::vector<float> u_;          // [m]                                   (3 unknowns)
    std::size_t touched_ = 0;
    std::size_t steps_ = 0;
    bool atRest_ = true;
};

TrialModel factoredModel(TetBody mesh, const TrialPath& path);

}  // namespace palpate::studies
