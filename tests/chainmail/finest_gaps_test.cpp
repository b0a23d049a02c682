// Gaps that are narrower than the cells of the finest level: their eighths say what hangs together.
#include "elastic_bodies.h"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <random>
#include <set>
#include <span>
#include <vector>

namespace palpate::chainmail {
namespace {

constexpr double edge = 2e-3;
constexpr std::uint8_t lowHalf = 0x55, highHalf = 0xAA;  // octants along x

// Two slabs of 16 x 16 x 48 mm, side by side along x, in bone at the end of z, with a gap of half a cell between them: in
// the cells of the first slab that are beside it, or in those of the second. Or only the second of them.
ElasticBody slabs(bool gapIsInFirst, bool both)
{
    const auto material = [=](Index3 c) {
        const bool isHeld = c.z >= 24, isFirst = c.x < 8;
        if (isFirst && !both) {
            return volume::CellMaterial{};
        }
        auto tissue = tests::tissue(5e3, 0.45, isHeld);
        if (gapIsInFirst ? c.x == 7 : c.x == 8) {
            tissue.youngsModulus *= 0.5F;
            tissue.octants = gapIsInFirst ? lowHalf : highHalf;
        }
        return tissue;
    };
    return tests::bodyOf({Index3(16, 8, 26), edge, material, 4, Vec3(0.0)});
}

// Force of a ball that presses the second slab's end by 3 mm, along the gap or across it.
double forceOnSlab(Elastic& elastic, bool acrossGap)
{
    const Vec3 way = acrossGap ? Vec3(-1, 0, 0) : Vec3(0, 1, 0);
    const Vec3 top = acrossGap ? Vec3(32e-3, 8e-3, 8e-3) : Vec3(24e-3, 0.0, 8e-3);
    ElasticTool tool{{top, top, 6e-3, 6e-3}, Vec3(0.0)};
    for (int i = 0; i <= 30; ++i) {
        const double depth = 1e-4 * i;
        tool.shape.a = tool.shape.b = top + (depth - 6e-3) * way;
        tool.pushed = depth * way;
        elastic.relax({std::span(&tool, 1), {}, {top, way, 0.0}}, i < 30 ? 4 : 300, 1e-5);
    }
    return -glm::dot(elastic.toolForce(0), way);
}

// A slab beside another one is as soft as alone, whichever of them has the cells that the gap runs through. As one they
// would be twice as stiff along the gap, and up to four times across it.
TEST(FinestGaps, ASlabBesideAnotherBendsAsItDoesAlone)
{
    for (const bool gapIsInFirst : {false, true}) {
        for (const bool acrossGap : {false, true}) {
            const ElasticBody one = slabs(gapIsInFirst, false), two = slabs(gapIsInFirst, true);
            ElasticOptions options;
            options.window = 9;
            options.law = volume::NeoHookean{};
            const Focus focus{Vec3(24e-3, 0.0, 8e-3), Vec3(0, 1, 0), 0.0};
            Elastic alone(one, options, focus), beside(two, options, focus);
            const double expected = forceOnSlab(alone, acrossGap);
            EXPECT_NEAR(forceOnSlab(beside, acrossGap), expected, 0.03 * expected)
                << "gap in the first: " << gapIsInFirst << ", across it: " << acrossGap;
            for (const double z : {4e-3, 20e-3, 36e-3}) {
                const double moved = glm::length(beside.displacement({24e-3, 8e-3, z}));
                const double other = glm::length(beside.displacement({gapIsInFirst ? 14.5e-3 : 15.5e-3, 8e-3, z}));
                const double own = glm::length(beside.displacement({gapIsInFirst ? 16.5e-3 : 17.5e-3, 8e-3, z}));
                EXPECT_LT(other, 0.02 * moved) << "z " << z;
                EXPECT_GT(own, 0.5 * moved) << "z " << z;
            }
        }
    }
}

// A cell that a gap divides from the tissue beside it is a fragment, with the material that it had; its nodes are held
// where the cell's are.
TEST(FinestGaps, AFragmentIsItsCell)
{
    std::mt19937 random(23);
    const Index3 cells(12);
    std::vector<volume::CellMaterial> all(static_cast<std::size_t>(cells.x * cells.y * cells.z));
    for (volume::CellMaterial& m : all) {
        m = random() % 3 == 0 ? volume::CellMaterial{} : tests::tissue(5e3, 0.45, random() % 50 == 0);
        m.relaxing = {0.3F, 0.1F * static_cast<float>(random() % 4)};
        m.octants = static_cast<std::uint8_t>(random() & random());
    }
    const auto of = [&](Index3 c) { return all[static_cast<std::size_t>(c.x + cells.x * (c.y + cells.y * c.z))]; };
    const ElasticBody body = tests::bodyOf({cells, edge, of, 2, Vec3(0.0)}, 0.4999, true);
    const ElasticBody whole = tests::bodyOf({cells, edge,
                                             [&](Index3 c) {
                                                 auto m = of(c);
                                                 m.octants = 0xFF;
                                                 return m;
                                             },
                                             2, Vec3(0.0)},
                                            0.4999, true);
    const CellLevel &finest = body.levels.front(), &expected = whole.levels.front();
    EXPECT_GT(finest.fragments.cells.size(), 20U);
    for (const CellFragment& f : finest.fragments.cells) {
        const std::size_t at = finest.nodes.offset(f.cell);
        EXPECT_EQ(f.mu, expected.mu[at]);
        EXPECT_EQ(f.lambda, expected.lambda[at]);
        EXPECT_EQ(f.held, of(f.cell - 2).fixed);
        EXPECT_EQ(f.relaxing[1], expected.relaxing[1][at]);
        EXPECT_EQ(finest.mu[at], 0.0F);
        EXPECT_EQ(muAt(finest, finest.nodes.position(f.cell) + 0.3 * edge), f.mu);
        EXPECT_EQ(finest.fragments.in(f.cell, finest.nodes.size.y).size(), 1U);
    }
    int held = 0;
    for (const VirtualNode& n : finest.fragments.nodes) {
        EXPECT_EQ(n.isFixed, finest.fixed[finest.nodes.offset(n.at)] != 0);
        held += n.isFixed ? 1 : 0;
    }
    EXPECT_GT(held, 0);
}

// What lies behind a support is tissue, and no cell: it is no fragment. Without stiffness its share of the operator's
// diagonal was not a number, and no tool met the body.
TEST(FinestGaps, WhatLiesBehindASupportIsNoFragment)
{
    std::mt19937 random(31);
    const volume::NodeGrid grid{Index3(16), Vec3(0.5 * edge), edge};
    std::vector<volume::CellMaterial> materials(grid.count());
    volume::forEachIndex(Index3(3), Index3(12), [&](Index3 c) {
        auto& m = materials[grid.offset(c)];
        m = tests::tissue(5e3, 0.45, c.y >= 9);
        m.octants = random() % 4 != 0 ? static_cast<std::uint8_t>(random() & random()) : std::uint8_t{0xFF};
    });
    const auto surface =
        tests::distanceOn(grid, [](Vec3 p) { return tests::boxDistance(p, Vec3(3 * edge), Vec3(13 * edge)); });
    const volume::Support support{{0.0, 9 * edge, 0.0}, {0.0, -1.0, 0.0}};
    const ElasticBody body = elasticBody(grid, materials, surface, 0.49, 0.0, false, support);
    EXPECT_GT(body.levels.front().fragments.cells.size(), 5U);
    for (const CellLevel& level : body.levels) {
        EXPECT_TRUE(std::isfinite(level.radius));
        for (const CellFragment& f : level.fragments.cells) {
            EXPECT_GT(f.mu, 0.0F);
        }
        for (const float d : level.diagonal) {
            ASSERT_TRUE(std::isfinite(d));
        }
    }
}

// Tissue that a gap of half a cell separates from all that is held has no place of its own: it stays with what is beside
// it.
TEST(FinestGaps, LooseTissueStaysWithWhatIsNear)
{
    const auto material = [](Index3 c) {
        auto tissue = tests::tissue(5e3, 0.45, c.x < 2);
        tissue.octants = c.x == 7 ? lowHalf : std::uint8_t{0xFF};
        return tissue;
    };
    EXPECT_TRUE(tests::bodyOf({Index3(16, 8, 8), edge, material, 4, Vec3(0.0)}).levels.front().fragments.cells.empty());
}

// Tissue of a cell of which places are filled as told, in cells: of each eighth, its middle says what it is.
template <typename IsFilled>
volume::CellMaterial sampled(Index3 c, bool isHeld, const IsFilled& isFilled)
{
    bool any = false;
    for (int k = 0; k < 512; ++k) {
        any = any || isFilled(Vec3(c) + (Vec3(k % 8, k / 8 % 8, k / 64) + 0.5) / 8.0);
    }
    if (!any) {
        return {};
    }
    auto tissue = tests::tissue(5e3, 0.45, isHeld);
    tissue.octants = 0;
    for (int k = 0; k < 8; ++k) {
        tissue.octants |= static_cast<std::uint8_t>(isFilled(Vec3(c) + 0.5 * Vec3(octant(k)) + 0.25) ? 1 << k : 0);
    }
    tissue.quarters = 0;
    for (int k = 0; k < 64; ++k) {
        const bool is = isFilled(Vec3(c) + 0.25 * Vec3(k % 4, k / 4 % 4, k / 16) + 0.125);
        tissue.quarters |= is ? std::uint64_t{1} << k : std::uint64_t{0};
    }
    return tissue;
}

// The steps of voxels on a smooth surface are no gaps, at any place in the grid: balls in which some cells have one octant
// of tissue, and none.
TEST(FinestGaps, StepsOfVoxelsAreNoGaps)
{
    std::mt19937 random(5);
    std::uniform_real_distribution<double> shift(0.0, 1.0);
    for (int i = 0; i < 20; ++i) {
        const Vec3 middle = Vec3(8.0) + Vec3(shift(random), shift(random), shift(random));
        const double radius = 5.0 + 2.0 * shift(random);
        const auto isFilled = [&](Vec3 p) { return glm::distance(glm::floor(1.3 * p) / 1.3 + 0.385, middle) < radius; };
        int slivers = 0;
        const auto material = [&](Index3 c) {
            const auto m = sampled(c, glm::distance(Vec3(c) + 0.5, middle) < 2.0, isFilled);
            slivers += m.youngsModulus > 0.0F && std::popcount(m.octants) < 2 ? 1 : 0;
            return m;
        };
        const ElasticBody body = tests::bodyOf({Index3(18), edge, material, 3, Vec3(0.0)});
        EXPECT_GT(slivers, 10);
        EXPECT_TRUE(body.levels.front().fragments.cells.empty()) << "ball " << i;
    }
}

// Which nodes of a level hang together.
class Parts {
public:
    explicit Parts(const CellLevel& level) : level_(level), lead_(level.nodes.count() + level.fragments.nodes.size())
    {
        std::iota(lead_.begin(), lead_.end(), std::size_t{0});
        volume::forEachIndex(Index3(0), level.nodes.size - 2, [&](Index3 c) {
            if (level.mu[level.nodes.offset(c)] > 0.0F) {
                join(boxNodesOf(c));
            }
        });
        for (const CellFragment& f : level.fragments.cells) {
            join(f.nodes);
        }
    }

    std::size_t count() const { return members_.size(); }
    // One node of that which a cell of the level belongs to.
    std::size_t of(Index3 cell) const
    {
        const auto own = level_.fragments.in(cell, level_.nodes.size.y);
        return leadOf(own.empty() ? boxNodesOf(cell)[0] : own.front().nodes[0]);
    }

private:
    std::array<std::uint32_t, 8> boxNodesOf(Index3 cell) const
    {
        std::array<std::uint32_t, 8> nodes{};
        for (int k = 0; k < 8; ++k) {
            nodes[static_cast<std::size_t>(k)] = static_cast<std::uint32_t>(level_.nodes.offset(cell + octant(k)));
        }
        return nodes;
    }
    std::size_t leadOf(std::size_t i) const
    {
        while (lead_[i] != i) {
            i = lead_[i];
        }
        return i;
    }
    void join(const std::array<std::uint32_t, 8>& nodes)
    {
        for (const std::uint32_t n : nodes) {
            members_.erase(leadOf(n));
            lead_[leadOf(n)] = leadOf(nodes[0]);
        }
        members_.insert(leadOf(nodes[0]));
    }

    const CellLevel& level_;
    std::vector<std::size_t> lead_;
    std::set<std::size_t> members_;  // a node of each part
};

// A gap of a quarter of a cell and more through all of a body leaves two parts on every level, at any angle and place.
TEST(FinestGaps, AnObliqueGapLeavesTwoParts)
{
    std::mt19937 random(29);
    std::normal_distribution<double> any;
    std::uniform_real_distribution<double> widths(0.26, 2.0);
    for (int i = 0; i < 60; ++i) {
        const Vec3 normal = glm::normalize(Vec3(any(random), any(random), any(random)));
        const Vec3 middle = Vec3(8.0) + 0.3 * Vec3(any(random), any(random), any(random));
        const double width = i < 20 ? 0.26 : widths(random);
        const auto material = [&](Index3 c) {
            const double off = glm::dot(normal, Vec3(c) + 0.5 - middle);
            return sampled(c, std::abs(off) > 4.8,
                           [&](Vec3 p) { return std::abs(glm::dot(normal, p - middle)) > 0.5 * width; });
        };
        for (const CellLevel& level : tests::bodyOf({Index3(16), edge, material, 3, Vec3(0.0)}).levels) {
            EXPECT_EQ(Parts(level).count(), 2U) << width << ": " << normal.x << " " << normal.y << " " << normal.z;
        }
    }
}

// A slanted sheet of one layer of voxels hangs together as far as its eighths do, though its voxels share edges alone where
// it has a step: of strips that are held at their ends each would otherwise be a part of its own.
TEST(FinestGaps, ASlantedSheetOfOneVoxelIsNotCut)
{
    std::mt19937 random(37);
    std::normal_distribution<double> any;
    int one = 0;
    for (int i = 0; i < 16; ++i) {
        const Vec3 normal = glm::normalize(Vec3(any(random), any(random), any(random)));
        const Vec3 middle = Vec3(8.0) + 0.3 * Vec3(any(random), any(random), any(random));
        const double voxel = std::array{0.5, 0.66, 0.75}[static_cast<std::size_t>(i % 3)];
        const double thick = voxel * std::max({std::abs(normal.x), std::abs(normal.y), std::abs(normal.z)});
        const auto isFilled = [&](Vec3 p) {
            const Vec3 ofVoxel = voxel * (glm::floor(p / voxel) + 0.5);
            return std::abs(glm::dot(normal, ofVoxel - middle)) < 0.5 * thick + 1e-9;
        };
        const auto parts = [&](bool isCut) {
            const auto material = [&](Index3 c) {
                auto tissue = sampled(c, glm::distance(Vec3(c) + 0.5, middle) > 6.0, isFilled);
                tissue.quarters = isCut ? tissue.quarters : ~std::uint64_t{0};
                return tissue;
            };
            return Parts(tests::bodyOf({Index3(16), edge, material, 3, Vec3(0.0)}).levels.front()).count();
        };
        const std::size_t found = parts(true);
        EXPECT_EQ(found, parts(false)) << voxel << ": " << normal.x << " " << normal.y << " " << normal.z;
        one += found == 1 ? 1 : 0;
    }
    EXPECT_GT(one, 8);
}

// A place on the wall of a gap of a third of a cell moves with the tissue behind it, also where its cell is the other
// side's.
TEST(FinestGaps, AWallMovesWithItsOwnSide)
{
    std::mt19937 random(41);
    std::normal_distribution<double> any;
    std::size_t points = 0;
    for (int i = 0; i < 40; ++i) {
        const Vec3 normal = glm::normalize(Vec3(any(random), any(random), any(random)));
        const Vec3 middle = Vec3(8.0) + 0.3 * Vec3(any(random), any(random), any(random));
        const double width = 0.3 + 0.05 * (i % 20);
        const volume::NodeGrid grid{Index3(22), Vec3(-2.5 * edge), edge};
        std::vector<volume::CellMaterial> materials(grid.count());
        volume::forEachIndex(Index3(0), Index3(15), [&](Index3 c) {
            const double off = glm::dot(normal, Vec3(c) + 0.5 - middle);
            materials[grid.offset(c + 3)] = sampled(
                c, std::abs(off) > 4.8, [&](Vec3 p) { return std::abs(glm::dot(normal, p - middle)) > 0.5 * width; });
        });
        const auto surface = tests::distanceOn(grid, [&](Vec3 p) {
            const double inGap = edge * 0.5 * width - std::abs(glm::dot(normal, p - edge * middle));
            return std::max(tests::boxDistance(p, Vec3(0.0), Vec3(16 * edge)), inGap);
        });
        const ElasticBody body = elasticBody(grid, materials, surface, 0.49, 0.0, false, {});
        const CellLevel& level = body.levels.front();
        const Parts parts(level);
        const auto offOf = [&](Vec3 place) { return glm::dot(normal, place - edge * middle); };
        const auto isOfWall = [&](const SurfacePoint& p) {
            const double off = offOf(Vec3(p.position));
            const bool isDeep = tests::boxDistance(Vec3(p.position), Vec3(0.0), Vec3(16 * edge)) < -3 * edge;
            return isDeep && off * glm::dot(normal, Vec3(p.normal)) < -0.9 * std::abs(off);
        };
        std::array<std::set<std::size_t>, 2> sides;  // the parts that each side's wall moves with
        for (const SurfacePoint& p : body.points) {
            if (isOfWall(p)) {
                sides[offOf(Vec3(p.position)) > 0.0 ? 1 : 0].insert(parts.of(level.nodes.cellAt(Vec3(p.anchor))));
                ++points;
            }
        }
        for (const std::size_t part : sides[0]) {
            EXPECT_FALSE(sides[1].contains(part)) << width;
        }
        EXPECT_FALSE(sides[0].empty() || sides[1].empty());
        // The parts of these places that a small tool in the gap is given.
        const WindowStack stack(body, 21, tests::focusAt(edge * middle));
        const ElasticTool tool{{edge * middle, edge * middle, 1.5 * edge, 1.5 * edge}, Vec3(0.1 * edge)};
        std::vector<ContactSite> sites(20000);
        sites.resize(findSites(body, stack.windows(), std::span(&tool, 1),
                               std::vector{occupancy::ShapeDistance(tool.shape)}, {}, edge, sites));
        EXPECT_GT(sites.size(), 100U);
        for (const ContactSite& site : sites) {
            const SurfacePoint& point = body.points[site.point];
            const bool isHere = offOf(Vec3(point.position)) > 0.0;
            EXPECT_FALSE(isOfWall(point) && sides[isHere ? 0 : 1].contains(parts.of(level.nodes.cellAt(site.anchor))))
                << width;
        }
    }
    EXPECT_GT(points, 1000U);
}

// The outer face of a flap of half a cell, with a gap of half a cell under it, moves with the flap, and has its stiffness.
TEST(FinestGaps, TheFaceOfAThinFlapMovesWithTheFlap)
{
    const volume::NodeGrid grid{Index3(14), Vec3(-2.5 * edge), edge};
    std::vector<volume::CellMaterial> materials(grid.count());
    volume::forEachIndex(Index3(0), Index3(7), [&](Index3 c) {
        materials[grid.offset(c + 3)] = sampled(c, c.x < 2, [](Vec3 p) { return p.y < 0.5 || p.y > 1.0; });
        materials[grid.offset(c + 3)].youngsModulus *= c.y == 0 ? 3.0F : 1.0F;
    });
    const volume::NodeGrid fine{Index3(53), Vec3(-2.5 * edge), 0.25 * edge};
    const auto surface = tests::distanceOn(fine, [&](Vec3 p) {
        const double flap = tests::boxDistance(p, Vec3(0.0), Vec3(8.0, 0.5, 8.0) * edge);
        return std::min(flap, tests::boxDistance(p, Vec3(0.0, 1.0, 0.0) * edge, Vec3(8 * edge)));
    });
    const ElasticBody body = elasticBody(grid, materials, surface, 0.49);
    const CellLevel& level = body.levels.front();
    int points = 0;
    for (const SurfacePoint& p : body.points) {
        const bool isInner =
            p.position.x > 2.5 * edge && p.position.x < 6 * edge && std::abs(p.position.z - 4 * edge) < 2 * edge;
        if (isInner && p.normal.y < -0.9F && p.position.y < 0.2 * edge) {
            EXPECT_EQ(level.nodes.cellAt(Vec3(p.anchor)).y, level.nodes.cellAt(Vec3(0.5 * edge)).y);
            EXPECT_GT(p.mu, 2.0F * level.mu[level.nodes.offset(level.nodes.cellAt(Vec3(5.5 * edge)))]);
            ++points;
        }
    }
    EXPECT_GT(points, 20);
}

}  // namespace
}  // namespace palpate::chainmail
