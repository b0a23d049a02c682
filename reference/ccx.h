#pragma once

#include <reference/solve.h>

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace palpate::reference {

/// Corners of the tetrahedra, then the middles of their edges [m]: nodes of quadratic elements as ccxText() numbers them,
/// from 1.
std::vector<Vec3> quadraticNodes(const TetMesh& mesh);

/// Whether CalculiX can take this: throws std::runtime_error ("FILE: ..") for tissue of the mesh that stiffens with finite
/// strain. To be asked before something is solved for `file`.
void checkCcx(const TetMesh& mesh, std::span<const Material> materials, Law law, const std::filesystem::path& file);

/// What Solver::prescribe() solves with P2 elements as input of CalculiX: C3D10, mm and kPa, `*ELASTIC`, or
/// `*HYPERELASTIC, NEO HOOKE` with `NLGEOM`, whose energy is that of the reference where nothing stiffens: C10 = mu/2, D1 =
/// 2/K; the kernel's is another (volume/law.h). Source: G. Dhondt, "CalculiX CrunchiX User's Manual", version 2.20.
/// @pre  checkCcx()
std::string ccxText(const TetMesh& mesh, std::span<const Material> materials, const SolveOptions& options,
                    const Patch& patch);

struct CcxSolution {
    std::vector<Vec3> u;  // at quadraticNodes() [m]
    Vec3 force{0.0};      // on what prescribes, as Solver::force() [N]
};

/// A rigid sphere without friction that goes from place to place in a body.
struct CcxPress {
    std::vector<std::uint32_t> held;  // points of the mesh that do not move
    double radius = 0;                // [m]
    Vec3 start{0.0};                  // its centre, where nothing touches yet [m]
    std::vector<Vec3> centres;        // after each step [m]
};

/// Writes that as input of CalculiX: C3D10 and `*HYPERELASTIC, NEO HOOKE` as ccxText() has them, for each centre a
/// `*STEP, NLGEOM` in which the sphere goes there and one in which it rests; the part of the sphere that looks
/// where it goes first is a shell of hexahedra that is moved as a whole, contact surface to surface with a linear pressure
/// of 50 times the softest modulus per mm. Throws std::runtime_error as checkCcx(), and for a file that cannot be written.
void exportCcxPress(const TetMesh& mesh, std::span<const Material> materials, const CcxPress& press,
                    const std::filesystem::path& file);

/// Whether the program `ccx` is there.
bool hasCcx();
/// Runs it on an exported file, in that file's folder. Throws std::runtime_error when it fails.
CcxSolution runCcx(const std::filesystem::path& file);
/// The same with an export of exportCcxPress(): one solution per centre, the force on the sphere.
/// @param steps  centres that were exported
std::vector<CcxSolution> runCcxPress(const std::filesystem::path& file, std::size_t steps);

}  // namespace palpate::reference
