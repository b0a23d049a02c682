#include <occupancy/occupancy_map.h>

#include <glm/common.hpp>

#include <cassert>

namespace palpate::occupancy {

// Tissue may bulge out of the lattice's box by this many elements before it shares the outermost cells.
constexpr int margin = 4;

OccupancyMap::OccupancyMap(const volume::NodeGrid& grid, std::span<const std::uint8_t> solid)
    : grid_(grid),
      cells_{grid.size + Index3(2 * margin), grid.origin - margin * grid.spacing, grid.spacing},
      nearHome_(0.49F * static_cast<float>(grid.spacing)),
      head_(cells_.count(), none),
      next_(grid.count(), none),
      previous_(grid.count(), none),
      cell_(grid.count(), none),
      isHome_(grid.count(), 1)
{
    assert(solid.size() == grid.count());
    for (std::size_t e = 0; e < solid.size(); ++e) {
        if (solid[e] != 0) {
            const auto cell = cells_.offset(grid.node(e) + Index3(margin));
            link(static_cast<Element>(e), static_cast<std::uint32_t>(cell));
        }
    }
}

Index3 OccupancyMap::cellAt(Vec3 p) const noexcept
{
    // Clamped first, rounding towards zero is rounding down.
    const Vec3 g = (p - cells_.origin) / cells_.spacing + 0.5;
    return Index3(glm::clamp(g, Vec3(0.0), Vec3(cells_.size - Index3(1))));
}

void OccupancyMap::place(Element e, Vec3f u) noexcept
{
    const Index3 node = grid_.node(e);
    const auto cell = static_cast<std::uint32_t>(cells_.offset(cellAt(grid_.position(node) + Vec3(u))));
    if (cell != cell_[e]) {
        isHome_[e] = cell == cells_.offset(node + Index3(margin)) ? 1 : 0;
        unlink(e);
        link(e, cell);
        ++rewrites_;
    }
}

void OccupancyMap::unlink(Element e) noexcept
{
    const Element before = previous_[e];
    const Element behind = next_[e];
    if (before == none) {
        head_[cell_[e]] = behind;
    } else {
        next_[before] = behind;
    }
    if (behind != none) {
        previous_[behind] = before;
    }
}

void OccupancyMap::link(Element e, std::uint32_t cell) noexcept
{
    const Element first = head_[cell];
    head_[cell] = e;
    next_[e] = first;
    previous_[e] = none;
    cell_[e] = cell;
    if (first != none) {
        previous_[first] = e;
    }
}

}  // namespace palpate::occupancy
