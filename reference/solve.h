#pragma once

#include <reference/tet_mesh.h>
#include <volume/law.h>

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace palpate::reference {

using volume::Exponential;
using volume::Law;
using volume::NeoHookean;
using volume::SmallStrain;
enum class Elements : std::uint8_t { p2, p2p1 };

/// One row of the tissue table, as the reference needs it.
struct Material {
    double youngsModulus = 0;  // [Pa]
    double poisson = 0;        // [-]
    double stiffening = 0;     // b, with finite strain, as in TissueRow [-]
};

/// A rigid sphere or capsule that tissue cannot enter; without friction.
struct RigidTool {
    Vec3 centre{0.0};   // of the sphere, or of the capsule's front end [m]
    double radius = 0;  // [m]
    Vec3 shaft{0.0};    // of a capsule, from there to the middle of its other end [m]

    /// To its surface, negative inside [m].
    double distance(Vec3 p) const noexcept;
};

/// Displacements that are prescribed where `at` gives one, on free faces only: returns false where nothing is.
struct Patch {
    std::function<bool(Vec3 rest)> in;  // a face belongs to it when all its points do
    std::function<Vec3(Vec3 rest)> u;   // [m]
    std::array<bool, 3> components{true, true, true};
};

struct SolveOptions {
    Law law = SmallStrain{};
    Elements elements = Elements::p2;
    int maxSteps = 200;              // load steps between two calls, halved ones included
    double tolerance = 1e-8;         // residual, fraction of the forces
    bool progress = false;           // a line per step on standard error
    std::array<bool, 3> mirrored{};  // the planes x, y, z = 0 are planes of symmetry: what lies on one stays on it
};

/// Equilibrium of a body of tetrahedra by finite elements (GetFEM). SI throughout.
class Solver {
public:
    /// Throws std::runtime_error for a mesh that is not one body, or has nothing held.
    /// @param materials  by row of the tissue table
    Solver(const TetMesh& mesh, std::span<const Material> materials, const SolveOptions& options);
    ~Solver();

    /// Presses the tool: goes there from the last state in load steps, halved where Newton's method fails. Contact by
    /// augmented Lagrangian. Throws std::runtime_error ("does not converge at ... mm of ... mm: what to do").
    void press(const RigidTool& tool);
    /// Prescribes displacements, in load steps from rest.
    void prescribe(const Patch& patch);

    /// On the tool, or on what prescribes [N].
    Vec3 force() const;
    double energy() const;  // of the tissue [J]
    /// (count x 3) [m]; points outside take the nearest tetrahedron's.
    std::vector<Vec3> displacement(std::span<const Vec3> rest) const;
    /// Mean over each tetrahedron of the Cauchy stress (count x 6: xx yy zz yz xz xy) [Pa].
    std::vector<std::array<double, 6>> stress() const;
    std::size_t unknowns() const;
    int newtonSteps() const;  // of the last call

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::reference
