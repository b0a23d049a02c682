#pragma once

// Boxes of cells, solved and measured, for the tests of the elastic level.
#include <chainmail/elastic.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <span>
#include <utility>
#include <vector>

namespace palpate::tests {

inline volume::CellMaterial tissue(double youngsModulus, double poissonRatio, bool fixed = false)
{
    return {.youngsModulus = static_cast<float>(youngsModulus),
            .poissonRatio = static_cast<float>(poissonRatio),
            .fixed = fixed ? 1.0F : 0.0F};
}

/// A block of tissue in air. Its surface towards the hand is y = low.y (frame LPS).
struct ElasticBlock {
    Index3 cells{0};                                       // of tissue
    double spacing = 1e-3;                                 // [m]
    std::function<volume::CellMaterial(Index3)> material;  // of each cell of tissue, counted from 0
    int air = 1;                                           // cells of nothing around it; 2^n keeps n coarser levels whole
    Vec3 low{0.0};                                         // its lowest corner [m]
    double full = 1.0;                                     // of the first layer along y: the surface lies in it
};

/// The same material everywhere; the last layer along y is fixed.
inline ElasticBlock heldBlock(Index3 cells, double spacing, double youngsModulus, double poissonRatio)
{
    const int last = cells.y - 1;
    return {cells, spacing, [=](Index3 c) { return tissue(youngsModulus, poissonRatio, c.y == last); }, 1, Vec3(0.0)};
}

/// The same material everywhere; `layer` cells all around are fixed.
inline ElasticBlock shell(int cells, int layer, double spacing, double youngsModulus, double poissonRatio, int air)
{
    const auto inside = [=](Index3 c) { return c == glm::clamp(c, Index3(layer), Index3(cells - 1 - layer)); };
    return {Index3(cells), spacing, [=](Index3 c) { return tissue(youngsModulus, poissonRatio, !inside(c)); }, air,
            Vec3(0.0)};
}

/// Signed distance to a box [m].
inline double boxDistance(Vec3 p, Vec3 low, Vec3 high)
{
    const Vec3 off = glm::max(low - p, p - high);
    return glm::length(glm::max(off, Vec3(0.0))) + std::min(std::max({off.x, off.y, off.z}), 0.0);
}

template <typename Distance>
volume::DistanceField distanceOn(const volume::NodeGrid& grid, const Distance& distance)
{
    volume::DistanceField field;
    field.grid = grid;
    field.values.resize(grid.count());
    volume::forEachIndex(Index3(0), grid.size - 1,
                         [&](Index3 n) { field.values[grid.offset(n)] = static_cast<float>(distance(grid.position(n))); });
    return field;
}

inline chainmail::ElasticBody bodyOf(const ElasticBlock& block, double poissonCap = 0.4999, bool relaxes = false)
{
    const double h = block.spacing;
    const volume::NodeGrid grid{block.cells + 2 * block.air, block.low + (0.5 - block.air) * h, h};
    std::vector<volume::CellMaterial> materials(grid.count());
    volume::forEachIndex(Index3(0), block.cells - 1, [&](Index3 c) {
        auto& material = materials[grid.offset(c + block.air)];
        material = block.material(c);
        material.fraction = c.y == 0 ? static_cast<float>(block.full) : 1.0F;
        material.youngsModulus *= material.fraction;
    });
    const Vec3 low = block.low + Vec3(0.0, (1.0 - block.full) * h, 0.0), high = block.low + h * Vec3(block.cells);
    const auto surface = distanceOn(grid, [&](Vec3 p) { return boxDistance(p, low, high); });
    return chainmail::elasticBody(grid, std::move(materials), surface, poissonCap, 0.0, relaxes);
}

/// Windows around a point [m].
inline chainmail::Focus focusAt(Vec3 point)
{
    return {point};
}

/// Windows around a point near the top of a block: y is the way in.
inline chainmail::Focus focusUnder(Vec3 point)
{
    return {point, Vec3(0.0, 1.0, 0.0), std::max(0.0, point.y)};
}

/// Value of a field at a node of a window.
inline Vec3 valueAt(const chainmail::Window& w, std::size_t node, chainmail::Field field)
{
    const float* f = w.field(field) + node;
    return {f[0], f[w.layout.count], f[2 * w.layout.count]};
}

inline void setAt(chainmail::Window& w, std::size_t node, chainmail::Field field, Vec3 v)
{
    float* f = w.field(field) + node;
    for (int c = 0; c < 3; ++c, f += w.layout.count) {
        *f = static_cast<float>(v[c]);
    }
}

/// Calls visit(level, window, node, rest position [m]) for every node of all windows.
template <typename Visit>
void forEachNode(chainmail::WindowStack& stack, Visit&& visit)
{
    for (std::size_t l = 0; l < stack.size(); ++l) {
        chainmail::Window& w = stack[l];
        const auto& grid = stack.body().levels[l].nodes;
        volume::forEachIndex(Index3(0), w.size() - 1,
                             [&](Index3 n) { visit(l, w, w.layout.at(n.x, n.y, n.z), grid.position(w.low + n)); });
    }
}

template <typename Function>
void setField(chainmail::WindowStack& stack, chainmail::Field field, const Function& value)
{
    forEachNode(
        stack, [&](std::size_t, chainmail::Window& w, std::size_t node, Vec3 rest) { setAt(w, node, field, value(rest)); });
}

/// Random on the degrees of freedom, zero elsewhere.
inline void randomise(chainmail::WindowStack& stack, chainmail::Field field, std::minstd_rand& random)
{
    std::uniform_real_distribution<double> value(-1.0, 1.0);
    forEachNode(stack, [&](std::size_t, chainmail::Window& w, std::size_t node, Vec3) {
        const Vec3 v(value(random), value(random), value(random));
        setAt(w, node, field, static_cast<double>(w.dof[node]) * v);
    });
}

/// Conjugate gradients with one multigrid cycle each: adds A^-1 r to u, r as it lies in Field::r. The cycle spoils r: the
/// residual is kept in Field::a.
/// @returns  cycles until the residual has fallen to `tolerance` of what it was, at most `most`
inline int solve(chainmail::WindowStack& stack, chainmail::Multigrid& multigrid, double tolerance, int most)
{
    using chainmail::Field;
    stack.copy(Field::r, Field::a);
    const double first = stack.dot(Field::a, Field::a);
    double before = 1.0;
    for (int i = 0; i < most; ++i) {
        if (stack.dot(Field::a, Field::a) <= tolerance * tolerance * first) {
            return i;
        }
        stack.copy(Field::a, Field::r);
        multigrid.solve();
        const double now = stack.dot(Field::z, Field::a);
        if (i == 0) {
            stack.copy(Field::z, Field::p);
        } else {
            stack.combine(Field::z, now / before, Field::p, Field::p);
        }
        before = now;
        stack.joinBorders(Field::p);
        stack.apply(Field::p, Field::q);
        const double alpha = -now / stack.dot(Field::p, Field::q);
        stack.combine(Field::u, alpha, Field::p, Field::u);
        stack.combine(Field::a, alpha, Field::q, Field::a);
    }
    return most;
}

/// A tool that is a ball [m].
inline chainmail::ElasticTool ball(Vec3 centre, double radius, double stiffest = 1e6)
{
    chainmail::ElasticTool tool;
    tool.shape = {centre, centre, radius, radius};
    tool.stiffest = stiffest;
    return tool;
}

/// Relaxes until the residual is under `tolerance` of the contacts' forces.
inline chainmail::ElasticResult settle(chainmail::Elastic& elastic, const chainmail::ElasticLoad& load,
                                       double tolerance = 1e-5, int most = 400)
{
    chainmail::ElasticResult result;
    for (int i = 0; i < most; i += 20) {
        result = elastic.relax(load, 20, tolerance);
        if (result.cycles < 20) {
            break;
        }
    }
    return result;
}

/// With the windows around a point near the top of a block.
inline chainmail::ElasticLoad loadOf(std::span<const chainmail::ElasticTool> tools, std::span<const chainmail::Tie> ties,
                                     Vec3 focus)
{
    return {tools, ties, focusUnder(focus)};
}

}  // namespace palpate::tests
