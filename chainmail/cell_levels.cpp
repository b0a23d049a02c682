#include <chainmail/cell_levels.h>

#include <chainmail/cell_layers.h>
#include <chainmail/window.h>
#include <volume/cell_mixture.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>

namespace palpate::chainmail {

namespace {

constexpr int powerSteps = 30;

struct Moduli {
    double mu = 0;
    double bulk = 0;
    double stiffening = 0;
    double held = 0;                                         // fraction of the tissue
    std::array<double, volume::relaxationTerms> relaxing{};  // weights
};

int coarseNodes(int fine)
{
    return fine / 2 + 1;
}

// Energy and not volume decides: under the same strain cells side by side add their stiffness, under the same stress they
// add their compliance. Inside the body a block of eight is between the two: the geometric mean of both bounds keeps thin
// stiff layers stiff and thin gaps soft. Layers under a free surface bear no stress across, and along it they have the
// strain of the surface: their stiffness adds, as in a laminate. What is held in space gives way in neither: it leaves less
// of the block to be strained, and the rest of it by as much more. Sources: W. Voigt 1889 and A. Reuss 1929 (bounds); the
// mean as in docs/decisions.md, 8.
class BlockMean {
public:
    /// @param held  fraction of the cell's tissue that is held
    void add(double modulus, double held)
    {
        ++filled_;
        whole_ += modulus;
        const double free = 1.0 - held;
        if (free > 1.0 - static_cast<double>(whollyHeld)) {
            free_ += free;
            sum_ += free * free * modulus;
            inverse_ += 1.0 / modulus;
        }
    }
    double modulus(bool atSurface) const
    {
        if (filled_ == 0) {
            return 0.0;
        }
        const double fraction = filled_ / 8.0;
        if (free_ <= 0.0) {
            return whole_ / filled_ * fraction;
        }
        const double mean = atSurface ? sum_ / free_ : std::sqrt(sum_ / inverse_);
        return mean * filled_ / free_ * fraction;
    }

private:
    int filled_ = 0;
    double whole_ = 0.0;
    double free_ = 0.0;  // cells
    double sum_ = 0.0;   // of moduli without what is held, by share
    double inverse_ = 0.0;
};

class Coarsening {
public:
    /// @param held  fraction of each cell's tissue that is held
    Coarsening(const CellLevel& fine, const std::vector<float>& held) : fine_(fine), held_(held) {}

    /// And the shares of its own cells.
    CellLevel level(std::vector<float>& held) const
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
        volume::forEachIndex(Index3(0), coarse.nodes.size - 2, [&](Index3 c) {
            const Moduli m = upscaled(2 * c);
            const std::size_t at = coarse.nodes.offset(c);
            coarse.mu[at] = static_cast<float>(m.mu);
            coarse.lambda[at] = static_cast<float>(m.bulk - 2.0 / 3.0 * m.mu);
            coarse.stiffening[at] = static_cast<float>(m.stiffening);
            held[at] = static_cast<float>(m.held);
            for (std::size_t i = 0; i < m.relaxing.size() && relaxes(); ++i) {
                coarse.relaxing[i][at] = static_cast<float>(m.relaxing[i]);
            }
        });
        volume::forEachIndex(Index3(0), coarse.nodes.size - 1,
                             [&](Index3 n) { coarse.fixed[coarse.nodes.offset(n)] = mostlyFixed(2 * n) ? 1 : 0; });
        return coarse;
    }

private:
    // A coarse node stands for the fine ones around it, weighted as it interpolates to them. Those without tissue have no
    // say: so the floor of a body that lies between two planes of coarse nodes is held by the plane outside.
    bool mostlyFixed(Index3 middle) const
    {
        double fixed = 0.0;
        double tissue = 0.0;
        const auto& g = fine_.nodes;
        volume::forEachIndex(glm::max(middle - 1, Index3(0)), glm::min(middle + 1, g.size - 1), [&](Index3 n) {
            const Index3 off = glm::abs(n - middle);
            const double weight = 1.0 / static_cast<double>(1 << (off.x + off.y + off.z));
            const std::size_t at = g.offset(n);
            if (fine_.diagonal[at] > 0.0F) {
                tissue += weight;
                fixed += fine_.fixed[at] != 0 ? weight : 0.0;
            }
        });
        return fixed > 0.3 * tissue;
    }

    bool relaxes() const { return !fine_.relaxing[0].empty(); }

    // A coarse cell has the shear modulus of its eight cells right after a step, and that of a long time after it; the
    // terms share what is gone as they do on average.
    Moduli upscaled(Index3 low) const
    {
        BlockMean mu, bulk, relaxed;
        volume::StiffeningMean stiffening;
        Moduli mean;
        int filled = 0;
        volume::forEachIndex(low, low + 1, [&](Index3 c) {
            const std::size_t at = fine_.nodes.offset(c);
            const double m = static_cast<double>(fine_.mu[at]);
            if (m > 0.0) {
                const double held = static_cast<double>(held_[at]);
                mu.add(m, held);
                bulk.add(static_cast<double>(fine_.lambda[at]) + 2.0 / 3.0 * m, held);
                stiffening.add(1.0, m, static_cast<double>(fine_.stiffening[at]));
                mean.held += held;
                double left = 1.0;
                for (std::size_t i = 0; i < mean.relaxing.size() && relaxes(); ++i) {
                    const double weight = static_cast<double>(fine_.relaxing[i][at]);
                    mean.relaxing[i] += m * weight;
                    left -= weight;
                }
                relaxed.add(m * left, held);
                ++filled;
            }
        });
        const int cells = std::max(filled, 1);
        const bool surface = atSurface(fine_, low, low + 1);
        const double sum = std::accumulate(mean.relaxing.begin(), mean.relaxing.end(), 0.0);
        const double gone = sum > 0.0 ? 1.0 - relaxed.modulus(surface) / mu.modulus(surface) : 0.0;
        for (double& weight : mean.relaxing) {
            weight *= sum > 0.0 ? gone / sum : 0.0;
        }
        return {mu.modulus(surface), bulk.modulus(surface), stiffening.mean(), mean.held / cells, mean.relaxing};
    }

    const CellLevel& fine_;
    const std::vector<float>& held_;
};

// What one cell's modes give to the diagonal at each of its nodes: h / 32 (2 mu (46 / 9 + 4 / 3 (1 + s)) + 2 lambda), with
// s = lambda / (lambda + 2 mu) of bending.
void addDiagonal(CellLevel& level)
{
    const auto& g = level.nodes;
    level.diagonal.assign(g.count(), 0.0F);
    volume::forEachIndex(Index3(0), g.size - 2, [&](Index3 c) {
        const std::size_t at = g.offset(c);
        const float mu = level.mu[at];
        const float lambda = level.lambda[at];
        if (mu > 0.0F) {
            const float bending = 4.0F / 3.0F * (1.0F + lambda / (lambda + 2.0F * mu));
            const float fraction =
                static_cast<float>(g.spacing / 32.0) * (2.0F * mu * (46.0F / 9.0F + bending) + 2.0F * lambda);
            volume::forEachIndex(c, c + 1, [&](Index3 n) { level.diagonal[g.offset(n)] += fraction; });
        }
    });
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
    // the layer that is left of them. What tips a body is the width of what holds it, to the third power: so each level
    // looks for itself, and does not inherit the rim of a finer one.
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

// By power iteration; a start of random signs has a fraction of every eigenvector.
double spectralRadius(const CellLevel& level)
{
    const Index3 size = level.nodes.size;
    const Layout l = Layout::of(size.x, size.y, size.z);
    const Kernels& k = kernels();
    std::vector<float> mu(l.count + Layout::lanes), lambda(mu), inverse(mu);
    LayerFields layers(l, !level.layers.empty());
    layers.place(level, Index3(0));
    std::vector<float> z(l.fieldSize()), az(l.fieldSize()), scratch(l.scratchSize());
    std::minstd_rand random(7);
    const float scale = static_cast<float>(level.nodes.spacing / 32.0);
    volume::forEachIndex(Index3(0), size - 1, [&](Index3 n) {
        const std::size_t from = level.nodes.offset(n);
        const std::size_t to = l.at(n.x, n.y, n.z);
        mu[to] = scale * level.mu[from];
        lambda[to] = scale * level.lambda[from];
        inverse[to] = level.diagonal[from] > 0.0F && level.fixed[from] == 0 ? 1.0F / level.diagonal[from] : 0.0F;
        for (std::size_t c = 0; c < 3; ++c) {
            z[c * l.count + to] = inverse[to] == 0.0F ? 0.0F : random() % 2 != 0 ? 1.0F : -1.0F;
        }
    });
    const auto norm = [&] {
        std::array<double, 2> sums{};
        k.dots(z.data(), z.data(), z.data(), 3 * l.count, sums.data());
        return std::sqrt(sums[0]);
    };
    double radius = 0.0;
    for (int i = 0; i < powerSteps; ++i) {
        const double before = norm();
        if (before <= 0.0) {
            break;
        }
        k.apply(l, {.mu = mu.data(), .lambda = lambda.data(), .layers = layers.view()}, z.data(), az.data(),
                scratch.data());
        k.smoothFirst(static_cast<float>(1.0 / before), inverse.data(), az.data(), z.data(), l.count);
        radius = norm();
    }
    return radius > 0.0 ? radius : 1.0;
}

}  // namespace

std::vector<CellLevel> cellLevels(const FinestLevel& finest, std::size_t count,
                                  const std::optional<volume::Support>& support, const volume::DistanceField& surface)
{
    FinestLevel first = support ? Resting::freePart(finest) : finest;
    std::vector<CellLevel> levels{withStiffSkin(first)};
    addDiagonal(levels.front());
    while (levels.size() < count) {
        std::vector<float> coarser;
        levels.push_back(Coarsening(levels.back(), first.held).level(coarser));
        addDiagonal(levels.back());
        first.held = std::move(coarser);
    }
    levels.front() = first.level;
    addLayers(first, finest.held, surface, levels.front());
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
