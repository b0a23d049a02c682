#pragma once

#include <chainmail/elastic_body.h>

#include <cstdint>
#include <vector>

namespace palpate::chainmail {

/// Which eighths of the level's cells hold tissue, so that none touches one across a gap: FinestLevel::octants. Empty where
/// all of them do.
///
/// A cell has those of its eighths that are mostly tissue (CellMaterial::octants). Of those that share a corner, two are
/// apart if the quarters of cells with tissue in their middle (CellMaterial::quarters) do not hang together, face by face,
/// within two cells of the corner. The side that has more left in its cells gives way then: its eighths there are left out.
/// So no cell has eighths on two sides of a gap. A cell with none left gets those that touch most others, of one side.
/// - A gap may be as narrow as a quarter of a cell, at any angle. Its end stays closed over two cells.
/// - The steps of a slanted sheet of one layer of voxels are no gaps: sides without a cube as large as a cell count as one.
/// Such
/// a
///   sheet may be cut at a step within two cells of a thick part.
/// - A cell whose eighths all touch two sides joins them.
/// O(cells that have both tissue and air), and 20 us more for each corner where tissue is apart close by.
/// @param cells      of `materials`: the first cells of the level
std::vector<std::uint8_t> octantsOf(const volume::NodeGrid& cells, const std::vector<volume::CellMaterial>& materials,
                                    const CellLevel& level);

}  // namespace palpate::chainmail
