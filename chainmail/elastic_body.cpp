#include <chainmail/elastic_body.h>

#include <chainmail/kernels.h>
#include <volume/cell_mixture.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>

namespace palpate::chainmail {

namespace {

constexpr int fewestNodes = 9;      // the coarsest level has at most as many along each side
constexpr float minTissue = 0.01F;  // cells with less of a typical stiffness are empty
constexpr float wholly = 0.98F;     // fraction of a cell that is held: bone, but for the rounding of samples
constexpr int powerSteps = 30;
constexpr double onItsBack = 0.05;  // fraction of the body's depth that is fixed when nothing else is

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

// Energy and not volume decides: under the same strain cells side by side add their stiffness, under the same stress they
// add their compliance, and a block of eight is between the two. The geometric mean of both bounds keeps thin stiff layers
// stiff and thin gaps soft. What is held in space gives way in neither: it leaves less of the block to be strained, and the
// rest of it by as much more. Sources: W. Voigt 1889 and A. Reuss 1929 (bounds); the mean as in docs/decisions.md, 8.
class BlockMean {
public:
    /// @param held  fraction of the cell's tissue that is held
    void add(double modulus, double held)
    {
        ++filled_;
        whole_ += modulus;
        const double free = 1.0 - held;
        if (free > 1.0 - static_cast<double>(wholly)) {
            free_ += free;
            sum_ += free * free * modulus;
            inverse_ += 1.0 / modulus;
        }
    }
    double modulus() const
    {
        if (filled_ == 0) {
            return 0.0;
        }
        const double fraction = filled_ / 8.0;
        return free_ > 0.0 ? std::sqrt(sum_ / inverse_) * filled_ / free_ * fraction : whole_ / filled_ * fraction;
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
            tissue += fine_.diagonal[at] > 0.0F ? weight : 0.0;
            fixed += fine_.fixed[at] != 0 ? weight : 0.0;
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
        const double sum = std::accumulate(mean.relaxing.begin(), mean.relaxing.end(), 0.0);
        const double gone = sum > 0.0 ? 1.0 - relaxed.modulus() / mu.modulus() : 0.0;
        for (double& weight : mean.relaxing) {
            weight *= sum > 0.0 ? gone / sum : 0.0;
        }
        return {mu.modulus(), bulk.modulus(), stiffening.mean(), mean.held / cells, mean.relaxing};
    }

    const CellLevel& fine_;
    const std::vector<float>& held_;
};

// Nodes around which half of the tissue is held: where the surface of bone runs through cells, those on its side of it.
void fixMostlyHeld(const volume::NodeGrid& cells, const std::vector<volume::CellMaterial>& materials, CellLevel& level)
{
    volume::forEachIndex(Index3(0), cells.size, [&](Index3 n) {
        float held = 0.0F;
        float filled = 0.0F;
        volume::forEachIndex(glm::max(n - 1, Index3(0)), glm::min(n, cells.size - 1), [&](Index3 c) {
            const auto& m = materials[cells.offset(c)];
            held += m.fixed;
            filled += m.youngsModulus > minTissue ? 1.0F : 0.0F;
        });
        if (held > 0.0F && held >= 0.5F * wholly * filled) {
            level.fixed[level.nodes.offset(n)] = 1;
        }
    });
}

volume::Relaxation relaxationOf(const volume::CellMaterial& material, bool relaxes)
{
    volume::Relaxation relaxation;
    for (std::size_t i = 0; i < material.relaxing.size() && relaxes; ++i) {
        relaxation.weights[i] = static_cast<double>(material.relaxing[i]);
    }
    return relaxation;
}

CellLevel finest(const volume::NodeGrid& cells, const std::vector<volume::CellMaterial>& materials, double poissonCap,
                 Index3 size, bool relaxes)
{
    CellLevel level;
    level.nodes = {size, cells.origin - 0.5 * cells.spacing, cells.spacing};
    level.mu.assign(level.nodes.count(), 0.0F);
    level.lambda.assign(level.nodes.count(), 0.0F);
    level.stiffening.assign(level.nodes.count(), 0.0F);
    level.fixed.assign(level.nodes.count(), 0);
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
        if (m.fixed >= wholly) {
            volume::forEachIndex(c, c + 1, [&](Index3 n) { level.fixed[level.nodes.offset(n)] = 1; });
        }
    });
    fixMostlyHeld(cells, materials, level);
    return level;
}

// Fraction of each cell's tissue that is held.
std::vector<float> heldShares(const volume::NodeGrid& cells, const std::vector<volume::CellMaterial>& materials,
                              const CellLevel& level)
{
    std::vector<float> held(level.nodes.count(), 0.0F);
    volume::forEachIndex(Index3(0), cells.size - 1,
                         [&](Index3 c) { held[level.nodes.offset(c)] = materials[cells.offset(c)].fixed; });
    return held;
}

void layOnItsBack(CellLevel& level)
{
    int front = level.nodes.size.y;
    int back = 0;
    volume::forEachIndex(Index3(0), level.nodes.size - 2, [&](Index3 c) {
        if (level.mu[level.nodes.offset(c)] > 0.0F) {
            front = std::min(front, c.y);
            back = std::max(back, c.y + 1);
        }
    });
    const int first = back - static_cast<int>(onItsBack * (back - front));
    volume::forEachIndex({0, first, 0}, level.nodes.size - 1, [&](Index3 n) { level.fixed[level.nodes.offset(n)] = 1; });
}

// A surface that runs along the border of two cells may lie in the empty one, whose nodes have nothing to hold them.
Vec3 anchorOf(const CellLevel& level, Vec3 on, Index3 under)
{
    const auto& g = level.nodes;
    const Index3 cell(glm::floor((on - g.origin) / g.spacing));
    if (g.contains(cell) && level.mu[g.offset(cell)] > 0.0F) {
        return on;
    }
    const Vec3 edge(1e-3 * g.spacing);
    return glm::clamp(on, g.position(under) + edge, g.position(under + 1) - edge);
}

// Of sub-cells along a cell, in which surface points sit: two, and more where a small tool would fall between the points.
int pointsPerEdge(double spacing, double toolRadius)
{
    constexpr int fewest = 2;
    constexpr int most = 8;
    return toolRadius > 0.0 ? std::clamp(static_cast<int>(std::ceil(2.0 * spacing / toolRadius)), fewest, most) : fewest;
}

// The surface as points with areas: in every sub-cell near it the distance field gives the nearest point, and a hat as wide
// as the sub-cell looks along the normal shares the area among the sub-cells that see the same piece.
// Source: B. Engquist, A.-K. Tornberg, R. Tsai, "Discretization of Dirac delta functions in level set methods", J. Comput.
// Phys. 207, 2005.
void addSurface(const volume::NodeGrid& cells, const volume::DistanceField& surface, int perEdge, ElasticBody& body)
{
    const auto& finest = body.levels.front();
    const double sub = cells.spacing / perEdge;
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
            const Index3 under(glm::floor((on - 0.6 * cells.spacing * normal - finest.nodes.origin) / cells.spacing));
            if (hat <= 0.0 || !finest.nodes.contains(under)) {
                return;
            }
            const float mu = finest.mu[finest.nodes.offset(under)];
            if (mu > 0.0F) {
                body.points.push_back({Vec3f(on), Vec3f(anchorOf(finest, on, under)), Vec3f(normal),
                                       static_cast<float>(sub * sub * sub * hat / width), mu});
                ++run.count;
            }
        });
        if (run.count > 0) {
            body.cells.push_back(run);
        }
    });
}

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
}

// By power iteration; a start of random signs has a fraction of every eigenvector.
double spectralRadius(const CellLevel& level)
{
    const Index3 size = level.nodes.size;
    const Layout l = Layout::of(size.x, size.y, size.z);
    const Kernels& k = kernels();
    std::vector<float> mu(l.count + Layout::lanes), lambda(mu), inverse(mu);
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
        k.apply(l, {mu.data(), lambda.data()}, z.data(), az.data(), scratch.data());
        k.smoothFirst(static_cast<float>(1.0 / before), inverse.data(), az.data(), z.data(), l.count);
        radius = norm();
    }
    return radius > 0.0 ? radius : 1.0;
}

void indexRows(ElasticBody& body)
{
    const Index3 size = body.levels.front().nodes.size;
    body.rows.assign(static_cast<std::size_t>(size.y) * static_cast<std::size_t>(size.z) + 1, 0);
    for (const auto& c : body.cells) {
        ++body.rows[static_cast<std::size_t>(c.cell.y + c.cell.z * size.y) + 1];
    }
    for (std::size_t i = 1; i < body.rows.size(); ++i) {
        body.rows[i] += body.rows[i - 1];
    }
}

}  // namespace

ElasticBody elasticBody(const volume::NodeGrid& cells, const std::vector<volume::CellMaterial>& materials,
                        const volume::DistanceField& surface, double poissonCap, double toolRadius, bool relaxes)
{
    ElasticBody body;
    body.relaxes = relaxes;
    int levels = 1;
    const Index3 size = paddedNodes(cells.size, levels);
    body.levels.push_back(finest(cells, materials, poissonCap, size, relaxes));
    auto& fixed = body.levels.front().fixed;
    body.held = std::any_of(fixed.begin(), fixed.end(), [](std::uint8_t f) { return f != 0; });
    if (!body.held) {
        layOnItsBack(body.levels.front());
    }
    addSurface(cells, surface, pointsPerEdge(cells.spacing, toolRadius), body);
    addDiagonal(body.levels.front());
    std::vector<float> held = heldShares(cells, materials, body.levels.front());
    while (static_cast<int>(body.levels.size()) < levels) {
        std::vector<float> coarser;
        body.levels.push_back(Coarsening(body.levels.back(), held).level(coarser));
        held = std::move(coarser);
        addDiagonal(body.levels.back());
    }
    for (auto& level : body.levels) {
        level.radius = spectralRadius(level);
    }
    indexRows(body);
    return body;
}

}  // namespace palpate::chainmail
