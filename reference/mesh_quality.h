#pragma once

#include <reference/tet_mesh.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace palpate::reference {

/// What became of one tissue.
struct TissueQuality {
    std::uint8_t row = 0;    // of the tissue table
    double voxels = 0;       // volume of its voxels [m^3]
    double mesh = 0;         // volume of its tetrahedra [m^3]
    double thickness = 0;    // mean, of the voxels: twice volume by surface [m]
    bool thin = false;       // thinner than the mesh's edges: its volume is not kept
    std::size_t tets = 0;    // tetrahedra
    double minDihedral = 0;  // [degrees]; 0 where there is no tetrahedron

    double percent() const noexcept { return voxels > 0.0 ? 100.0 * (mesh / voxels - 1.0) : 0.0; }
};

/// How good a mesh is.
struct MeshQuality {
    std::size_t points = 0, tets = 0;
    std::size_t outside = 0;                      // faces of one tetrahedron
    std::size_t between = 0;                      // faces between two tissues
    std::size_t overShared = 0;                   // faces of more than two tetrahedra: none in a mesh
    std::size_t flipped = 0;                      // tetrahedra of no or negative volume: none in a mesh
    double minDihedral = 0, largestDihedral = 0;  // [degrees]
    double medianDihedral = 0;                    // of the least one of each tetrahedron [degrees]
    std::size_t under10 = 0;                      // tetrahedra with a dihedral angle under 10 degrees
    std::size_t worst = 0;                        // tetrahedron with the least dihedral angle
    Vec3 worstAt{0.0};                            // its middle [m]
    double worstRadii = 0;  // the smallest radius of the inner by a third of that of the outer sphere, of all [-]
    double shortest = 0, longest = 0;  // edge [m]
    std::vector<TissueQuality> tissues;
};

/// Least and largest dihedral angle of one tetrahedron [degrees].
std::pair<double, double> dihedralsOf(const TetMesh& mesh, std::size_t tet) noexcept;

/// The least one of all tetrahedra [degrees].
double smallestDihedral(const TetMesh& mesh) noexcept;

/// Dihedral angle of a tetrahedron of these points that is nearest to 0 or 180 degrees, from there; -1 where it is flipped
/// or a point is no number [degrees].
double worstDihedral(const TetMesh& mesh, const std::array<std::uint32_t, 4>& tet) noexcept;

/// @param tissues  with row, voxels and thickness; the rest is filled in
/// @param edge     of the mesh's facets: what is thinner is thin [m]
MeshQuality qualityOf(const TetMesh& mesh, std::vector<TissueQuality> tissues, double edge);

}  // namespace palpate::reference
