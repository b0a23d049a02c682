#include <chainmail/cell_levels.h>

#include <chainmail/block_mean.h>
#include <chainmail/cell_layers.h>
#include <chainmail/cut_cells.h>
#include <chainmail/spectral_radius.h>
#include <chainmail/split_level.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <limits>
#include <unordered_map>
#include <utility>

namespace palpate::chainmail {

namespace {

int coarseNodes(int fine)
{
    return fine / 2 + 1;
}

class Coarsening {
public:
    /// @param held  fraction of each cell's tissue that is held
    /// @param loose  see splitLevel()
    Coarsening(CellLevel& fine, const std::vector<float>& held, const std::vector<std::uint8_t>& loose)
        : fine_(fine), held_(held), loose_(loose)
    {
    }

    /// And the shares of its own cells, and which are loose. Links the fine level to it.
    CellLevel level(std::vector<float>& held, std::vector<std::uint8_t>& loose)
    {
        CellLevel coarse;
        const auto& g = fine_.nodes;
        coarse.nodes = {{coarseNodes(g.size.x), coarseNodes(g.size.y), coarseNodes(g.size.z)}, g.origin, 2.0 * g.spacing};
        const std::size_t count = coarse.nodes.count();
        coarse.mu.assign(count, 0.0F);
        coarse.lambda.assign(count, 0.0F);
        coarse.stiffening.assign(count, 0.0F);
        coarse.fixed.assign(count, 0);
        for (std::size_t i = 0; i < fine_.relaxing.size(); ++i) {
            coarse.relaxing[i].assign(relaxes() ? count : 0, 0.0F);
        }
        held.assign(count, 0.0F);
        split(coarse, loose);
        volume::forEachIndex(Index3(0), coarse.nodes.size - 2, [&](Index3 c) {
            unsigned children = 0xFF;
            for (const CellFragment& f : coarse.fragments.in(c, coarse.nodes.size.y)) {
                children &= ~static_cast<unsigned>(f.children);
            }
            const Moduli m = upscaled(2 * c, children, noFragment);
            const std::size_t at = coarse.nodes.offset(c);
            coarse.mu[at] = static_cast<float>(m.mu);
            coarse.lambda[at] = static_cast<float>(m.bulk - 2.0 / 3.0 * m.mu);
            coarse.stiffening[at] = static_cast<float>(m.stiffening);
            held[at] = static_cast<float>(m.held);
            if (const Cut cut = cutAround(2 * c, children, noFragment); !cut.isWhole()) {
                coarse.cuts.push_back({c, cut});
            }
            for (std::size_t i = 0; i < m.relaxing.size() && relaxes(); ++i) {
                coarse.relaxing[i][at] = static_cast<float>(m.relaxing[i]);
            }
        });
        coarse.cutRows = rowsOf(coarse.cuts, coarse.nodes.size, &CutCell::cell);
        volume::forEachIndex(Index3(0), coarse.nodes.size - 1,
                             [&](Index3 n) { coarse.fixed[coarse.nodes.offset(n)] = isFixed(2 * n) ? 1 : 0; });
        holdThin(fine_, coarse);
        fixFragments(coarse);
        return coarse;
    }

private:
    // Of the fine nodes around a coarse one, weighted as it interpolates to them.
    struct Shares {
        double fixed = 0, tissue = 0;
        void add(double weight, bool isFixed) noexcept
        {
            tissue += weight;
            fixed += isFixed ? weight : 0.0;
        }
        bool isMostlyFixed() const noexcept { return fixed > 0.3 * tissue; }
    };

    static double weightOf(Index3 off) noexcept { return 1.0 / static_cast<double>(1 << (off.x + off.y + off.z)); }

    // A coarse node is held where the fine one at its place is.
    bool isFixed(Index3 place) const
    {
        const bool isThere = fine_.nodes.contains(place) && fine_.diagonal[fine_.nodes.offset(place)] > 0.0F;
        return isThere ? fine_.fixed[fine_.nodes.offset(place)] != 0 : sharesAround(place).isMostlyFixed();
    }

    // One without tissue there stands for the fine ones around it. Those without tissue have no say: so the floor of a body
    // that lies between two planes of coarse nodes is held by the plane outside.
    Shares sharesAround(Index3 middle) const
    {
        Shares shares;
        const auto& g = fine_.nodes;
        volume::forEachIndex(glm::max(middle - 1, Index3(0)), glm::min(middle + 1, g.size - 1), [&](Index3 n) {
            const std::size_t at = g.offset(n);
            if (fine_.diagonal[at] > 0.0F) {
                shares.add(weightOf(glm::abs(n - middle)), fine_.fixed[at] != 0);
            }
        });
        return shares;
    }

    void split(CellLevel& coarse, std::vector<std::uint8_t>& loose)
    {
        Split found = splitLevel(fine_, loose_, coarse.nodes);
        loose = std::move(found.loose);
        coarse.fragments = std::move(found.coarse);
        fine_.fragments.links = std::move(found.links);
        fine_.fragments.linkRows = std::move(found.linkRows);
        for (std::size_t i = 0; i < found.parents.size(); ++i) {
            fine_.fragments.cells[i].parent = found.parents[i];
        }
        for (std::size_t i = 0; i < coarse.fragments.cells.size(); ++i) {
            CellFragment& f = coarse.fragments.cells[i];
            const Moduli m = upscaled(2 * f.cell, f.children, static_cast<std::uint32_t>(i));
            f.mu = static_cast<float>(m.mu);
            f.lambda = static_cast<float>(m.bulk - 2.0 / 3.0 * m.mu);
            f.stiffening = static_cast<float>(m.stiffening);
            f.held = static_cast<float>(m.held);
            f.cut = cutAround(2 * f.cell, f.children, static_cast<std::uint32_t>(i));
            for (std::size_t k = 0; k < m.relaxing.size(); ++k) {
                f.relaxing[k] = static_cast<float>(m.relaxing[k]);
            }
        }
    }

    // Where nodes share a place, each stands for the fine ones that follow it.
    void fixFragments(CellLevel& coarse) const
    {
        const std::size_t fineCount = fine_.nodes.count(), count = coarse.nodes.count();
        std::unordered_map<std::size_t, Shares> shares;  // of places, and of virtual nodes
        for (const VirtualNode& n : coarse.fragments.nodes) {
            shares.try_emplace(coarse.nodes.offset(n.at), sharesAround(2 * n.at));
        }
        for (const NodeLink& l : fine_.fragments.links) {
            const bool isVirtual = l.node >= fineCount;
            const VirtualNode fine = isVirtual ? fine_.fragments.nodes[l.node - fineCount]
                                               : VirtualNode{l.at, fine_.diagonal[l.node], fine_.fixed[l.node] != 0};
            for (std::size_t i = 0; i < l.count && fine.diagonal > 0.0F; ++i) {
                const std::uint32_t parent = l.parents[i];
                const bool isBeside = parent >= count;
                const Index3 at = isBeside ? coarse.fragments.nodes[parent - count].at : coarse.nodes.node(parent);
                const double weight = weightOf(glm::abs(l.at - 2 * at));
                if (isBeside) {
                    shares[parent].add(weight, fine.isFixed);
                }
                // A node of the level was counted as one that follows the place's own.
                if (const auto here = shares.find(coarse.nodes.offset(at)); isBeside != isVirtual && here != shares.end()) {
                    here->second.add(isBeside ? -weight : weight, fine.isFixed);
                }
            }
        }
        for (std::size_t i = 0; i < coarse.fragments.nodes.size(); ++i) {
            VirtualNode& n = coarse.fragments.nodes[i];
            n.isFixed = shares[count + i].isMostlyFixed();
            coarse.fixed[coarse.nodes.offset(n.at)] = shares[coarse.nodes.offset(n.at)].isMostlyFixed() ? 1 : 0;
        }
    }

    bool relaxes() const { return !fine_.relaxing[0].empty(); }

    // @param children  of the eight, a bit for each, and of their fragments those that lie in the coarse fragment `parent`
    Moduli upscaled(Index3 low, unsigned children, std::uint32_t parent) const
    {
        BlockSums sums;
        int child = 0;
        volume::forEachIndex(low, low + 1, [&](Index3 c) {
            const std::size_t at = fine_.nodes.offset(c);
            if (fine_.mu[at] > 0.0F && (children >> child & 1U) != 0) {
                CellFragment whole{.mu = fine_.mu[at], .lambda = fine_.lambda[at], .stiffening = fine_.stiffening[at]};
                whole.held = held_[at];
                for (std::size_t i = 0; i < whole.relaxing.size() && relaxes(); ++i) {
                    whole.relaxing[i] = fine_.relaxing[i][at];
                }
                sums.add(whole);
            }
            for (const CellFragment& f : fine_.fragments.in(c, fine_.nodes.size.y)) {
                if (f.parent == parent) {
                    sums.add(f);
                }
            }
            ++child;
        });
        return sums.moduli(parent != noFragment || atSurface(fine_, low, low + 1));
    }

    // Of the same cells.
    Cut cutAround(Index3 low, unsigned children, std::uint32_t parent) const
    {
        CutSum sum;
        for (int i = 0; i < 8; ++i) {
            const Index3 child = octant(i);
            const std::size_t at = fine_.nodes.offset(low + child);
            if (fine_.mu[at] > 0.0F && (children >> i & 1U) != 0) {
                sum.add(cutOf(fine_, low + child), child);
            }
            for (const CellFragment& f : fine_.fragments.in(low + child, fine_.nodes.size.y)) {
                if (f.parent == parent) {
                    sum.add(f.cut, child);
                }
            }
        }
        return sum.cut();
    }

    CellLevel& fine_;
    const std::vector<float>& held_;
    const std::vector<std::uint8_t>& loose_;
};

void addDiagonal(CellLevel& level)
{
    const auto& g = level.nodes;
    level.diagonal.assign(g.count(), 0.0F);
    volume::forEachIndex(Index3(0), g.size - 2, [&](Index3 c) {
        const std::size_t at = g.offset(c);
        if (level.mu[at] > 0.0F) {
            const Cut cut = cutOf(level, c);
            for (int i = 0; i < 8; ++i) {
                level.diagonal[g.offset(c + octant(i))] +=
                    diagonalOf(level.mu[at], level.lambda[at], g.spacing, cut, sideOf(i));
            }
        }
    });
    for (VirtualNode& n : level.fragments.nodes) {
        n.diagonal = 0.0F;
    }
    for (const CellFragment& f : level.fragments.cells) {
        for (int i = 0; i < 8 && f.mu > 0.0F; ++i) {
            const std::uint32_t n = f.nodes[static_cast<std::size_t>(i)];
            float& sum = n < g.count() ? level.diagonal[n] : level.fragments.nodes[n - g.count()].diagonal;
            sum += diagonalOf(f.mu, f.lambda, g.spacing, f.cut, sideOf(i));
        }
    }
    for (const CellLayer& l : level.layers) {
        const std::size_t at = g.offset(l.cell);
        const float s = level.lambda[at] / (level.lambda[at] + 2.0F * level.mu[at]);
        const float scaled = static_cast<float>(g.spacing / 32.0) * 4.0F * l.mu * (0.5F + s / 3.0F);
        for (const Vec3f& middle : {l.middle - l.half, l.middle + l.half}) {
            volume::forEachIndex(Index3(0), Index3(1), [&](Index3 n) {
                const Vec3f side = 2.0F * Vec3f(n) - 1.0F;
                const Vec3f w = 1.0F + side * middle;
                const Vec3f slope = side * Vec3f(w.y * w.z, w.z * w.x, w.x * w.y);
                const Vec3f inPlane = slope - glm::dot(slope, l.normal) * l.normal;
                level.diagonal[g.offset(l.cell + n)] += 0.5F * scaled * glm::dot(inPlane, inPlane);
            });
        }
    }
}

// Virtual nodes are held where the node at their place is.
void holdVirtual(CellLevel& level)
{
    for (VirtualNode& n : level.fragments.nodes) {
        n.isFixed = level.fixed[level.nodes.offset(n.at)] != 0;
    }
}

// Takes the stiffness from cells whose tissue is held: it is strained in none of them. A cell of bone that ends in front of
// a node would hold that node, though the tissue beside the bone is free there.
void yieldWhereHeld(const std::vector<float>& held, CellLevel& level)
{
    for (std::size_t i = 0; i < held.size(); ++i) {
        if (held[i] >= whollyHeld) {
            level.mu[i] = level.lambda[i] = 0.0F;
        }
    }
    addDiagonal(level);
}

// A body that rests on a plane. What lies behind the plane is not strained, and is left out where cells are averaged.
class Resting {
public:
    Resting(const volume::Support& support, const volume::DistanceField& surface) : support_(support), surface_(surface) {}

    // Takes what is held out of the finest cells: of a cell's modulus, E (1 - s) times the layer's 1 / (1 - s) is left, see
    // volume::CellMixture.
    static FinestLevel freePart(FinestLevel finest)
    {
        for (std::size_t i = 0; i < finest.held.size(); ++i) {
            const float left = finest.held[i] < whollyHeld ? 1.0F - finest.held[i] : 0.0F;
            finest.level.mu[i] *= left * left;
            finest.level.lambda[i] *= left * left;
            finest.held[i] = 0.0F;
        }
        return finest;
    }

    // Holds the nodes on the plane or behind it, where the body meets it, and gives the cells that it cuts the stiffness of
    // the layer that is left of them, as if it were the whole cell. What tips a body is the width of what holds it, to the
    // third power: so each level looks for itself, and does not inherit the rim of a finer one.
    void hold(CellLevel& level) const
    {
        constexpr int fewest = 4;  // nodes that hold a body in every direction
        if (hold(level, 0.0) < fewest) {
            hold(level, std::numeric_limits<double>::max());
        }
        volume::forEachIndex(Index3(0), level.nodes.size - 2, [&](Index3 c) {
            const float factor = static_cast<float>(layerFactor(level, c));
            level.mu[level.nodes.offset(c)] *= factor;
            level.lambda[level.nodes.offset(c)] *= factor;
        });
        for (CellFragment& f : level.fragments.cells) {
            const float factor = static_cast<float>(layerFactor(level, f.cell));
            f.mu *= factor;
            f.lambda *= factor;
            f.cut = factor == 1.0F ? f.cut : Cut{};
        }
        std::erase_if(level.cuts, [&](const CutCell& c) { return layerFactor(level, c.cell) != 1.0; });
        level.cutRows = rowsOf(level.cuts, level.nodes.size, &CutCell::cell);
    }

private:
    int hold(CellLevel& level, double widest) const
    {
        const auto& g = level.nodes;
        int nearest = 0;
        volume::forEachIndex(Index3(0), g.size - 1, [&](Index3 n) {
            const Vec3 p = g.position(n);
            const double height = support_.height(p);
            const bool on = height <= 1e-3 * g.spacing && stands(p, g.spacing, widest);
            level.fixed[g.offset(n)] = on ? 1 : 0;
            nearest += on && height > -g.spacing ? 1 : 0;
        });
        holdVirtual(level);
        return nearest;
    }

    // A cell around the node stands on the plane: its middle lies over the body there.
    bool stands(Vec3 node, double spacing, double widest) const
    {
        bool does = false;
        for (int i = 0; i < 8 && !does; ++i) {
            const Vec3 middle = node + spacing * (Vec3(i & 1, i >> 1 & 1, i >> 2) - 0.5);
            does = surface_.distance(middle - support_.height(middle) * support_.normal) <= widest;
        }
        return does;
    }

    // Of a cell that has a share f before the plane, filled as far as it may be: its modulus is f times that of its tissue,
    // and should be 1 / f times. As far as its nodes behind are held.
    double layerFactor(const CellLevel& level, Index3 c) const
    {
        constexpr double thinnest = 0.03;
        const auto& g = level.nodes;
        int behind = 0, held = 0;
        volume::forEachIndex(c, c + 1, [&](Index3 n) {
            const bool is = support_.height(g.position(n)) <= 1e-3 * g.spacing;
            behind += is ? 1 : 0;
            held += is && level.fixed[g.offset(n)] != 0 ? 1 : 0;
        });
        if (held == 0 || behind == 8) {
            return 1.0;
        }
        const Vec3 n = glm::abs(support_.normal);
        const double middle = support_.height(g.position(c) + 0.5 * g.spacing) / (g.spacing * (n.x + n.y + n.z));
        const double share = std::clamp(0.5 + middle, thinnest, 1.0);
        return glm::mix(1.0, 1.0 / (share * share), static_cast<double>(held) / behind);
    }

    const volume::Support& support_;
    const volume::DistanceField& surface_;
};

// What coarser levels are made of: at the surface the layers in a cell lie side by side, as in BlockMean. The finest level
// itself is soft across them, see addLayers(): what a tool presses is bent over a few cells and sheared.
CellLevel withStiffSkin(const FinestLevel& finest)
{
    CellLevel level = finest.level;
    for (const MixedCell& m : finest.mixed) {
        if (atSurface(finest.level, m.cell, m.cell)) {
            const std::size_t at = level.nodes.offset(m.cell);
            level.mu[at] *= m.along;
            level.lambda[at] *= m.along;
        }
    }
    return level;
}

// Gives the finest level the fragments that its gaps make: each is all of a cell.
void divideCells(Split split, const std::vector<float>& held, CellLevel& level)
{
    const auto& g = level.nodes;
    level.fragments = std::move(split.coarse);
    holdVirtual(level);
    for (CellFragment& f : level.fragments.cells) {
        const std::size_t at = g.offset(f.cell);
        f.mu = std::exchange(level.mu[at], 0.0F);
        f.lambda = std::exchange(level.lambda[at], 0.0F);
        f.stiffening = level.stiffening[at];
        f.held = held[at];
        f.cut = cutOf(level, f.cell);
        for (std::size_t i = 0; i < f.relaxing.size() && !level.relaxing[i].empty(); ++i) {
            f.relaxing[i] = level.relaxing[i][at];
        }
    }
}

// Takes the cells as they are, with their layers, but for those that are fragments.
void takeWhole(CellLevel whole, CellLevel& level)
{
    for (CellFragment& f : level.fragments.cells) {
        const std::size_t at = level.nodes.offset(f.cell);
        whole.mu[at] = whole.lambda[at] = 0.0F;
        f.cut = withoutSliver(f.cut);
    }
    for (CutCell& c : whole.cuts) {
        c.cut = withoutSliver(c.cut);
    }
    if (!level.fragments.cells.empty()) {
        std::erase_if(whole.layers,
                      [&](const CellLayer& l) { return !level.fragments.in(l.cell, level.nodes.size.y).empty(); });
        whole.layerRows = rowsOf(whole.layers, whole.nodes.size, &CellLayer::cell);
    }
    whole.fragments = std::move(level.fragments);
    level = std::move(whole);
    holdVirtual(level);
}

// The finest level keeps what is behind a support, for tools that come from there.
void rest(const Resting& resting, const FinestLevel& finest, std::vector<CellLevel>& levels)
{
    for (CellLevel& level : levels) {
        resting.hold(level);
    }
    for (std::size_t i = 0; i < finest.held.size(); ++i) {
        if (finest.held[i] >= whollyHeld) {
            levels.front().mu[i] = finest.level.mu[i];
            levels.front().lambda[i] = finest.level.lambda[i];
        }
    }
    for (CellLevel& level : levels) {
        addDiagonal(level);
    }
}

}  // namespace

std::vector<CellLevel> cellLevels(const FinestLevel& finest, std::size_t count,
                                  const std::optional<volume::Support>& support, const volume::DistanceField& surface)
{
    FinestLevel first = support ? Resting::freePart(finest) : finest;
    std::vector<CellLevel> levels{withStiffSkin(first)};
    levels.front().fixed = first.mostlyHeld;
    std::vector<std::uint8_t> loose = looseCells(levels.front(), finest.held, finest.octants);
    Split split;
    if (!finest.octants.empty()) {
        split = splitFinest(levels.front(), loose, finest.octants);
    }
    divideCells(std::move(split), first.held, levels.front());
    addDiagonal(levels.front());
    std::vector<std::vector<float>> held{first.held};
    while (levels.size() < count) {
        std::vector<float> coarser;
        std::vector<std::uint8_t> looser;
        levels.push_back(Coarsening(levels.back(), held.back(), loose).level(coarser, looser));
        addDiagonal(levels.back());
        held.push_back(std::move(coarser));
        loose = std::move(looser);
    }
    for (std::size_t l = 1; l < levels.size(); ++l) {
        yieldWhereHeld(held[l], levels[l]);
    }
    CellLevel whole = first.level;
    addLayers(first, finest.held, surface, whole);
    takeWhole(std::move(whole), levels.front());
    addDiagonal(levels.front());
    if (support) {
        rest(Resting(*support, surface), finest, levels);
    }
    for (CellLevel& level : levels) {
        level.radius = spectralRadius(level);
    }
    return levels;
}

}  // namespace palpate::chainmail
