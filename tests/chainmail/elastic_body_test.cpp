#include "elastic_bodies.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace palpate::chainmail {
namespace {

using tests::ElasticBlock;

double areaOf(const ElasticBody& body)
{
    double area = 0.0;
    for (const SurfacePoint& p : body.points) {
        area += static_cast<double>(p.area);
    }
    return area;
}

double bulkOf(const CellLevel& level, std::size_t at)
{
    return static_cast<double>(level.lambda[at]) + 2.0 / 3.0 * static_cast<double>(level.mu[at]);
}

// Harmonic and arithmetic mean of eight cells.
struct Means {
    double harmonic = 0;
    double arithmetic = 0;
};

template <typename Value>
Means meansOf(const CellLevel& fine, Index3 low, const Value& value)
{
    double sum = 0.0;
    double inverse = 0.0;
    volume::forEachIndex(low, low + 1, [&](Index3 c) {
        const double v = value(fine.nodes.offset(c));
        sum += v;
        inverse += 1.0 / v;
    });
    return {8.0 / inverse, sum / 8.0};
}

// A block of random stiffness over two decades: the bounds of Reuss and Voigt hold for every coarse cell of every level.
TEST(ElasticBody, CoarseCellsLieBetweenTheBoundsOfReussAndVoigt)
{
    std::minstd_rand random(1);
    std::uniform_real_distribution<double> power(3.0, 5.0), poisson(0.3, 0.49);
    const auto material = [&](Index3) { return tests::tissue(std::pow(10.0, power(random)), poisson(random)); };
    const ElasticBody body = tests::bodyOf(ElasticBlock{Index3(32), 1e-3, material, 8, Vec3(0.0)});
    ASSERT_GE(body.levels.size(), 3U);
    for (std::size_t l = 1; l < 3; ++l) {
        const CellLevel& fine = body.levels[l - 1];
        const CellLevel& coarse = body.levels[l];
        const int air = 8 >> l;
        int strictly = 0;
        volume::forEachIndex(Index3(air), Index3(air + (32 >> l) - 1), [&](Index3 c) {
            const std::size_t at = coarse.nodes.offset(c);
            const Means mu = meansOf(fine, 2 * c, [&](std::size_t i) { return static_cast<double>(fine.mu[i]); });
            const Means bulk = meansOf(fine, 2 * c, [&](std::size_t i) { return bulkOf(fine, i); });
            const double ourMu = static_cast<double>(coarse.mu[at]);
            EXPECT_GE(ourMu, mu.harmonic * (1.0 - 1e-5));
            EXPECT_LE(ourMu, mu.arithmetic * (1.0 + 1e-5));
            EXPECT_GE(bulkOf(coarse, at), bulk.harmonic * (1.0 - 1e-5));
            EXPECT_LE(bulkOf(coarse, at), bulk.arithmetic * (1.0 + 1e-5));
            strictly += ourMu > 1.01 * mu.harmonic && ourMu < 0.99 * mu.arithmetic ? 1 : 0;
        });
        EXPECT_GT(strictly, 0);
    }
}

// Where all is the same, it stays the same at every level.
TEST(ElasticBody, HomogeneousTissueIsTheSameAtEveryLevel)
{
    const ElasticBody body = tests::bodyOf(tests::shell(32, 1, 1e-3, 1e4, 0.45, 8));
    for (const CellLevel& level : body.levels) {
        const Index3 middle = level.nodes.size / 2;
        const std::size_t at = level.nodes.offset(middle);
        EXPECT_NEAR(level.mu[at], 1e4 / 2.9, 0.1);
        EXPECT_NEAR(level.lambda[at], 1e4 * 0.45 / (1.45 * 0.1), 1.0);
    }
}

// A layer on a base that ends inside of coarse cells: what is left of a cell is as much stiffer as it is thinner, so that
// the layer's compliance is that of its thickness at every level.
TEST(ElasticBody, WhatIsHeldLeavesLessOfACoarseCellToGiveWay)
{
    for (const int layer : {25, 26, 27}) {
        const auto material = [=](Index3 c) { return tests::tissue(1e4, 0.45, c.y >= layer); };
        const ElasticBody body = tests::bodyOf(ElasticBlock{Index3(32), 1e-3, material, 8, Vec3(0.0)});
        ASSERT_GE(body.levels.size(), 4U);
        for (int l = 0; l < 4; ++l) {
            const CellLevel& level = body.levels[static_cast<std::size_t>(l)];
            const Index3 middle = level.nodes.size / 2;
            double compliance = 0.0;
            for (int y = 8 >> l; y < (8 + 32) >> l; ++y) {
                const std::size_t below = level.nodes.offset({middle.x, y + 1, middle.z});
                const std::size_t at = level.nodes.offset({middle.x, y, middle.z});
                const bool gives = level.fixed[at] == 0 || level.fixed[below] == 0;
                compliance += gives ? level.nodes.spacing / static_cast<double>(level.mu[at]) : 0.0;
            }
            EXPECT_NEAR(compliance * 1e4 / 2.9, layer * 1e-3, 1e-6) << "layer " << layer << ", level " << l;
        }
    }
}

// A base that ends inside of a cell of the finest level holds the nodes on its side, and no others.
TEST(ElasticBody, NodesAreHeldWhereHalfOfTheTissueAroundThemIs)
{
    for (const float fraction : {0.0F, 0.3F, 0.7F, 1.0F}) {
        const auto material = [=](Index3 c) {
            volume::CellMaterial m = tests::tissue(1e4, 0.45);
            m.fixed = c.y < 4 ? 0.0F : c.y == 4 ? fraction : 1.0F;
            return m;
        };
        const ElasticBody body = tests::bodyOf(ElasticBlock{Index3(8), 1e-3, material, 1, Vec3(0.0)});
        const CellLevel& level = body.levels.front();
        const auto held = [&](int y) { return level.fixed[level.nodes.offset({4, y + 1, 4})] != 0; };
        EXPECT_EQ(held(4), fraction == 1.0F) << fraction;
        EXPECT_TRUE(held(5)) << fraction;
        EXPECT_FALSE(held(3)) << fraction;
    }
}

// Poisson's ratio is lowered to the cap.
TEST(ElasticBody, PoissonsRatioIsCapped)
{
    const ElasticBody body = tests::bodyOf(tests::heldBlock(Index3(8), 1e-3, 1e4, 0.499), 0.47);
    const CellLevel& level = body.levels.front();
    const std::size_t at = level.nodes.offset(Index3(4));
    EXPECT_NEAR(level.lambda[at] / (level.lambda[at] + level.mu[at]), 2.0 * 0.47, 1e-5);
}

// Where the faces lie in the grid must not matter: areas of a box, but for its edges, and of a sphere, each within 2 %.
TEST(ElasticBody, SurfacePointsHaveTheAreaOfAPlane)
{
    for (const double shift : {0.0, 0.2, 0.5, 0.7}) {
        for (const Vec3 normal : {Vec3(0, -1, 0), glm::normalize(Vec3(0.3, -1, 0.2)), glm::normalize(Vec3(1, -1, 1))}) {
            const volume::NodeGrid grid{Index3(40), Vec3(0.5e-3), 1e-3};
            const Vec3 middle(20e-3 + shift * 1e-3);
            std::vector<volume::CellMaterial> materials(grid.count(), tests::tissue(1e4, 0.45));
            const auto plane = tests::distanceOn(grid, [&](Vec3 p) { return glm::dot(p - middle, normal); });
            const ElasticBody body = elasticBody(grid, materials, plane, 0.49);
            double area = 0.0;
            const double radius = 12e-3;
            for (const SurfacePoint& p : body.points) {
                EXPECT_NEAR(glm::dot(Vec3(p.position) - middle, normal), 0.0, 1e-7);
                area += glm::distance(Vec3(p.position), middle) < radius ? static_cast<double>(p.area) : 0.0;
            }
            EXPECT_NEAR(area / (std::numbers::pi * radius * radius), 1.0, 0.02) << shift;
        }
    }
}

TEST(ElasticBody, SurfacePointsHaveTheAreaOfASphere)
{
    for (const double radius : {6e-3, 10.3e-3, 17e-3}) {
        const volume::NodeGrid grid{Index3(40), Vec3(0.5e-3), 1e-3};
        const Vec3 middle(20.3e-3, 19.8e-3, 20.1e-3);
        std::vector<volume::CellMaterial> materials(grid.count());
        volume::forEachIndex(Index3(0), grid.size - 1, [&](Index3 c) {
            const double fraction = std::clamp(0.5 - (glm::distance(grid.position(c), middle) - radius) / 1e-3, 0.0, 1.0);
            materials[grid.offset(c)] = tests::tissue(1e4 * fraction, 0.45);
        });
        const auto ball = tests::distanceOn(grid, [&](Vec3 p) { return glm::distance(p, middle) - radius; });
        const ElasticBody body = elasticBody(grid, materials, ball, 0.49);
        EXPECT_NEAR(areaOf(body) / (4.0 * std::numbers::pi * radius * radius), 1.0, 0.02) << radius;
    }
}

// The lists that a search goes through have every point exactly once.
TEST(ElasticBody, RowsListEveryCellAndCellsEveryPoint)
{
    const ElasticBody body = tests::bodyOf(tests::heldBlock({12, 9, 7}, 1e-3, 1e4, 0.45));
    const Index3 size = body.levels.front().nodes.size;
    std::size_t points = 0;
    for (int z = 0; z < size.z; ++z) {
        for (int y = 0; y < size.y; ++y) {
            const auto row = static_cast<std::size_t>(y + z * size.y);
            for (std::uint32_t c = body.rows[row]; c < body.rows[row + 1]; ++c) {
                EXPECT_EQ(body.cells[c].cell.y, y);
                EXPECT_EQ(body.cells[c].cell.z, z);
                EXPECT_EQ(body.cells[c].first, points);
                points += body.cells[c].count;
            }
        }
    }
    EXPECT_EQ(points, body.points.size());
    EXPECT_GT(points, 500U);
}

// Soft cells on a plane with nothing fixed; `rest` is the plane's place along y [m].
ElasticBody restingSlab(double rest)
{
    constexpr double h = 1e-3;
    const volume::NodeGrid grid{Index3(48), Vec3(0.5 * h), h};
    const Vec3 low(8 * h), high(40 * h);
    std::vector<volume::CellMaterial> materials(grid.count());
    volume::forEachIndex(Index3(8), Index3(39), [&](Index3 c) {
        const double held = std::clamp((c.y + 1) - rest / h, 0.0, 1.0);
        volume::CellMaterial m = tests::tissue(held < 1.0 ? 1e4 / (1.0 - held) : 1e4, 0.45);
        m.fixed = static_cast<float>(held);
        materials[grid.offset(c)] = m;
    });
    const auto surface = tests::distanceOn(grid, [&](Vec3 p) { return tests::boxDistance(p, low, high); });
    return elasticBody(grid, materials, surface, 0.49, 0.0, false, volume::Support{{0.0, rest, 0.0}, {0.0, -1.0, 0.0}});
}

// A body on a support, wherever that lies in the grid: at every level the cells before it have the compliance of what is
// left of the body, and nodes are held where the body meets it.
TEST(ElasticBody, ASupportLeavesTheBodysOwnComplianceAtEveryLevel)
{
    for (const double rest : {36.0e-3, 36.3e-3, 37.9e-3}) {
        const ElasticBody body = restingSlab(rest);
        ASSERT_GE(body.levels.size(), 4U);
        for (const CellLevel& level : body.levels) {
            const double h = level.nodes.spacing;
            const Index3 middle(Vec3(24e-3 / h));
            double compliance = 0.0;
            for (int y = 0; y + 1 < level.nodes.size.y && level.nodes.position({0, y, 0}).y < rest - 1e-6; ++y) {
                const double mu = static_cast<double>(level.mu[level.nodes.offset({middle.x, y, middle.z})]);
                compliance += mu > 0.0 ? h / mu : 0.0;
            }
            EXPECT_NEAR(compliance * 1e4 / 2.9, rest - 8e-3, 1e-5) << "support " << rest << ", spacing " << h;
            volume::forEachIndex(Index3(0), level.nodes.size - 1, [&](Index3 n) {
                const Vec3 p = level.nodes.position(n);
                const double beside = 16e-3 - std::max(std::abs(p.x - 24e-3), std::abs(p.z - 24e-3));  // inside the body
                const bool under = p.y >= rest - 1e-6 && beside > 0.1e-3;
                const bool clear = p.y < rest - 1e-5 || beside < -0.6 * h;
                EXPECT_TRUE(!under || level.fixed[level.nodes.offset(n)] != 0) << h;
                EXPECT_TRUE(!clear || level.fixed[level.nodes.offset(n)] == 0) << h;
            });
        }
    }
}

// A ball on its back, 5 % of its depth behind the plane: what holds it is a disc of pi (2 R d - d^2), at every level that
// has cells enough; it does not grow by the cells' size, which would stop the ball from tipping.
TEST(ElasticBody, ARoundBodyIsHeldWhereItMeetsItsSupport)
{
    constexpr double h = 1e-3, radius = 30e-3;
    const volume::NodeGrid grid{Index3(72), Vec3(0.5 * h), h};
    const Vec3 middle(36.2e-3, 36.0e-3, 35.7e-3);
    const double rest = middle.y + 0.9 * radius;
    std::vector<volume::CellMaterial> materials(grid.count());
    volume::forEachIndex(Index3(1), grid.size - 2, [&](Index3 c) {
        const Vec3 p = grid.position(c);
        const double fraction = std::clamp(0.5 - (glm::distance(p, middle) - radius) / h, 0.0, 1.0);
        materials[grid.offset(c)] = tests::tissue(1e4 * fraction, 0.45, p.y > rest);
    });
    const auto ball = tests::distanceOn(grid, [&](Vec3 p) { return glm::distance(p, middle) - radius; });
    const ElasticBody body =
        elasticBody(grid, materials, ball, 0.49, 0.0, false, volume::Support{{0.0, rest, 0.0}, {0.0, -1.0, 0.0}});
    const double disc = std::numbers::pi * 0.19 * radius * radius;
    for (std::size_t l = 0; l < 3; ++l) {
        const CellLevel& level = body.levels[l];
        const double side = level.nodes.spacing;
        int held = 0;  // faces of cells, on the first plane of nodes at the support or behind it
        volume::forEachIndex(Index3(0), level.nodes.size - 2, [&](Index3 n) {
            const double behind = level.nodes.position(n).y - rest;
            bool all = behind >= -1e-6 && behind < side - 1e-6;
            for (const Index3 corner : {Index3(0, 0, 0), Index3(1, 0, 0), Index3(0, 0, 1), Index3(1, 0, 1)}) {
                all = all && level.fixed[level.nodes.offset(n + corner)] != 0;
            }
            held += all ? 1 : 0;
        });
        EXPECT_NEAR(held * side * side / disc, 1.0, l < 2 ? 0.05 : 0.25) << side;
    }
}

// Skin of one cell on soft tissue, stiffer by 20: the coarser cells at the surface have the stiffness of layers side by
// side, shares of each; those that hold the same layers inside of the body have less.
TEST(ElasticBody, CoarseCellsUnderAFreeSurfaceAreLaminates)
{
    constexpr int first = 8, deep = 24;
    const auto material = [](Index3 c) { return tests::tissue(c.y == 0 || c.y == deep ? 20e3 : 1e3, 0.45, c.y == 31); };
    const ElasticBody body = tests::bodyOf(ElasticBlock{Index3(32), 1e-3, material, first, Vec3(0.0)});
    for (std::size_t l = 1; l < 4; ++l) {
        const CellLevel& level = body.levels[l];
        const auto modulus = [&](int y) {
            const int at = static_cast<int>(24 >> l);
            return 2.9 * static_cast<double>(level.mu[level.nodes.offset({at, (first + y) >> l, at})]);
        };
        const double share = 1.0 / (1 << l);
        const double laminate = 20e3 * share + 1e3 * (1.0 - share);
        EXPECT_NEAR(modulus(0) / laminate, 1.0, 1e-4) << l;
        EXPECT_LT(modulus(deep), 0.8 * laminate) << l;
    }
}

// A bar stands on a plate of bone that is wider than it and ends within the cells of every level. Bone is 1e5 times as
// stiff: a node in front of it, where the bar is free, that were a corner of a cell of bone would be held.
TEST(ElasticBody, BoneHoldsNoNodeInFrontOfIt)
{
    const auto material = [](Index3 c) {
        const bool isBar = c.y >= 3 && c.y < 13 && c.z >= 3 && c.z < 13;
        return c.x < 9 ? tests::tissue(1e9, 0.3, true) : isBar ? tests::tissue(1e4, 0.49) : tests::tissue(0.0, 0.0);
    };
    const ElasticBody body = tests::bodyOf({{40, 16, 16}, 2e-3, material, 4, Vec3(0.0)});
    ASSERT_GT(body.levels.size(), 2U);
    for (std::size_t l = 1; l < body.levels.size(); ++l) {
        const CellLevel& level = body.levels[l];
        float most = 0.0F;
        int freeNodes = 0;
        for (std::size_t n = 0; n < level.diagonal.size(); ++n) {
            const bool isFree = level.fixed[n] == 0 && level.diagonal[n] > 0.0F;
            freeNodes += isFree ? 1 : 0;
            most = std::max(most, isFree ? level.diagonal[n] : 0.0F);
        }
        EXPECT_GT(freeNodes, 0) << l;
        EXPECT_LT(most, 2e3F * static_cast<float>(1U << l)) << l;  // a cell of bone adds 1e7 and more
    }
}

// Of a block whose surface lies on nodes, those of the first two layers under it, but for held ones and their like.
TEST(ElasticBody, NodesUnderTheSurfaceAreThoseWithTissueAllAround)
{
    auto block = tests::heldBlock({8, 9, 10}, 2e-3, 1e4, 0.45);
    block.material = [soft = block.material](Index3 c) {
        volume::CellMaterial m = soft(c);
        m.youngsModulus *= c == Index3(3, 1, 4) ? 0.5F : 1.0F;
        return m;
    };
    const ElasticBody body = tests::bodyOf(block);
    const auto mu = [](double e) { return static_cast<float>(e / (2.0 * 1.45)); };
    std::vector<SubsurfaceNode> expected;
    volume::forEachIndex(Index3(1), block.cells - 1, [&](Index3 n) {
        const Index3 deep = glm::min(n, block.cells - n);
        const bool isFixed = n.y >= block.cells.y - 1;
        if (std::min({deep.x, deep.y, deep.z}) <= 2 && !isFixed) {
            const Index3 off = n - Index3(3, 1, 4);
            const bool besideTheSofter = off == glm::clamp(off, Index3(0), Index3(1));
            expected.push_back({n + block.air, mu(besideTheSofter ? 5e3 : 1e4)});
        }
    });
    ASSERT_EQ(body.subsurface.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
        EXPECT_EQ(body.subsurface[i].node, expected[i].node);
        EXPECT_FLOAT_EQ(body.subsurface[i].mu, expected[i].mu);
    }
}

}  // namespace
}  // namespace palpate::chainmail
