#pragma once

#include <chainmail/lattice.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <limits>
#include <span>

namespace palpate::studies {

/// A field of nodes at `rest` [m]: trilinear over the nodes around it, those without tissue left out; where there is none
/// around, as just outside a staircase of cells, that of the nearest within two spacings, and zero beyond.
/// @param has    has(Index3): the node is tissue
/// @param value  value(Index3): the field there
template <typename Has, typename Value>
Vec3 valueAt(const volume::NodeGrid& grid, Vec3 rest, Has&& has, Value&& value)
{
    const Vec3 at = (rest - grid.origin) / grid.spacing;
    const Index3 low(glm::floor(at));
    const Vec3 t = at - Vec3(low);
    Vec3 sum(0.0), nearest(0.0);
    double fractions = 0.0, least = std::numeric_limits<double>::max();
    volume::forEachIndex(low, low + 1, [&](Index3 n) {
        if (grid.contains(n) && has(n)) {
            const Vec3 s = glm::mix(1.0 - t, t, glm::bvec3(n - low));
            sum += s.x * s.y * s.z * value(n);
            fractions += s.x * s.y * s.z;
        }
    });
    if (fractions > 1e-9) {
        return sum / fractions;
    }
    volume::forEachIndex(low - 1, low + 2, [&](Index3 n) {
        const double distance = glm::distance(Vec3(n), at);
        if (distance < least && grid.contains(n) && has(n)) {
            least = distance;
            nearest = value(n);
        }
    });
    return nearest;
}

/// Displacement of the tissue that is at `rest` by that of a lattice's nodes [m].
inline Vec3 displacementIn(const chainmail::Lattice& lattice, std::span<const Vec3f> u, Vec3 rest)
{
    return valueAt(
        lattice.grid, rest, [&](Index3 n) { return lattice.tissue[lattice.grid.offset(n)] != 0; },
        [&](Index3 n) { return Vec3(u[lattice.grid.offset(n)]); });
}

}  // namespace palpate::studies
