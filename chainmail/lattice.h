#pragma once

#include <volume/geometry.h>
#include <volume/tissue_table.h>

#include <glm/common.hpp>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate::chainmail {

using Node = std::uint32_t;

/// How far a link may go, relative to its rest length [m].
struct LinkLimits {
    float shorter = 0;  // by how much it may shorten, >= 0
    float longer = 0;   // by how much it may lengthen, >= 0
    float shear = 0;    // by how much its ends may shift across it, >= 0
};

/// Which nodes there are and what links them: const while a session runs.
///
/// A node stands for the tissue in one cell of `grid`. Its six links go to the nodes beside it along the axes:
///
///     side 0: -x   1: +x   2: -y   3: +y   4: -z   5: +z
///
/// Each end gives half of a link, so its limits are the means of both ends' tissues.
struct Lattice {
    /// @param grid    where the nodes are at rest; the outermost layer of it is left empty, so that every node has six
    ///                neighbours in memory
    /// @param tissue  row of the table at each node; 0 = no node there (count x 1)
    Lattice(const volume::NodeGrid& grid, std::vector<std::uint8_t> tissue, const volume::TissueTable& table);

    volume::NodeGrid grid;
    std::vector<std::uint8_t> tissue;  // (count x 1)
    std::vector<std::uint8_t> fixed;   // not 0 for tissue that is held in space, by row
    std::vector<LinkLimits> limits;    // by row of one end * rows + row of the other
    std::size_t rows = 0;

    bool isFixed(Node n) const noexcept { return fixed[tissue[n]] != 0; }
    const LinkLimits& between(Node a, Node b) const noexcept { return limits[tissue[a] * rows + tissue[b]]; }
    /// What lies beside node `n`: a node, or a place without tissue.
    Node beside(Node n, int side) const noexcept { return n + step[static_cast<std::size_t>(side)]; }
    bool isNode(Node n) const noexcept { return tissue[n] != 0; }

    std::array<Node, 6> step{};  // offset of the neighbour on each side, modulo 2^32
};

/// By how much the end `b` of a link would have to move to make it legal [m].
///
/// With du = u_b - u_a and the link on side 2 k (+ 1 when b lies ahead of a):
///
///     -shorter <= +-du_k <= longer   and   |du_t| <= shear for both other axes t
inline Vec3f correction(Vec3f du, int side, const LinkLimits& limits) noexcept
{
    const int axis = side / 2;
    const bool ahead = side % 2 != 0;
    Vec3f low(-limits.shear);
    Vec3f high(limits.shear);
    low[axis] = ahead ? -limits.shorter : -limits.longer;
    high[axis] = ahead ? limits.longer : limits.shorter;
    return glm::clamp(du, low, high) - du;
}

}  // namespace palpate::chainmail
