#include <chainmail/cell_layers.h>

#include <volume/cell_mixture.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <optional>
#include <unordered_map>

namespace palpate::chainmail {

namespace {

constexpr double deepest = 2.0;         // cells under the surface that may have layers along it
constexpr double aligned = 0.8;         // cosine from which on a layer that is not at the surface runs along it
constexpr double flat = 0.95;           // slope of the distance field from which on there is no edge in the cell
constexpr double thinnest = 0.2;        // of a layer's modulus in the cell's, from which on it counts
constexpr double thinnestInside = 1.0;  // the same for layers that do not run along the surface: softer ones are not felt

// The material of a cell as a layer on something soft.
class Layering {
public:
    Layering(const FinestLevel& finest, const volume::DistanceField& surface)
        : level_(finest.level), g_(level_.nodes), surface_(surface)
    {
        for (const MixedCell& m : finest.mixed) {
            mixed_.emplace(g_.offset(m.cell), &m);
        }
    }

    // What is left of the cell's own modulus, and the layer; its modulus is 0 where there is none.
    std::pair<double, CellLayer> of(Index3 cell) const
    {
        const std::size_t at = g_.offset(cell);
        const Vec3 centre = g_.position(cell) + 0.5 * g_.spacing;
        const double distance = surface_.at(centre);
        const MixedCell* m = mixedAt(at);
        if (m == nullptr && distance < -g_.spacing) {
            return {1.0, {}};
        }
        const bool isNear = distance >= -deepest * g_.spacing;
        const bool top = isNear && atSurface(level_, cell, cell);
        const Vec3 outward = isNear ? surface_.normal(centre) : Vec3(0.0);
        const Vec3 own = m != nullptr ? Vec3(m->normal) : Vec3(0.0);
        // The surface's normal is the finer one. Along it bending counts; elsewhere tissue on both sides bears that.
        const bool alongSurface = own == Vec3(0.0) ? top : glm::abs(glm::dot(own, outward)) >= aligned;
        const Vec3 normal = alongSurface ? outward : own;
        if (normal == Vec3(0.0)) {
            return {1.0, {}};
        }
        const double wide = glm::abs(normal.x) + glm::abs(normal.y) + glm::abs(normal.z);
        const bool isCut = top && glm::length(surface_.gradient(centre)) > flat;
        const double full = isCut ? std::clamp(0.5 - distance / (wide * g_.spacing), 0.05, 1.0) : 1.0;
        const auto below = alongSurface ? std::optional(g_.cellAt(centre - g_.spacing * normal)) : std::nullopt;
        const Mean mean = meanOf(at, full, below, normal);
        if (mean.layer <= (alongSurface ? thinnest : thinnestInside) * mean.across) {
            return {1.0, {}};
        }
        const double share = full * (m != nullptr ? static_cast<double>(m->share) : 1.0);
        const Vec3f middle = m != nullptr ? m->middle : Vec3f((full - 1.0) * wide * normal);
        const double thick = alongSurface ? share * wide : 0.0;
        return {mean.across / static_cast<double>(level_.mu[at]),
                {cell, static_cast<float>(mean.layer), Vec3f(normal), middle, Vec3f(thick / std::sqrt(3.0) * normal)}};
    }

private:
    const MixedCell* mixedAt(std::size_t at) const
    {
        const auto found = mixed_.find(at);
        return found != mixed_.end() ? found->second : nullptr;
    }

    struct Mean {
        double across = 0.0;
        double layer = 0.0;
    };

    // Across, the material is that of a whole cell right under the surface: what the cell has, and what is under it for as
    // much as it is empty. Else a layer that the cell's border cuts would bend as if it were as thick as the cell. It is
    // between the harmonic mean, which is exact for layers thinner than all else, and the geometric one of both bounds, by
    // the square of the layer's share: a thick layer bears what presses it by its own shear, too.
    Mean meanOf(std::size_t at, double full, std::optional<Index3> below, Vec3 normal) const
    {
        volume::CellMixture whole;
        const Phases own = phasesOf(at, full);
        add(whole, full * own.share, own.stiff);
        add(whole, full * (1.0 - own.share), own.soft);
        if (below && g_.contains(*below) && level_.mu[g_.offset(*below)] > 0.0F) {
            const Phases next = phasesOf(g_.offset(*below), 1.0);
            const double depth = 1.0 - full;
            const bool stiffFirst = glm::dot(next.middle, normal) > 0.0;
            const double stiff = stiffFirst ? std::min(next.share, depth) : std::max(depth - (1.0 - next.share), 0.0);
            add(whole, stiff, next.stiff);
            add(whole, depth - stiff, next.soft);
        }
        const volume::CellMaterial material = whole.material();
        const double along = static_cast<double>(material.along);
        const double share = static_cast<double>(material.share);
        const double across =
            full * static_cast<double>(material.youngsModulus) / whole.fraction() * std::pow(along, share * share - 1.0);
        return {across, full * (own.share * own.stiff + (1.0 - own.share) * own.soft) - across};
    }

    // The two tissues that have a mixed cell's means.
    struct Phases {
        double stiff = 0.0, soft = 0.0;
        double share = 1.0;  // of the stiff one
        Vec3 middle{0.0};    // of it
    };
    Phases phasesOf(std::size_t at, double full) const
    {
        const double mean = static_cast<double>(level_.mu[at]) / full;
        const MixedCell* m = mixedAt(at);
        if (m == nullptr) {
            return {mean, mean, 1.0, Vec3(0.0)};
        }
        const double parallel = mean * static_cast<double>(m->along);
        const double series = mean / static_cast<double>(m->along);
        const double s = std::clamp(static_cast<double>(m->share), 0.02, 0.98);
        // (1 - s) x^2 - b x + (1 - s) parallel series = 0 for the soft one
        const double b = parallel + series * (1.0 - 2.0 * s);
        const double root = std::sqrt(std::max(b * b - 4.0 * (1.0 - s) * (1.0 - s) * parallel * series, 0.0));
        const double soft = (b - root) / (2.0 * (1.0 - s));
        return {(parallel - (1.0 - s) * soft) / s, soft, s, Vec3(m->middle)};
    }

    static void add(volume::CellMixture& to, double weight, double modulus)
    {
        volume::TissueRow row;
        row.youngsModulus = modulus;
        if (weight > 0.0) {
            to.add(row, weight, 1.0, false);
        }
    }

    const CellLevel& level_;
    const volume::NodeGrid& g_;
    const volume::DistanceField& surface_;
    std::unordered_map<std::size_t, const MixedCell*> mixed_;
};

}  // namespace

bool atSurface(const CellLevel& level, Index3 low, Index3 high)
{
    bool empty = false;
    volume::forEachIndex(glm::max(low - 1, Index3(0)), glm::min(high + 1, level.nodes.size - 2),
                         [&](Index3 c) { empty = empty || level.mu[level.nodes.offset(c)] <= 0.0F; });
    return empty;
}

void addLayers(const FinestLevel& finest, const std::vector<float>& held, const volume::DistanceField& surface,
               CellLevel& level)
{
    const Layering layering(finest, surface);
    volume::forEachIndex(Index3(0), level.nodes.size - 2, [&](Index3 c) {
        const std::size_t at = level.nodes.offset(c);
        if (level.mu[at] <= 0.0F || held[at] > 0.0F) {
            return;
        }
        const auto& [left, layer] = layering.of(c);
        if (layer.mu > 0.0F) {
            level.layers.push_back(layer);
            level.mu[at] *= static_cast<float>(left);
            level.lambda[at] *= static_cast<float>(left);
        }
    });
    level.layerRows = rowsOf(level.layers, level.nodes.size, &CellLayer::cell);
}

}  // namespace palpate::chainmail
