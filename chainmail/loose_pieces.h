#pragma once

#include <volume/tissue.h>

#include <optional>
#include <vector>

namespace palpate::chainmail {

/// Holds what would float: pieces of tissue (cells that share a face) in which nothing is held lie on their backs. Of each
/// the hindmost twentieth, at least one layer of cells, is held, as volume::Support does for a body without fixed tissue.
/// Crumbs of under 64 cells stay as they are.
/// @param cells      the grid of `materials`, one per cell
/// @param support    holds what is behind it
/// @returns          how many pieces were held
int holdLoosePieces(const volume::NodeGrid& cells, std::vector<volume::CellMaterial>& materials,
                    const std::optional<volume::Support>& support);

}  // namespace palpate::chainmail
