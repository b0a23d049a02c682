#pragma once

#include <studies/kernel/baselines/tets.h>
#include <studies/kernel/kernel_trial.h>

#include <span>
#include <vector>

namespace palpate::studies {

/// Points have the mass of tissue, although only the equilibrium counts: lighter ones need more substeps to come as near to
/// it.
struct XpbdOptions {
    int substeps = 10;      // of a tick
    double tick = 1e-3;     // [s]
    double density = 1000;  // of all tissue [kg/m^3]
    double damping = 60;    // rate at which velocities decay: critical for the slowest wave through 6 cm of fat [1/s]
};

/// Tetrahedra as constraints that are projected one after the other, with mass: extended position-based dynamics. Each has
/// a deviatoric constraint |F| and a hydrostatic one det F - 1 - mu / l with compliances 1 / (mu V) and 1 / (l V), which is
/// the stable neo-Hookean energy
///
///     W = mu / 2 (|F|^2 - 3) + l / 2 (det F - 1 - mu / l)^2,   l = lambda + mu.
///
/// Both of a tetrahedron are solved together, so that a body at rest stays at rest; one pass over all tetrahedra per
/// substep, its order turned round from substep to substep. A sphere pushes surface points out of itself after each pass.
///
/// Sources: M. Macklin, M. Mueller, "A Constraint-based Formulation of Stable Neo-Hookean Materials", Motion, Interaction
/// and Games 2021; M. Macklin et al., "Small Steps in Physics Simulation", Symposium on Computer Animation 2019.
class Xpbd {
public:
    Xpbd(TetBody mesh, const XpbdOptions& options);

    /// One tick in which the sphere goes from where it was to `centre` [m]; without a radius there is none.
    chainmail::ElasticResult step(Vec3 centre, double radius);
    Vec3 displacement(Vec3 rest) const;    // [m]
    Vec3 force() const { return force_; }  // on the tool, mean over the last tick [N]
    double energy() const;                 // of the tissue [J]
    Vec3 momentum() const;                 // [kg m/s]
    std::size_t touched() const noexcept { return touched_; }
    const TetBody& mesh() const noexcept { return mesh_; }
    std::span<Vec3f> velocities() noexcept { return std::span(velocity_).first(mesh_.points.size()); }
    std::span<const Vec3f> displacements() const noexcept { return std::span(u_).first(mesh_.points.size()); }

private:
    static constexpr std::size_t lanes = 8;

    /// Tetrahedra without a common point, side by side.
    struct Batch {
        std::uint32_t points[4][lanes];
        float mass[4][lanes];         // inverse [1/kg]
        float gradient[3][3][lanes];  // of the last three points' coordinates [1/m]
        float deviatoric[lanes];      // compliance over the substep's square [1/kg]
        float hydrostatic[lanes];     //
        float rest[lanes];            // 1 + mu / l
    };

    void weigh();
    void addBatches();
    void fill(Batch& batch, std::size_t lane, std::size_t tet) const;
    void project(const Batch& batch);
    void push(Vec3 centre, double radius);

    TetBody mesh_;
    XpbdOptions options_;
    float substep_;  // [s]
    std::vector<Batch> batches_;
    std::vector<float> inverseMass_;     // 0 for held points [1/kg]
    std::vector<Vec3f> u_;               // [m]; one more than points, for lanes that are empty
    std::vector<Vec3f> before_;          // at the substep's start [m]
    std::vector<Vec3f> velocity_;        // [m/s]
    std::vector<std::uint32_t> outer_;   // free points of the surface
    std::vector<std::uint32_t> near_;    // those that the tool may meet in this tick
    std::vector<std::uint8_t> touches_;  // by point: not 0 when it did
    Vec3 centre_{0.0};
    bool hasCentre_ = false;
    bool backwards_ = false;
    Vec3 force_{0.0};
    std::size_t touched_ = 0;
};

TrialModel xpbdModel(TetBody mesh, const XpbdOptions& options);

}  // namespace palpate::studies
