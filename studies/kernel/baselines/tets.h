#pragma once

#include <volume/tissue.h>

#include <array>
#include <cstdint>
#include <vector>

namespace palpate::studies {

/// A body as tetrahedra, with a grid of cells in which they are found.
struct TetBody {
    volume::NodeGrid corners;                        // of the cells; cell n lies between corners n and n + 1
    std::vector<Vec3> points;                        // at rest [m]                                       (points x 3)
    std::vector<std::uint8_t> held;                  // not 0 for points that do not move                 (points x 1)
    std::vector<std::uint8_t> outer;                 // not 0 for points of the surface                   (points x 1)
    std::vector<std::array<std::uint32_t, 4>> tets;  // points, det(b - a, c - a, d - a) > 0                (tets x 4)
    std::vector<double> mu;                          // Lame's second parameter [Pa]                        (tets x 1)
    std::vector<double> lambda;                      // Lame's first parameter [Pa]                         (tets x 1)
    std::vector<std::uint32_t> first;                // in `inCell`, of a cell by its lowest corner, and one more at the end
    std::vector<std::uint32_t> inCell;               // tetrahedra that reach into each cell

    bool moves(std::size_t tet) const noexcept;  // one of its points is free
    void add(const std::array<std::uint32_t, 4>& tet, double youngsModulus, double poisson);
};

/// Poisson's ratio at which linear tetrahedra do not lock yet [-].
inline constexpr double unlockedPoisson = 0.45;
/// Fraction of a body's depth that is held when nothing else is, as volume::Tissue::support() has it [-].
inline constexpr double onItsBack = 0.05;

/// The body on a lattice: five tetrahedra to a cell, mirrored from cell to cell so that they meet. Points of the surface
/// lie on it: the lattice's corners there are moved to it, as far as no tetrahedron gets thin; flat ones between points of
/// the surface are left out. Source: F. Labelle, J. R. Shewchuk, "Isosurface stuffing: fast tetrahedral meshes with good
/// dihedral angles", ACM Trans. Graphics 26, 2007.
///
/// Cells that are half or more full make the body, with the modulus of what is in them; half or more fixed tissue holds
/// their points. A body without fixed tissue lies on its back, as volume::Tissue::support() has it. Parts that hang on
/// nothing are left out. Throws std::runtime_error when nothing is left, or when it would have over `maxPoints`.
///
/// @param surface     signed distance to the body's surface at rest [m]
/// @param spacing     of the cells [m]
/// @param poissonCap  Poisson's ratios above are lowered to this [-], under 0.5
TetBody latticeTets(const volume::Tissue& tissue, const volume::DistanceField& surface, double spacing, double poissonCap,
                    std::size_t maxPoints = 400000);

/// Gradients of the four barycentric coordinates, and the volume.
struct TetShape {
    std::array<Vec3, 4> gradient;  // [1/m]
    double volume = 0;             // [m^3]
};
TetShape shapeOf(const TetBody& mesh, std::size_t tet);

/// Linear stiffness of a tetrahedron: block (a, b) is what point b's displacement does to the force on point a [N/m].
std::array<std::array<Mat3, 4>, 4> stiffnessOf(const TetBody& mesh, std::size_t tet);

/// Where a point at rest lies in the mesh.
struct TetPlace {
    std::array<std::uint32_t, 4> points{};
    std::array<double, 4> weights{};  // barycentric; none below 0
};
/// The tetrahedron around it; of a point outside of all, what is nearest among the cells around.
TetPlace placeOf(const TetBody& mesh, Vec3 rest);

/// Value at a place of the field that is `at(point)`.
template <typename Field>
Vec3 valueAt(const TetPlace& place, Field&& at)
{
    Vec3 sum(0.0);
    for (std::size_t i = 0; i < 4; ++i) {
        sum += place.weights[i] * at(place.points[i]);
    }
    return sum;
}

}  // namespace palpate::studies
