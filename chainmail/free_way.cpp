#include <chainmail/free_way.h>

#include <chainmail/cell_rows.h>
#include <chainmail/held_nodes.h>

#include <glm/common.hpp>

#include <algorithm>
#include <bit>
#include <cmath>

namespace palpate::chainmail {

namespace {

constexpr int maxSteps = 256;     // along a way through the tissue
constexpr double mostHeld = 0.5;  // fraction of the tissue around a place that is held, from which on the place is
constexpr int pieces = 4;         // of a capsule, between places at which it may meet what is held

// Fraction of the tissue around a place that is held, between the middles of cells. 0 outside of the grid.
double heldAt(const ElasticBody& body, Vec3 at) noexcept
{
    const auto& grid = body.levels.front().nodes;
    const auto& held = body.thick.empty() ? body.held : body.thick;
    const Vec3 cells = (at - grid.origin) / grid.spacing - 0.5;
    const Index3 low(glm::floor(cells));
    if (!grid.contains(low) || !grid.contains(low + 1)) {
        return 0.0;
    }
    const auto fraction = trilinear(cells - Vec3(low));
    double sum = 0.0;
    for (int i = 0; i < 8; ++i) {
        sum += static_cast<double>(fraction[static_cast<std::size_t>(i)] * held[grid.offset(low + octant(i))]);
    }
    return sum;
}

// Whether a place lies in thin bone, as it crosses the edges of the place's cell along an axis, between these; where it
// crosses less than half of them, it does so in the next cell.
bool isInThinBone(const ElasticBody& body, Vec3 at, int axis) noexcept
{
    const auto& grid = body.levels.front().nodes;
    const Index3 cell = grid.cellAt(at);
    if (body.thinBone.empty() || !grid.contains(cell)) {
        return false;
    }
    const auto row = static_cast<std::size_t>(cell.y + cell.z * grid.size.y);
    const auto found = inRow(body.thinBone, body.thinRows, row, cell.x, cell.x, &ThinBone::cell);
    if (found.empty()) {
        return false;
    }
    const Vec3 in = (at - grid.position(cell)) / grid.spacing;
    double weight = 0.0, from = 0.0, to = 0.0;
    for (int e = 4 * axis; e < 4 * axis + 4; ++e) {
        const std::uint8_t on = found.front().edges[static_cast<std::size_t>(e)];
        if (on != 0) {
            const Vec3 share = glm::mix(1.0 - in, in, Vec3(volume::HeldParts::startOf(e)));
            const double own = share[(axis + 1) % 3] * share[(axis + 2) % 3];
            weight += own;
            from += own * std::countr_zero(on) / 8.0;
            to += own * (1.0 - std::countl_zero(on) / 8.0);
        }
    }
    return weight >= 0.5 && in[axis] * weight >= from && in[axis] * weight <= to;
}

// How far a place gets on its way until it is in what is held [m].
double freeWay(const ElasticBody& body, Vec3 from, Vec3 inward, double way) noexcept
{
    const Vec3 size = glm::abs(inward);
    const int axis = size.x > size.y && size.x > size.z ? 0 : size.y >= size.z ? 1 : 2;
    const double steps = body.thinBone.empty() ? 4.0 : 8.0;  // in a cell
    const double step = std::max(body.levels.front().nodes.spacing / steps, way / maxSteps);
    double before = 0.0;
    for (double t = 0.0; t < way + step; t += step) {
        const double here = heldAt(body, from + t * inward);
        if (here >= mostHeld) {
            return here > before ? std::max(t - step * (here - mostHeld) / (here - before), 0.0) : t;
        }
        if (isInThinBone(body, from + t * inward, axis)) {
            double out = std::max(t - step, 0.0), in = t;
            for (int i = 0; i < 6; ++i) {
                const double middle = 0.5 * (out + in);
                (isInThinBone(body, from + middle * inward, axis) ? in : out) = middle;
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
    body.held.assign(nodes.count(), 0.0F);
    volume::forEachIndex(Index3(0), cells.size - 1, [&](Index3 c) {
        body.held[nodes.offset(c)] = heldIn(c);
        const auto& edges = materials[cells.offset(c)].held.edges;
        bool isThin = heldIn(c) > 0.0F && std::ranges::any_of(edges, [](std::uint8_t on) { return on != 0; });
        volume::forEachIndex(glm::max(c - 1, Index3(0)), glm::min(c + 1, cells.size - 1),
                             [&](Index3 near) { isThin = isThin && heldIn(near) < whollyHeld; });
        if (isThin) {
            body.thinBone.push_back({c, edges});
        }
    });
    body.thinRows = rowsOf(body.thinBone, nodes.size, &ThinBone::cell);
    if (!body.thinBone.empty()) {
        body.thick = body.held;
        for (const ThinBone& bone : body.thinBone) {
            body.thick[nodes.offset(bone.cell)] = 0.0F;
        }
    }
}

}  // namespace palpate::chainmail
