#pragma once

#include <chainmail/fragments.h>
#include <volume/scalar_field.h>
#include <volume/tissue.h>

namespace palpate::chainmail {

/// Fraction of a cell that is tissue from which on all of it is.
inline constexpr float wholeCell = 0.98F;

/// What the parts of a cell's tissue make together.
class CutSum {
public:
    /// @param share   of the cell that the part fills
    /// @param middle  of the part, -1 to 1 along each edge of the cell
    /// @param second  moment of the part around its middle, in the same measure: 1/3 of a part as large as the cell
    void add(double share, Vec3 middle, Vec3 second) noexcept;
    /// The cell `child`, 0 or 1 along each axis, of a level twice as fine.
    void add(const Cut& cell, Index3 child) noexcept;
    /// Whole where nothing was added, or as good as whole.
    Cut cut() const noexcept;

private:
    double share_ = 0.0;
    Vec3 first_{0.0}, second_{0.0};
};

/// Of a cell that the surface cuts, by samples of the distance to it; where the surface passes it by, as it may where
/// tissue is thinner than a cell, by its eighths.
/// @param middle    of the cell [m]
/// @param edge      of the cell [m]
/// @param material  what fills it
Cut cutBy(const volume::DistanceField& surface, Vec3 middle, double edge, const volume::CellMaterial& material);

/// The same of tissue that fills at least 0.55 of the cell, for the finest level. Nodes outside of the surface that hold
/// next to nothing follow a tool more slowly than others (a slide at 80 mm/s over turned cells rippled by 8 % in place of
/// 4), and a small contact on a sliver is too soft.
Cut withoutSliver(const Cut& cut) noexcept;

}  // namespace palpate::chainmail
