#include <chainmail/held_nodes.h>

#include <chainmail/fragments.h>

#include <glm/common.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <utility>

namespace palpate::chainmail {

namespace {

class HeldNodes {
public:
    HeldNodes(const volume::NodeGrid& cells, const volume::NodeGrid& nodes, std::vector<volume::CellMaterial>& materials)
        : cells_(cells), nodes_(nodes), materials_(materials), held_(nodes.count(), 0)
    {
    }

    std::vector<std::uint8_t> find()
    {
        holdMostly();
        std::vector<Index3> bone;
        volume::forEachIndex(Index3(0), cells_.size - 1, [&](Index3 c) {
            const volume::CellMaterial& m = materialAt(c);
            if (m.fixed > 0.0F && m.youngsModulus > minTissue) {
                bone.push_back(c);
            }
        });
        std::vector<std::size_t> thin;
        for (const auto step : {&HeldNodes::crossEdges, &HeldNodes::partSides, &HeldNodes::holdNearest}) {
            const std::size_t before = thin.size();
            for (const Index3 c : bone) {
                (this->*step)(c, thin);
            }
            for (std::size_t i = before; i < thin.size(); ++i) {
                held_[thin[i]] = 1;
            }
        }
        compensate(bone);
        return std::move(held_);
    }

private:
    const volume::CellMaterial& materialAt(Index3 cell) const { return materials_[cells_.offset(cell)]; }
    bool isHeld(Index3 node) const { return held_[nodes_.offset(node)] != 0; }
    bool hasHeld(Index3 cell) const
    {
        bool any = false;
        volume::forEachIndex(cell, cell + 1, [&](Index3 n) { any = any || isHeld(n); });
        return any;
    }
    // Of the cells around a node.
    Index3 firstAround(Index3 node) const { return glm::max(node - 1, Index3(0)); }
    Index3 lastAround(Index3 node) const { return glm::min(node, cells_.size - 1); }

    // Where the surface of bone runs through cells, the nodes on its side of it; and those of cells of bone alone that it
    // reaches.
    void holdMostly()
    {
        volume::forEachIndex(Index3(0), cells_.size, [&](Index3 n) {
            float held = 0.0F, filled = 0.0F;
            bool isReached = false;
            volume::forEachIndex(firstAround(n), lastAround(n), [&](Index3 c) {
                const volume::CellMaterial& m = materialAt(c);
                const float tissue = m.youngsModulus > minTissue ? m.fraction : 0.0F;
                held += m.fixed * tissue;
                filled += tissue;
                isReached = isReached || (tissue > 0.0F && m.fixed >= whollyHeld && reaches(m, n - c));
            });
            const bool isMostly = held > 0.0F && held >= 0.5F * whollyHeld * filled;
            held_[nodes_.offset(n)] = isMostly || isReached ? 1 : 0;
        });
    }

    // Whether bone lies at a corner of a cell on one of its edges.
    static bool reaches(const volume::CellMaterial& m, Index3 corner) noexcept
    {
        bool any = false;
        forEachEdge(m, [&](int low, int high, unsigned on) {
            any = any || (octant(low) == corner && (on & 0x01U) != 0) || (octant(high) == corner && (on & 0x80U) != 0);
        });
        return any;
    }

    // Eighths of an edge between its end and bone on it.
    static int gapAt(unsigned on, int side) noexcept
    {
        return side == 0 ? std::countr_zero(on) : std::countl_zero(static_cast<std::uint8_t>(on));
    }

    // Calls visit(lower node, higher node, eighths of the edge on bone) for the edges of a cell; nodes as octants.
    template <typename Visit>
    static void forEachEdge(const volume::CellMaterial& m, const Visit& visit)
    {
        for (int e = 0; e < volume::HeldParts::edgeCount; ++e) {
            const int low = octantOf(volume::HeldParts::startOf(e));
            visit(low, low + (1 << (e / 4)), static_cast<unsigned>(m.held.edges[static_cast<std::size_t>(e)]));
        }
    }

    void crossEdges(Index3 cell, std::vector<std::size_t>& found) const
    {
        forEachEdge(materialAt(cell), [&](int low, int high, unsigned on) {
            if (on != 0 && !isHeld(cell + octant(low)) && !isHeld(cell + octant(high))) {
                const int nearest = gapAt(on, 1) < gapAt(on, 0) ? high : low;
                found.push_back(nodes_.offset(cell + octant(nearest)));
            }
        });
    }

    // Where free nodes of a cell lie on two sides of bone, those of the nearer side, if they are near: the strain of their
    // cell would move what lies behind.
    void partSides(Index3 cell, std::vector<std::size_t>& found) const
    {
        constexpr double near = 0.5;  // [cells]
        const volume::CellMaterial& m = materialAt(cell);
        std::array<std::size_t, 8> side{0, 1, 2, 3, 4, 5, 6, 7};
        std::array<bool, 8> isFree{};
        for (std::size_t i = 0; i < 8; ++i) {
            isFree[i] = !isHeld(cell + octant(static_cast<int>(i)));
        }
        forEachEdge(m, [&](std::size_t low, std::size_t high, unsigned on) {
            if (on == 0 && isFree[low] && isFree[high]) {
                std::ranges::replace(side, side[high], side[low]);
            }
        });
        std::array<double, 8> gaps;  // of each node [cells]
        gaps.fill(1.0);
        forEachEdge(m, [&](std::size_t low, std::size_t high, unsigned on) {
            gaps[low] = on != 0 ? std::min(gaps[low], gapAt(on, 0) / 8.0) : gaps[low];
            gaps[high] = on != 0 ? std::min(gaps[high], gapAt(on, 1) / 8.0) : gaps[high];
        });
        std::array<double, 8> farthest{};  // of each side
        for (std::size_t i = 0; i < 8; ++i) {
            farthest[side[i]] = std::max(farthest[side[i]], gaps[i]);
        }
        std::size_t nearest = 8, sides = 0;
        for (std::size_t i = 0; i < 8; ++i) {
            if (isFree[i] && side[i] == i) {
                ++sides;
                nearest = nearest == 8 || farthest[i] < farthest[nearest] ? i : nearest;
            }
        }
        for (std::size_t i = 0; i < 8 && sides > 1 && farthest[nearest] <= near; ++i) {
            if (side[i] == nearest) {
                found.push_back(nodes_.offset(cell + octant(static_cast<int>(i))));
            }
        }
    }

    void holdNearest(Index3 cell, std::vector<std::size_t>& found) const
    {
        constexpr float least = 0.08F;  // of the cell
        const volume::CellMaterial& m = materialAt(cell);
        if (!hasHeld(cell) && m.fixed * m.fraction >= least) {
            found.push_back(nodes_.offset(cell + Index3(glm::greaterThan(m.held.middle, Vec3f(0.0F)))));
        }
    }

    void compensate(const std::vector<Index3>& bone)
    {
        constexpr float flow = 1.5F;  // a layer that is pressed together alone: 1; one that flows sideways: 3
        std::vector<std::pair<std::size_t, float>> longer;  // cells, by how much [cells]
        for (const Index3 c : bone) {
            leaveOut(c, longer);
        }
        for (const auto& [at, by] : longer) {
            materials_[at].youngsModulus /= std::pow(1.0F + by, flow);
        }
    }

    // Takes what lies between held faces of a cell and bone across it out of the cell, along the axis with most of that:
    // an oblique plate may cross the cell along several.
    void leaveOut(Index3 cell, std::vector<std::pair<std::size_t, float>>& longer)
    {
        int along = 0;
        std::array<float, 2> gaps{};
        for (int axis = 0; axis < 3; ++axis) {
            const std::array<float, 2> own{gapTo(cell, axis, 0), gapTo(cell, axis, 1)};
            if (own[0] + own[1] > gaps[0] + gaps[1]) {
                gaps = own;
                along = axis;
            }
        }
        if (gaps[0] + gaps[1] == 0.0F) {
            return;
        }
        for (int side = 0; side < 2; ++side) {
            Index3 next = cell;
            next[along] += 2 * side - 1;
            const float gap = gaps[static_cast<std::size_t>(side)];
            if (gap > 0.0F && next == glm::clamp(next, Index3(0), cells_.size - 1)) {
                longer.emplace_back(cells_.offset(next), gap);
            }
        }
        constexpr float least = 1.0F / 32.0F;  // of a cell's tissue that counts as strained: so it is not wholly held
        volume::CellMaterial& m = materials_[cells_.offset(cell)];
        const float held = std::max(std::min(m.fixed + gaps[0] + gaps[1], 1.0F - least), m.fixed);
        m.youngsModulus *= held > m.fixed ? (1.0F - m.fixed) / (1.0F - held) : 1.0F;
        m.fixed = held;
    }

    // Between a face of a cell, if all of it is held, and bone that crosses all edges from there on [cells]; or 0.
    float gapTo(Index3 cell, int axis, int side) const
    {
        const volume::HeldParts& parts = materialAt(cell).held;
        int sum = 0;
        for (int e = 4 * axis; e < 4 * axis + 4; ++e) {
            const unsigned on = parts.edges[static_cast<std::size_t>(e)];
            Index3 end = cell + volume::HeldParts::startOf(e);
            end[axis] += side;
            if (on == 0 || !isHeld(end)) {
                return 0.0F;
            }
            sum += gapAt(on, side);
        }
        return static_cast<float>(sum) / 32.0F;
    }

    const volume::NodeGrid& cells_;
    const volume::NodeGrid& nodes_;
    std::vector<volume::CellMaterial>& materials_;
    std::vector<std::uint8_t> held_;
};

// Held nodes with tissue within a node of one, only in its plane across `axis`, if that is one.
int heldAround(const CellLevel& level, Index3 node, std::optional<int> axis)
{
    const auto& g = level.nodes;
    Index3 reach(1);
    if (axis) {
        reach[*axis] = 0;
    }
    int held = 0;
    volume::forEachIndex(glm::max(node - reach, Index3(0)), glm::min(node + reach, g.size - 1), [&](Index3 n) {
        held += level.fixed[g.offset(n)] != 0 && level.diagonal[g.offset(n)] > 0.0F ? 1 : 0;
    });
    return held;
}

}  // namespace

void holdThin(const CellLevel& fine, CellLevel& coarse)
{
    constexpr int fewest = 3;  // held nodes in the plane
    std::vector<std::size_t> found;
    const auto& g = coarse.nodes;
    for (int axis = 0; axis < 3; ++axis) {
        Index3 step(0);
        step[axis] = 1;
        volume::forEachIndex(Index3(0), g.size - 1 - step, [&](Index3 n) {
            const std::size_t low = g.offset(n), high = g.offset(n + step), at = fine.nodes.offset(2 * n + step);
            const bool isHeld = fine.fixed[at] != 0 && fine.diagonal[at] > 0.0F;
            if (isHeld && coarse.fixed[low] == 0 && coarse.fixed[high] == 0 &&
                heldAround(fine, 2 * n + step, axis) >= fewest) {
                const bool isHigh = heldAround(fine, 2 * (n + step), {}) > heldAround(fine, 2 * n, {});
                found.push_back(isHigh ? high : low);
            }
        });
    }
    for (const std::size_t at : found) {
        coarse.fixed[at] = 1;
    }
}

std::vector<std::uint8_t> heldNodes(const volume::NodeGrid& cells, const volume::NodeGrid& nodes,
                                    std::vector<volume::CellMaterial>& materials)
{
    return HeldNodes(cells, nodes, materials).find();
}

}  // namespace palpate::chainmail
