#pragma once

#include <volume/geometry.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate::occupancy {

using Element = std::uint32_t;
inline constexpr Element none = 0xFFFFFFFF;

/// Which elements of tissue are where in space, now.
///
/// Space is divided in cells as large as an element. Every element writes itself into the cell that its deformed position
/// falls in; an element that stays in its cell is not rewritten. A cell holds any number of elements: they form a list
/// through the elements themselves, so that nothing is allocated.
///
///     head_[cell] -> element -> next_[element] -> .. -> none
///
/// The cost of a query follows the cells it visits, not the size of the grid and not the number of objects in it.
/// Source: S. F. F. Gibson, "Beyond volume rendering: visualization, haptic exploration, and physical modelling of
/// voxel-based objects", Visualization in Scientific Computing 1995. Lists mend its "two objects cannot share a cell".
class OccupancyMap {
public:
    /// Elements are the nodes of `grid` with solid[node] != 0 (count x 1), each at its node.
    OccupancyMap(const volume::NodeGrid& grid, std::span<const std::uint8_t> solid);

    /// Element `e` is `u` [m] away from its node now. O(1), allocates nothing.
    void displace(Element e, Vec3f u) noexcept
    {
        // Up to half a spacing away it is in its node's cell; most are.
        if (isHome_[e] == 0 || std::max({std::abs(u.x), std::abs(u.y), std::abs(u.z)}) > nearHome_) {
            place(e, u);
        }
    }

    /// Calls visit(element) for every element in the cells that the box [low, high] touches [m].
    template <typename Visit>
    void visit(Vec3 low, Vec3 high, Visit&& visitElement) const noexcept
    {
        const Index3 first = cellAt(low), last = cellAt(high);
        const auto inRow = static_cast<std::size_t>(last.x - first.x) + 1;
        volume::forEachIndex(first, {first.x, last.y, last.z}, [&](Index3 cell) {
            for (const Element head : std::span(head_).subspan(cells_.offset(cell), inRow)) {
                for (Element e = head; e != none; e = next_[e]) {
                    visitElement(e);
                }
            }
        });
    }

    /// How many elements changed their cell since the map was made.
    std::uint64_t rewrites() const noexcept { return rewrites_; }

private:
    void place(Element e, Vec3f u) noexcept;
    Index3 cellAt(Vec3 p) const noexcept;
    void unlink(Element e) noexcept;
    void link(Element e, std::uint32_t cell) noexcept;

    volume::NodeGrid grid_;             // of the elements
    volume::NodeGrid cells_;            // node = middle of a cell; a margin wider than the lattice
    float nearHome_;                    // a little under half a spacing [m]
    std::vector<Element> head_;         // first element of each cell   (cells x 1)
    std::vector<Element> next_;         // the one behind it            (elements x 1)
    std::vector<Element> previous_;     // the one before it            (elements x 1)
    std::vector<std::uint32_t> cell_;   // the cell of each element     (elements x 1)
    std::vector<std::uint8_t> isHome_;  // not 0 where that is its node's (elements x 1)
    std::uint64_t rewrites_ = 0;
};

}  // namespace palpate::occupancy
