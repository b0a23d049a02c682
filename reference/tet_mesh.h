#pragma once

#include <volume/geometry.h>

#include <array>
#include <cstdint>
#include <vector>

namespace palpate::reference {

/// Tetrahedra that conform to the surfaces between tissues.
struct TetMesh {
    std::vector<Vec3> points;                        // [m]                                    (count x 3)
    std::vector<std::array<std::uint32_t, 4>> tets;  // points, det(b - a, c - a, d - a) > 0   (count x 4)
    std::vector<std::uint8_t> tissue;                // row of the tissue table of each tet    (count x 1)

    /// A triangle on the outside.
    struct Face {
        std::array<std::uint32_t, 3> points;  // counterclockwise seen from outside
        std::uint32_t tet = 0;
        bool held = false;  // fixed tissue or bone lies behind it: it does not move
    };
    std::vector<Face> faces;
};

}  // namespace palpate::reference
