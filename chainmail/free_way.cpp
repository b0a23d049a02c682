#include <chainmail/free_way.h>

#include <chainmail/cell_rows.h>
#include <chainmail/held_nodes.h>

#include <glm/common.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

namespace palpate::chainmail {

namespace {

using Edges = std::array<std::uint8_t, volume::HeldParts::edgeCount>;  // HeldParts::edges

constexpr int maxSteps = 256;     // along a way through the tissue
constexpr double mostHeld = 0.5;  // fraction of the tissue around a place that is held, from which on the place is
constexpr int pieces = 4;         // of a capsule, between places at which it may meet what is held
constexpr int bisections = 6;     // of a step
constexpr std::array nearCells{0, 1, -1, 2, -2};  // along an axis, in which a plate may cross the edges of a line

// Fraction of the tissue around a place that is held, between the middles of cells. 0 outside of the grid.
double heldAt(const ElasticBody& body, Vec3 at) noexcept
{
    const auto& grid = body.levels.front().nodes;
    const Vec3 cells = (at - grid.origin) / grid.spacing - 0.5;
    const Index3 low(glm::floor(cells));
    if (!grid.contains(low) || !grid.contains(low + 1)) {
        return 0.0;
    }
    const auto fraction = trilinear(cells - Vec3(low));
    double sum = 0.0;
    for (int i = 0; i < 8; ++i) {
        sum += static_cast<double>(fraction[static_cast<std::size_t>(i)] * body.held[grid.offset(low + octant(i))]);
    }
    return sum;
}

const BoneCell* boneAt(const ElasticBody& body, Index3 cell) noexcept
{
    const Index3 size = body.levels.front().nodes.size;
    if (!base::holds(size, cell)) {
        return nullptr;
    }
    const auto row = static_cast<std::size_t>(cell.y + cell.z * size.y);
    const auto found = inRow(body.bone, body.boneRows, row, cell.x, cell.x, &BoneCell::cell);
    return found.empty() ? nullptr : &found.front();
}

// A place between where a plate of bone begins and ends along an axis, both in cells from the place.
struct Across {
    double weight = 0.0;  // of the lines of edges around the place that the plate crosses, bilinear
    double from = 0.0, to = 0.0;
};

// By the four edges of the place's cell along the axis; where one is not crossed, by the next ones in its line.
Across acrossPlate(const ElasticBody& body, Index3 cell, Vec3 in, int axis) noexcept
{
    Across sum;
    std::array<const BoneCell*, nearCells.size()> around{};
    for (std::size_t i = 0; i < nearCells.size(); ++i) {
        Index3 at = cell;
        at[axis] += nearCells[i];
        around[i] = boneAt(body, at);
    }
    for (int e = 4 * axis; e < 4 * axis + 4; ++e) {
        const Vec3 share = glm::mix(1.0 - in, in, Vec3(volume::HeldParts::startOf(e)));
        const double weight = share[(axis + 1) % 3] * share[(axis + 2) % 3];
        bool isFound = false;
        for (std::size_t i = 0; i < nearCells.size() && !isFound; ++i) {
            const std::uint8_t on = around[i] != nullptr ? around[i]->edges[static_cast<std::size_t>(e)] : std::uint8_t{0};
            isFound = on != 0;
            if (isFound) {
                sum.weight += weight;
                sum.from += weight * (nearCells[i] + std::countr_zero(on) / 8.0 - in[axis]);
                sum.to += weight * (nearCells[i] + 1.0 - std::countl_zero(on) / 8.0 - in[axis]);
            }
        }
    }
    return sum;
}

// Where a plate of thin bone runs through a place's cell across an axis, whether the place is in the plate; elsewhere,
// whether half of the tissue around it is held: over that, which is 1 or more in it.
double inHeld(const ElasticBody& body, Vec3 at, int axis) noexcept
{
    constexpr double half = 0.5;  // of the lines
    const auto& grid = body.levels.front().nodes;
    const Index3 cell = grid.cellAt(at);
    const BoneCell* own = body.bone.empty() ? nullptr : boneAt(body, cell);
    if (own != nullptr && own->isPlate) {
        const Across plate = acrossPlate(body, cell, (at - grid.position(cell)) / grid.spacing, axis);
        if (plate.weight >= half) {
            return plate.from <= 0.0 && plate.to >= 0.0 ? 1.0 : 0.0;
        }
    }
    return heldAt(body, at) / mostHeld;
}

// How far a place gets on its way until it is in what is held [m].
double freeWay(const ElasticBody& body, Vec3 from, Vec3 inward, double way) noexcept
{
    const Vec3 size = glm::abs(inward);
    const int axis = size.x > size.y && size.x > size.z ? 0 : size.y >= size.z ? 1 : 2;
    const double steps = body.bone.empty() ? 4.0 : 8.0;  // in a cell
    const double step = std::max(body.levels.front().nodes.spacing / steps, way / maxSteps);
    double before = 0.0;
    for (double t = 0.0; t < way + step; t += step) {
        const double here = inHeld(body, from + t * inward, axis);
        if (here >= 1.0 && body.bone.empty()) {
            return here > before ? std::max(t - step * (here - 1.0) / (here - before), 0.0) : t;
        }
        if (here >= 1.0) {
            double out = std::max(t - step, 0.0), in = t;
            for (int i = 0; i < bisections; ++i) {
                const double middle = 0.5 * (out + in);
                (inHeld(body, from + middle * inward, axis) >= 1.0 ? in : out) = middle;
            }
            return std::min(in, way);
        }
        before = here;
    }
    return way;
}

}  // namespace

double freeWay(const ElasticBody& body, const ElasticTool& tool, Vec3 inward, double way) noexcept
{
    const occupancy::RoundCone& s = tool.shape;
    const int places = s.a == s.b ? 0 : pieces;
    double least = way;
    for (int i = 0; i <= places; ++i) {
        const double t = places > 0 ? static_cast<double>(i) / places : 0.0;
        const Vec3 front = glm::mix(s.a, s.b, t) + glm::mix(s.radiusA, s.radiusB, t) * inward;
        least = std::min(least, freeWay(body, front - tool.pushed, inward, least));
    }
    return least;
}

void findStops(const volume::NodeGrid& cells, const std::vector<volume::CellMaterial>& materials,
               const volume::NodeGrid& nodes, ElasticBody& body)
{
    const auto heldIn = [&](Index3 c) {
        const volume::CellMaterial& m = materials[cells.offset(c)];
        return m.youngsModulus > minTissue ? m.fixed : 0.0F;
    };
    const auto edgesOf = [&](Index3 c) { return cells.contains(c) ? materials[cells.offset(c)].held.edges : Edges{}; };
    // Whether bone crosses all four lines of edges along an axis, in the cell or near it.
    const auto isPlate = [&](Index3 c, int axis) {
        int crossed = 0;
        for (std::size_t e = 4 * static_cast<std::size_t>(axis); e < 4 * static_cast<std::size_t>(axis) + 4; ++e) {
            crossed += std::ranges::any_of(nearCells, [&](int off) {
                Index3 at = c;
                at[axis] += off;
                return edgesOf(at)[e] != 0;
            });
        }
        return crossed == 4;
    };
    body.held.assign(nodes.count(), 0.0F);
    bool any = false;
    volume::forEachIndex(Index3(0), cells.size - 1, [&](Index3 c) {
        const float held = heldIn(c);
        body.held[nodes.offset(c)] = held;
        if (held <= 0.0F || held >= whollyHeld || edgesOf(c) == Edges{}) {
            return;
        }
        bool isThin = true;
        volume::forEachIndex(glm::max(c - 1, Index3(0)), glm::min(c + 1, cells.size - 1),
                             [&](Index3 near) { isThin = isThin && heldIn(near) < whollyHeld; });
        isThin = isThin && (isPlate(c, 0) || isPlate(c, 1) || isPlate(c, 2));
        body.bone.push_back({c, edgesOf(c), isThin});
        any = any || isThin;
    });
    if (!any) {
        body.bone.clear();
    }
    body.boneRows = rowsOf(body.bone, nodes.size, &BoneCell::cell);
}

}  // namespace palpate::chainmail
