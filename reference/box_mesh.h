#pragma once

#include <reference/tet_mesh.h>

#include <functional>
#include <vector>

namespace palpate::reference {

/// From `low` to `high` in cells `fine` long up to `fineTo`, each next one longer by the factor `growth`, stretched a
/// little to end at `high` [m]. Throws std::runtime_error unless low <= fineTo <= high and fine > 0.
std::vector<double> gradedCells(double low, double fineTo, double high, double fine, double growth);
/// The same mirrored: fine at the upper end.
std::vector<double> gradedDown(double low, double fineFrom, double high, double fine, double growth);

struct BoxMeshOptions {
    std::function<std::uint8_t(Vec3)> tissue;  // of a tetrahedron, by its middle [m]; none: row 0
    std::function<bool(Vec3)> held;            // faces, by their middle [m]; none: not one
};

/// A box of bricks of six tetrahedra each, along the diagonals of all bricks the same way, so that they meet.
/// @param x  where bricks end, ascending [m]; `y` and `z` alike
TetMesh boxMesh(const std::vector<double>& x, const std::vector<double>& y, const std::vector<double>& z,
                const BoxMeshOptions& options);

/// A ball of tissue 1 about the origin in an eighth of a box of tissue 0, x, y, z >= 0; no face is held. Bricks conform to
/// the ball: inside it, they go from a small cube to the sphere; outside, from the sphere to the box.
/// @param radius  of the ball [m]
/// @param side    of the box [m]
/// @param cells   along a side of the inner cube
TetMesh ballInBox(double radius, double side, int cells);

/// A quarter of a square slab, x, y >= 0, top at z = 0, lower face held, whose faces conform to a disc in the top's middle.
struct DiscInSlab {
    double radius = 0;     // of the disc [m]
    double side = 0;       // half of the square's [m]
    double thickness = 0;  // [m]
    double fine = 0;       // cells at the disc's edge and under it [m]
    double growth = 1.5;   // of cells from there
    double fineTo = 0;     // depth to which they are fine [m]
    int around = 4;        // cells along an eighth of the disc's edge
};
TetMesh discInSlab(const DiscInSlab& shape);

}  // namespace palpate::reference
