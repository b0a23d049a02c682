#include <chainmail/elastic_body.h>

#include <chainmail/cell_levels.h>
#include <chainmail/cut_cells.h>
#include <chainmail/free_way.h>
#include <chainmail/held_nodes.h>
#include <chainmail/narrow_gaps.h>
#include <volume/relaxation.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace palpate::chainmail {

namespace {

constexpr int fewestNodes = 9;     // the coarsest level has at most as many along each side
constexpr double cellUnder = 0.6;  // depth under the surface at which a place's tissue is taken [cells]

// Nodes along each side, so that every level has whole cells: a multiple of 2^(levels - 1) cells.
Index3 paddedNodes(Index3 cells, int& levels)
{
    levels = 1;
    const int longest = std::max({cells.x, cells.y, cells.z});
    while (((longest - 1) >> (levels - 1)) + 2 > fewestNodes) {
        ++levels;
    }
    const int unit = 1 << (levels - 1);
    return (cells + unit - 1) / unit * unit + 1;
}

volume::Relaxation relaxationOf(const volume::CellMaterial& material, bool relaxes)
{
    volume::Relaxation relaxation;
    for (std::size_t i = 0; i < material.relaxing.size() && relaxes; ++i) {
        relaxation.weights[i] = static_cast<double>(material.relaxing[i]);
    }
    return relaxation;
}

FinestLevel finest(const volume::NodeGrid& cells, std::vector<volume::CellMaterial>& materials, double poissonCap,
                   Index3 size, bool relaxes)
{
    FinestLevel all;
    CellLevel& level = all.level;
    level.nodes = {size, cells.origin - 0.5 * cells.spacing, cells.spacing};
    level.mu.assign(level.nodes.count(), 0.0F);
    level.lambda.assign(level.nodes.count(), 0.0F);
    level.stiffening.assign(level.nodes.count(), 0.0F);
    all.mostlyHeld = heldNodes(cells, level.nodes, materials);
    level.fixed = all.mostlyHeld;
    all.held.assign(level.nodes.count(), 0.0F);
    for (auto& weights : level.relaxing) {
        weights.assign(relaxes ? level.nodes.count() : 0, 0.0F);
    }
    volume::forEachIndex(Index3(0), cells.size - 1, [&](Index3 c) {
        const auto& m = materials[cells.offset(c)];
        if (m.youngsModulus <= minTissue) {
            return;
        }
        const double nu = std::min(static_cast<double>(m.poissonRatio), poissonCap);
        const double e = static_cast<double>(m.youngsModulus) * relaxationOf(m, relaxes).instantaneous();
        const std::size_t at = level.nodes.offset(c);
        for (std::size_t i = 0; i < level.relaxing.size() && relaxes; ++i) {
            level.relaxing[i][at] = m.relaxing[i];
        }
        level.mu[at] = static_cast<float>(e / (2.0 * (1.0 + nu)));
        level.lambda[at] = static_cast<float>(e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)));
        level.stiffening[at] = m.stiffening;
        all.held[at] = m.fixed;
        if (m.along > 1.0F) {
            all.mixed.push_back({c, m.along, m.share, m.middle, m.normal});
        }
        if (m.fixed >= whollyHeld) {
            volume::forEachIndex(c, c + 1, [&](Index3 n) { level.fixed[level.nodes.offset(n)] = 1; });
        }
    });
    return all;
}

// What a place on the surface moves with.
struct Anchor {
    Vec3 at{0.0};
    Index3 cell{0};  // of the tissue under the place
};

// Finds the nearest point of a cell that holds the tissue under a place. A surface that runs along the border of two cells
// may lie in the empty one; beside a narrow gap it may lie in a cell whose nodes are those of the other side, and so may
// the cell under it. Of a thin part the cell under the place may be of what lies behind it.
class Anchors {
public:
    Anchors(const CellLevel& tissue, const CellLevel& divided, const volume::DistanceField& surface)
        : tissue_(tissue), divided_(divided), surface_(surface)
    {
    }

    Anchor of(Vec3 on, Vec3 normal, Index3 under) const
    {
        const auto& g = tissue_.nodes;
        const Vec3 way = cellUnder * g.spacing * normal;
        const Index3 inner = g.cellAt(on - 2.0 * way);
        const bool isInner = surface_.at(on - 2.0 * way) < -1.2 * cellUnder * g.spacing && isTissue(inner) &&
                             !shareNode(divided_, under, inner);
        const Index3 own = isInner ? inner : under;
        const Index3 cell = g.cellAt(on);
        if (isTissue(cell) && shareNode(divided_, cell, own)) {
            return {on, own};
        }
        if (isTissue(cell) && !isInner && surface_.at(on - way) > 0.0) {
            return {on, cell};
        }
        const Vec3 edge(1e-3 * g.spacing);
        return {glm::clamp(on, g.position(own) + edge, g.position(own + 1) - edge), own};
    }

private:
    bool isTissue(Index3 cell) const
    {
        return tissue_.nodes.contains(cell) && tissue_.mu[tissue_.nodes.offset(cell)] > 0.0F;
    }

    const CellLevel& tissue_;
    const CellLevel& divided_;
    const volume::DistanceField& surface_;
};

// Of sub-cells along a cell, in which surface points sit: two, and more where a small tool would fall between the points.
int pointsPerEdge(double spacing, double toolRadius)
{
    constexpr int fewest = 2;
    constexpr int most = 8;
    return toolRadius > 0.0 ? std::clamp(static_cast<int>(std::ceil(2.0 * spacing / toolRadius)), fewest, most) : fewest;
}

// Shear modulus that a tool meets on each cell. Where layers share one, a patch about as wide as the cell meets what is
// under them if they are thin, and them alone if they are thick: between harmonic and arithmetic mean by their share.
std::vector<float> touchedModuli(const FinestLevel& all)
{
    std::vector<float> mu = all.level.mu;
    for (const MixedCell& m : all.mixed) {
        mu[all.level.nodes.offset(m.cell)] *= std::pow(m.along, 2.0F * m.share - 1.0F);
    }
    return mu;
}

// What a cell with little tissue lacks of the compliance under a contact. It takes its strain further in than its tissue
// lies (withoutSliver()), by `inwards` along the surface's normal, in halves of a cell. Fitted to a ball on a half-space,
// see ResolvedShare.
float sliverLacks(const CellLevel& finest, Vec3 anchor, Vec3 normal)
{
    constexpr double most = 0.26;
    const Cut cut = cutOf(finest, finest.nodes.cellAt(anchor));
    const double inwards = std::abs(glm::dot(Vec3(cut.middle - withoutSliver(cut).middle), normal));
    const auto share = static_cast<double>(cut.share);
    return static_cast<float>(most * std::sqrt(share) * inwards - 0.02 * (1.0 - share));
}

// The surface as points with areas: in every sub-cell near it the distance field gives the nearest point, and a hat as wide
// as the sub-cell looks along the normal shares the area among the sub-cells that see the same piece.
// Source: B. Engquist, A.-K. Tornberg, R. Tsai, "Discretization of Dirac delta functions in level set methods", J. Comput.
// Phys. 207, 2005.
void addSurface(const volume::NodeGrid& cells, const volume::DistanceField& surface, int perEdge, const FinestLevel& all,
                ElasticBody& body)
{
    const CellLevel& finest = all.level;
    const std::vector<float> touched = touchedModuli(all);
    const Anchors anchors(finest, body.levels.front(), surface);
    const double sub = cells.spacing / perEdge;
    body.pieceEdge = sub;
    volume::forEachIndex(Index3(1), cells.size - 2, [&](Index3 c) {
        const Vec3 middle = cells.position(c);
        if (std::abs(surface.at(middle)) > 1.9 * cells.spacing) {
            return;
        }
        SurfaceCell run{c, static_cast<std::uint32_t>(body.points.size()), 0};
        volume::forEachIndex(Index3(0), Index3(perEdge - 1), [&](Index3 s) {
            const Vec3 p = middle + sub * (Vec3(s) + 0.5 - 0.5 * perEdge);
            const Vec3 normal = surface.normal(p);
            const double width = sub * (std::abs(normal.x) + std::abs(normal.y) + std::abs(normal.z));
            const double distance = surface.at(p);
            const double hat = 1.0 - std::abs(distance) / width;
            const Vec3 on = p - distance * normal;
            const Index3 under = finest.nodes.cellAt(on - cellUnder * cells.spacing * normal);
            if (hat <= 0.0 || !finest.nodes.contains(under)) {
                return;
            }
            const Anchor anchor = anchors.of(on, normal, under);
            // A cell that the surface runs through is as much softer as it is less full.
            const double full = std::clamp(0.5 - surface.at(cells.position(anchor.cell)) / cells.spacing, 0.5, 1.0);
            const float mu = touched[finest.nodes.offset(anchor.cell)] / static_cast<float>(full);
            if (mu > 0.0F) {
                body.points.push_back({Vec3f(on), Vec3f(anchor.at), Vec3f(normal),
                                       static_cast<float>(sub * sub * sub * hat / width), mu,
                                       sliverLacks(finest, anchor.at, normal)});
                ++run.count;
            }
        });
        if (run.count > 0) {
            body.cells.push_back(run);
        }
    });
}

// Nodes in one to two layers of cells under the surface that have tissue in all cells around them, which none of the gaps
// divides.
void addSubsurface(const volume::DistanceField& surface, const CellLevel& finest, ElasticBody& body)
{
    constexpr double least = 0.5, most = 2.5;  // depth under the surface [cells]
    const volume::NodeGrid& nodes = finest.nodes;
    volume::forEachIndex(Index3(1), nodes.size - 2, [&](Index3 n) {
        if (finest.mu[nodes.offset(n)] <= 0.0F || finest.fixed[nodes.offset(n)] != 0) {
            return;
        }
        const double depth = -surface.at(nodes.position(n)) / nodes.spacing;
        if (depth < least || depth > most) {
            return;
        }
        float softest = std::numeric_limits<float>::max();
        volume::forEachIndex(n - 1, n, [&](Index3 cell) {
            const bool isWhole = finest.fragments.in(cell, nodes.size.y).empty();
            softest = std::min(softest, isWhole ? finest.mu[nodes.offset(cell)] : 0.0F);
        });
        if (softest > 0.0F) {
            body.subsurface.push_back({n, softest});
        }
    });
    body.subsurfaceRows = rowsOf(body.subsurface, nodes.size, &SubsurfaceNode::node);
}

// The cells that the body's surface cuts.
void addCuts(const volume::NodeGrid& cells, const std::vector<volume::CellMaterial>& materials,
             const volume::DistanceField& surface, CellLevel& level)
{
    volume::forEachIndex(Index3(0), cells.size - 1, [&](Index3 c) {
        const volume::CellMaterial& m = materials[cells.offset(c)];
        if (level.mu[level.nodes.offset(c)] > 0.0F && m.fraction < wholeCell) {
            const Cut cut = cutBy(surface, cells.position(c), cells.spacing, m);
            if (!cut.isWhole()) {
                level.cuts.push_back({c, cut});
            }
        }
    });
    level.cutRows = rowsOf(level.cuts, level.nodes.size, &CutCell::cell);
}

}  // namespace

bool shareNode(const CellLevel& level, Index3 a, Index3 b) noexcept
{
    if (a == b || level.fragments.cells.empty()) {
        return true;
    }
    const auto nodesOf = [&](Index3 cell) {
        std::array<std::uint32_t, 8> nodes{};
        for (int i = 0; i < 8; ++i) {
            nodes[static_cast<std::size_t>(i)] = static_cast<std::uint32_t>(level.nodes.offset(cell + octant(i)));
        }
        const auto own = level.fragments.in(cell, level.nodes.size.y);
        return own.empty() ? nodes : own.front().nodes;
    };
    const auto other = nodesOf(b);
    return std::ranges::any_of(nodesOf(a), [&](std::uint32_t n) { return std::ranges::find(other, n) != other.end(); });
}

ElasticBody elasticBody(const volume::NodeGrid& cells, std::vector<volume::CellMaterial> materials,
                        const volume::DistanceField& surface, double poissonCap, double toolRadius, bool relaxes,
                        const std::optional<volume::Support>& support)
{
    ElasticBody body;
    body.relaxes = relaxes;
    int levels = 1;
    const Index3 size = paddedNodes(cells.size, levels);
    findStops(cells, materials, {size, cells.origin - 0.5 * cells.spacing, cells.spacing}, body);
    FinestLevel all = finest(cells, materials, poissonCap, size, relaxes);
    all.octants = octantsOf(cells, materials, all.level);
    addCuts(cells, materials, surface, all.level);
    body.levels = cellLevels(all, static_cast<std::size_t>(levels), support, surface);
    addSurface(cells, surface, pointsPerEdge(cells.spacing, toolRadius), all, body);
    addSubsurface(surface, body.levels.front(), body);
    body.rows = rowsOf(body.cells, body.levels.front().nodes.size, &SurfaceCell::cell);
    return body;
}

}  // namespace palpate::chainmail
