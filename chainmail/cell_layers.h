#pragma once

#include <chainmail/cell_levels.h>

namespace palpate::chainmail {

/// True where one of the cells from `low` to `high` or around them is empty.
bool atSurface(const CellLevel& level, Index3 low, Index3 high);

/// Makes cells near the body's surface soft across it and stiff along it, where a layer stiffer than what lies under it
/// fills a part of them: see CellLayer. A whole cell of one tissue, and one that is no stiffer than what is under it, stay
/// as they are.
/// @param finest   the cells as they are, each of one material
/// @param held     fraction of each cell's tissue that is held in space: where some is, nothing changes (count x 1)
/// @param surface  signed distance to the body's surface at rest [m]
/// @param level    finest.level, which changes
void addLayers(const FinestLevel& finest, const std::vector<float>& held, const volume::DistanceField& surface,
               CellLevel& level);

}  // namespace palpate::chainmail
