#pragma once

#include <reference/factor.h>
#include <reference/solve.h>
#include <reference/tissue_terms.h>

#include <memory>
#include <span>
#include <vector>

namespace palpate::reference {

/// The body as GetFEM sees it: quadratic displacement, and linear pressure where asked for, the energy of tissue and
/// contact, and its derivatives. Not SI but mm, kPa, mN and uJ, in which the numbers are near 1.
///
/// A state is the displacement, three components per node, and then the pressure. With F the deformation gradient, J its
/// determinant and I = J^(-2/3) |F|^2 - 3 the energy densities are
///
///     linear        mu |dev eps|^2 + K/2 (tr eps)^2
///     the others    mu/2 I + beyond(mu, b, I) + K/2 (J - 1)^2   K/2 x^2 as  p x - p^2 / 2K  with pressures
///
/// beyond() being the law's own, the very function that the kernel calls (volume/law.h).
///
/// Tissue stiffens by the isochoric I, which is never negative: pressure alone does not stiffen it. The kernel has a series
/// for the root in it (volume::isochoric).
///
/// The tool pushes by the augmented Lagrangian  (lambda - r gap)_+^2 / 2r  per area at rest, lambda linear on faces, gap
/// measured from where a point is to the tool itself, at small strain too.
/// Sources: Y. Renard, K. Poulios, "GetFEM: Automated FE Modeling of Multiphysics Problems Based on a Generic Weak Form
/// Language", ACM Trans. Math. Softw. 47, 2020; P. Alart, A. Curnier, "A mixed formulation for frictional contact
/// problems prone to Newton like solution methods", Comput. Methods Appl. Mech. Eng. 92, 1991.
class FiniteElements {
public:
    FiniteElements(const TetMesh& mesh, std::span<const Material> materials, const SolveOptions& options);
    ~FiniteElements();

    std::size_t size() const noexcept;           // of a state
    std::size_t displacements() const noexcept;  // head of a state
    /// Where the displacement's nodes are at rest [mm].
    const std::vector<Vec3>& nodes() const noexcept;
    /// Nodes of each of TetMesh::faces (count x 6): corners are the first, the third and the last.
    const std::vector<std::array<std::uint32_t, 6>>& faceNodes() const noexcept;

    /// Whether a face is a free surface: neither held nor on a plane of symmetry (faces x 1).
    const std::vector<char>& freeFaces() const noexcept;

    double energy(const std::vector<double>& state) const;  // of the tissue [uJ]
    /// Derivative of the tissue's energy [mN].
    std::vector<double> tissueForces(const std::vector<double>& state) const;
    /// Second derivative of the energies of tissue and contact.
    SymmetricMatrix tangent(const std::vector<double>& state) const;

    void setObstacle(const Obstacle& obstacle);
    /// Looks which faces may touch: those within a quarter of the radius of the obstacle, and where multipliers are.
    void findContact(const std::vector<double>& state);
    /// Lets r grow with the area of the faces: it counts per area at rest, and under a deep tool that is many times as
    /// large.
    void stiffenContact(const std::vector<double>& state);
    /// Derivative of the contact's energy [mN]; its sum over nodes is the force on the obstacle.
    std::vector<double> contactForces(const std::vector<double>& state) const;
    /// Moves the multipliers to the pressures that act now (Uzawa's method).
    /// @returns  how deep the faces were in the obstacle, as the multipliers see it [mm]
    double updateMultipliers(const std::vector<double>& state);
    const std::vector<double>& multipliers() const noexcept;
    void setMultipliers(std::vector<double> multipliers);

    /// (count x 3) [mm]
    std::vector<Vec3> displacementAt(const std::vector<double>& state, std::span<const Vec3> rest) const;
    /// Mean Cauchy stress of each tetrahedron, xx yy zz yz xz xy (count x 6) [kPa].
    std::vector<std::array<double, 6>> meanStress(const std::vector<double>& state) const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::reference
