#pragma once

#include <chainmail/elastic_body.h>
#include <chainmail/held_nodes.h>

#include <optional>
#include <vector>

namespace palpate::chainmail {

/// A cell of several tissues, see volume::CellMaterial.
struct MixedCell {
    Index3 cell{0};
    float along = 1;
    float share = 0;
    Vec3f middle{0.0F};
    Vec3f normal{0.0F};
};

/// The finest level, and what coarser ones need to know of its cells.
struct FinestLevel {
    CellLevel level;          // without layers, `diagonal` and `radius`
    std::vector<float> held;  // fraction of each cell's tissue that is held in space (count x 1)
    /// Not 0 for the nodes that heldNodes() finds (count x 1). `level.fixed` holds more: all nodes of a cell
    /// whose tissue is held, also those that it does not reach, where it is bone beside air. Coarser levels do not inherit
    /// these.
    std::vector<std::uint8_t> mostlyHeld;
    std::vector<MixedCell> mixed;  // by z, then y, then x
    /// Which eighths of each cell count as tissue, a bit for each, x fastest (octantsOf()): gaps between these divide the
    /// finest level, too (count x 1). Empty: gaps are looked for between whole cells.
    std::vector<std::uint8_t> octants;
};

/// The levels of a body from its finest on, each twice as coarse as the one before.
/// @param count    of levels
/// @param support  what holds a body in which no tissue is fixed; `held` is what lies behind it then
/// @param surface  signed distance to the body's surface at rest [m]
std::vector<CellLevel> cellLevels(const FinestLevel& finest, std::size_t count,
                                  const std::optional<volume::Support>& support, const volume::DistanceField& surface);

}  // namespace palpate::chainmail
