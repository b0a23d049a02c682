#pragma once

#include <chainmail/cell_rows.h>
#include <volume/geometry.h>
#include <volume/tissue.h>

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace palpate::chainmail {

inline constexpr std::uint32_t noFragment = std::numeric_limits<std::uint32_t>::max();

/// Of the eight cells, or nodes, at a place: number `i`, x fastest, from the lowest one; and the reverse.
inline Index3 octant(int i) noexcept
{
    return {i & 1, i >> 1 & 1, i >> 2};
}
inline int octantOf(Index3 off) noexcept
{
    return off.x + 2 * off.y + 4 * off.z;
}

/// A further node where a level has one: for tissue that does not hang together there with the tissue of that node.
struct VirtualNode {
    Index3 at{0};
    float diagonal = 0;  // of the operator [N/m]
    bool isFixed = false;
};

/// A part of a coarse cell's tissue with nodes of its own, at least at one corner: across a gap that is narrower than the
/// cell the body does not hang together.
struct CellFragment {
    Index3 cell{0};
    /// Of its corners, x fastest: a node of the level, or from their count on a virtual node of it.
    std::array<std::uint32_t, 8> nodes{};
    float mu = 0, lambda = 0, stiffening = 0;  // as those of a cell
    std::array<float, volume::relaxationTerms> relaxing{};
    float held = 0;             // fraction of its tissue that is held in space
    std::uint8_t children = 0;  // the next finer level's cells in it, a bit for each, x fastest; without their fragments
    std::uint32_t parent = noFragment;  // fragment of the next coarser level that it lies in; none: in the cell itself
};

/// How a node follows the next coarser level, where it or one of the nodes that it follows is virtual: by the mean.
struct NodeLink {
    Index3 at{0};
    std::uint32_t node = 0;                  // a node of the level, or from their count on a virtual node of it
    std::uint8_t count = 0;                  // of `parents`
    std::array<std::uint32_t, 8> parents{};  // the same of the next coarser level
};

/// Tissue of one level on both sides of gaps that its cells are too wide for.
///
/// A coarse cell stores the energy of the tissue in it. Where two parts of the body lie in one cell or beside one node,
/// and do not hang together there, they would move as one: two fingers would be a hand without them. So each part gets
/// nodes and cells of its own, which share places with the others' but not displacements. What hangs together is decided on
/// the finest level, by cells that share a node. Sources: N. Molino, Z. Bao, R. Fedkiw, "A virtual node algorithm for
/// changing mesh topology during simulation", ACM Trans. Graphics 23, 2004; M. Nesme, P. G. Kry, L. Jerabkova, F. Faure,
/// "Preserving topology and elasticity for embedded deformable models", ACM Trans. Graphics 28, 2009.
struct Fragments {
    std::vector<VirtualNode> nodes;
    std::vector<CellFragment> cells;      // by z, then y, then x
    std::vector<std::uint32_t> rows;      // first of `cells` in row (y, z), at y + z * nodes along y; none: no fragments
    std::vector<NodeLink> links;          // by z, then y, then x
    std::vector<std::uint32_t> linkRows;  // the same of `links`

    /// Those of one cell. @param sizeY  the level's nodes along y
    std::span<const CellFragment> in(Index3 cell, int sizeY) const noexcept { return cellsOf(cell, cell.x, sizeY); }
    /// Index of the one in which a cell of the next finer level lies, without its fragments; noFragment: none.
    std::uint32_t holding(Index3 child, int sizeY) const noexcept
    {
        for (const CellFragment& f : in(child / 2, sizeY)) {
            if ((f.children >> octantOf(child % 2) & 1) != 0) {
                return static_cast<std::uint32_t>(&f - cells.data());
            }
        }
        return noFragment;
    }
    /// Those of the cells from `low` on of a row. @param last  along x
    std::span<const CellFragment> cellsOf(Index3 low, int last, int sizeY) const noexcept
    {
        return inRow(cells, rows, rowOf(low, sizeY), low.x, last, &CellFragment::cell);
    }
    std::span<const NodeLink> linksOf(Index3 low, int last, int sizeY) const noexcept
    {
        return inRow(links, linkRows, rowOf(low, sizeY), low.x, last, &NodeLink::at);
    }

private:
    static std::size_t rowOf(Index3 cell, int sizeY) noexcept { return static_cast<std::size_t>(cell.y + cell.z * sizeY); }
};

}  // namespace palpate::chainmail
