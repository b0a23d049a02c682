#pragma once

#include <reference/tet_mesh.h>
#include <volume/geometry.h>

#include <array>
#include <cstdint>
#include <vector>

namespace palpate::reference {

/// Triangles between tissues: each once, all of one complex, so that none crosses another. Lines where more than two meet
/// are allowed.
struct Surfaces {
    static constexpr std::uint8_t outside = 0;  // air: row 0 of every tissue table

    struct Facet {
        std::array<std::uint32_t, 3> points;  // counterclockwise seen from `front`
        std::uint8_t front = outside;         // row of the tissue table on the side that the normal points to
        std::uint8_t back = outside;          // on the other
    };

    /// A point well inside one connected piece of a tissue.
    struct Seed {
        Vec3 point{0.0};          // [m]
        std::uint8_t tissue = 0;  // row of the tissue table
    };

    std::vector<Vec3> points;   // [m] (count x 3)
    std::vector<Facet> facets;  // (count x 1)
    std::vector<Seed> seeds;    // one per piece (count x 1)
};

/// Whether surfaces have all points of a mesh, or those of their facets only.
enum class AllPoints : std::uint8_t { no, yes };

/// Faces between tetrahedra of different tissues, and those on the outside. The seed of a piece is the middle of the
/// sphere in its roundest and largest tetrahedron.
Surfaces surfacesOf(const TetMesh& mesh, AllPoints all = AllPoints::no);

/// Volume that the surfaces enclose, by the divergence theorem [m^3] (256 x 1, by row of the tissue table).
std::vector<double> enclosedVolumes(const Surfaces& surfaces);

}  // namespace palpate::reference
