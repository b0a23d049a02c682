#pragma once

#include <chainmail/cell_levels.h>

#include <cstdint>
#include <vector>

namespace palpate::chainmail {

/// What gaps in a level make of the next coarser one.
struct Split {
    Fragments coarse;             // without materials, links and what is fixed
    std::vector<NodeLink> links;  // of the fine level, see Fragments::links
    std::vector<std::uint32_t> linkRows;
    std::vector<std::uint32_t> parents;  // CellFragment::parent of the fine level's fragments
    std::vector<std::uint8_t> loose;     // the same of the coarse level's cells
};

/// Which cells of the finest level hang together, by nodes that they or their eighths share, with nothing that is held: not
/// 0 for these (count x 1). Splitting leaves them to what is near, since alone they would have no place of their own.
std::vector<std::uint8_t> looseCells(const CellLevel& finest, const std::vector<float>& held,
                                     const std::vector<std::uint8_t>& octants);

/// Finds what hangs together on the finest level itself, by the eighths of its cells, see FinestLevel::octants.
Split splitFinest(const CellLevel& finest, const std::vector<std::uint8_t>& loose,
                  const std::vector<std::uint8_t>& octants);

/// Finds which tissue hangs together in the cells of the next coarser level and around its nodes. What shares a node of the
/// fine level does; the rest gets fragments and virtual nodes. Where two parts meet at a node, the one of more cells keeps
/// it; loose cells never leave it. O(cells of the coarse level), and more for those at the surface.
/// @param coarse  every second node of the fine level
/// @param loose   not 0 for cells of the fine level that hang together with nothing held (count x 1)
Split splitLevel(const CellLevel& fine, const std::vector<std::uint8_t>& loose, const volume::NodeGrid& coarse);

}  // namespace palpate::chainmail
