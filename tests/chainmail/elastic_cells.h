#pragma once

// Cells and fields as the kernels take them, with nothing around.
#include <chainmail/cell_layers.h>
#include <chainmail/window.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

namespace palpate::tests {

/// A layer of up to 100 Pa across any direction, all of it in the cell.
inline chainmail::CellLayer randomLayer(Index3 cell, std::minstd_rand& random)
{
    std::uniform_real_distribution<float> value(-1.0F, 1.0F);
    const Vec3f normal = glm::normalize(Vec3f(value(random), value(random), value(random)) + Vec3f(0.01F));
    const float half = 0.3F * std::abs(value(random));
    return {cell, 100.0F * std::abs(value(random)), normal, 0.5F * Vec3f(value(random), value(random), value(random)),
            half * normal};
}

/// Tissue that fills a part of a cell, somewhere in it.
inline chainmail::Cut randomCut(std::minstd_rand& random)
{
    std::uniform_real_distribution<float> value(-1.0F, 1.0F);
    const Vec3f middle(value(random), value(random), value(random));
    const Vec3f most = 1.0F - glm::abs(middle);  // a part that is as wide ends at the cell's border
    return {middle, glm::max(most * most, Vec3f(0.02F)), 0.5F};
}

/// A box of cells with its fields; spacing 1 m, so that a cell's scaled stiffness is its modulus / 32.
struct Cells {
    explicit Cells(Index3 nodes)
        : layout(chainmail::Layout::of(nodes.x, nodes.y, nodes.z)),
          mu(layout.count + chainmail::Layout::lanes, 0.0F),
          lambda(mu),
          stiffening(mu),
          layers(layout, nodes, true),
          cuts(layout, nodes),
          u(layout.fieldSize(), 0.0F),
          out(u),
          scratch(layout.scratchSize(), 0.0F)
    {
    }

    Index3 nodes() const { return {layout.nx, layout.ny, layout.nz}; }
    chainmail::CellStiffness stiffness() const
    {
        return {mu.data(), lambda.data(), stiffening.data(), layers.view(), cuts.view(), cuts.filling(), relief};
    }

    /// Moduli of one cell [Pa].
    void set(Index3 cell, double shear, double lame)
    {
        const std::size_t at = layout.at(cell.x, cell.y, cell.z);
        mu[at] = static_cast<float>(shear / 32.0);
        lambda[at] = static_cast<float>(lame / 32.0);
    }
    void fill(double shear, double lame)
    {
        volume::forEachIndex(Index3(0), nodes() - 2, [&](Index3 c) { set(c, shear, lame); });
    }
    /// Both by z, then y, then x.
    void setLayers(std::vector<chainmail::CellLayer> of, std::vector<chainmail::CutCell> cutBy = {})
    {
        chainmail::CellLevel level;
        level.nodes = {nodes(), Vec3(0.0), 1.0};
        level.layers = std::move(of);
        level.layerRows = chainmail::rowsOf(level.layers, level.nodes.size, &chainmail::CellLayer::cell);
        level.cuts = std::move(cutBy);
        level.cutRows = chainmail::rowsOf(level.cuts, level.nodes.size, &chainmail::CutCell::cell);
        layers.place(level, Index3(0));
        cuts.place(level, Index3(0));
    }
    /// Moduli between 1 and 100 Pa, one cell in ten empty, one of the others in three with a layer of any direction, and
    /// one in three cut.
    void fillRandom(std::minstd_rand& random)
    {
        std::uniform_real_distribution<double> power(0.0, 2.0);
        std::vector<chainmail::CellLayer> some;
        std::vector<chainmail::CutCell> cut;
        volume::forEachIndex(Index3(0), nodes() - 2, [&](Index3 c) {
            const bool empty = random() % 10 == 0;
            set(c, empty ? 0.0 : std::pow(10.0, power(random)), empty ? 0.0 : std::pow(10.0, power(random)));
            if (!empty && random() % 3 == 0) {
                some.push_back(randomLayer(c, random));
            }
            if (!empty && random() % 3 == 0) {
                cut.push_back({c, randomCut(random)});
            }
        });
        setLayers(std::move(some), std::move(cut));
    }

    void stiffen(double b) { std::ranges::fill(stiffening, static_cast<float>(b)); }

    /// u(n) = value(n) at every node n.
    template <typename Function>
    void move(const Function& value)
    {
        volume::forEachIndex(Index3(0), nodes() - 1, [&](Index3 n) {
            const Vec3 v = value(n);
            for (int c = 0; c < 3; ++c) {
                u[index(n, c)] = static_cast<float>(v[c]);
            }
        });
    }
    void moveRandom(double size, std::minstd_rand& random)
    {
        std::uniform_real_distribution<double> value(-size, size);
        move([&](Index3) { return Vec3(value(random), value(random), value(random)); });
    }

    std::size_t index(Index3 n, int c) const
    {
        return static_cast<std::size_t>(c) * layout.count + layout.at(n.x, n.y, n.z);
    }
    Vec3 force(Index3 n) const { return {out[index(n, 0)], out[index(n, 1)], out[index(n, 2)]}; }

    /// out = A u.
    void apply() { chainmail::kernels().apply(layout, stiffness(), u.data(), out.data(), scratch.data()); }
    double applyFinite()
    {
        return chainmail::kernels().applyFinite(layout, stiffness(), 1.0F, u.data(), out.data(), scratch.data());
    }
    double largestForce() const
    {
        double most = 0.0;
        volume::forEachIndex(Index3(0), nodes() - 1, [&](Index3 n) { most = std::max(most, glm::length(force(n))); });
        return most;
    }

    chainmail::Layout layout;
    float relief = 0;  // CellStiffness::relief
    chainmail::Floats mu, lambda, stiffening;
    chainmail::LayerFields layers;
    chainmail::CutFields cuts;
    chainmail::Floats u, out, scratch;
};

/// Slope of the energy at finite strain along `way`, by central differences; the cells stay where they are.
inline double energySlope(Cells& cells, const chainmail::Floats& way, float step)
{
    const chainmail::Floats u = cells.u;
    const auto at = [&](float t) {
        for (std::size_t i = 0; i < u.size(); ++i) {
            cells.u[i] = u[i] + t * way[i];
        }
        return cells.applyFinite();
    };
    const double slope = (at(step) - at(-step)) / (2.0 * static_cast<double>(step));
    at(0.0F);
    return slope;
}

/// Sum over all nodes, in double.
inline double dot(const Cells& cells, const chainmail::Floats& a, const chainmail::Floats& b)
{
    double sum = 0.0;
    volume::forEachIndex(Index3(0), cells.nodes() - 1, [&](Index3 n) {
        for (int c = 0; c < 3; ++c) {
            sum += static_cast<double>(a[cells.index(n, c)]) * static_cast<double>(b[cells.index(n, c)]);
        }
    });
    return sum;
}

}  // namespace palpate::tests
