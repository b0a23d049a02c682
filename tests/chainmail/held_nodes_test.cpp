#include <chainmail/held_nodes.h>

#include "elastic_bodies.h"
#include "voxel_body.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

namespace palpate::chainmail {
namespace {

constexpr int gridSide = 12;  // cells

const volume::NodeGrid boneCells{Index3(gridSide), Vec3(0.5), 1.0};
const volume::NodeGrid boneNodes{Index3(gridSide + 1), Vec3(0.0), 1.0};

// Full cells of soft tissue of modulus 1 kPa, with bone where isBone(p) [cells].
template <typename IsBone>
std::vector<volume::CellMaterial> materialsOf(const IsBone& isBone)
{
    constexpr int parts = 8;
    std::vector<volume::CellMaterial> materials(boneCells.count());
    volume::forEachIndex(Index3(0), boneCells.size - 1, [&](Index3 c) {
        volume::CellMaterial& m = materials[boneCells.offset(c)];
        int bone = 0;
        Vec3 sum(0.0);
        volume::forEachIndex(Index3(0), Index3(parts - 1), [&](Index3 part) {
            const Vec3 at = (Vec3(part) + 0.5) / static_cast<double>(parts);
            const bool is = isBone(Vec3(c) + at);
            bone += is ? 1 : 0;
            sum += is ? 2.0 * at - 1.0 : Vec3(0.0);
        });
        m.fixed = static_cast<float>(bone) / (parts * parts * parts);
        m.held.middle = bone > 0 ? Vec3f(sum / static_cast<double>(bone)) : Vec3f(0.0F);
        m.youngsModulus = 1e3F / std::max(1.0F - m.fixed, 1e-3F);
        for (int e = 0; e < volume::HeldParts::edgeCount; ++e) {
            for (int k = 0; k < 8; ++k) {
                Vec3 at = Vec3(c + volume::HeldParts::startOf(e));
                at[e / 4] += (k + 0.5) / 8.0;
                m.held.edges[static_cast<std::size_t>(e)] |= static_cast<std::uint8_t>(isBone(at) ? 1U << k : 0U);
            }
        }
    });
    return materials;
}

// Free nodes that edges between free nodes lead to from a corner of the grid.
std::vector<std::uint8_t> reachedFrom(Index3 corner, const std::vector<std::uint8_t>& held)
{
    std::vector<std::uint8_t> reached(boneNodes.count(), 0);
    std::vector<Index3> open{corner};
    reached[boneNodes.offset(corner)] = 1;
    while (!open.empty()) {
        const Index3 n = open.back();
        open.pop_back();
        for (int i = 0; i < 6; ++i) {
            Index3 next = n;
            next[i / 2] += i % 2 == 0 ? 1 : -1;
            if (boneNodes.contains(next) && held[boneNodes.offset(next)] == 0 && reached[boneNodes.offset(next)] == 0) {
                reached[boneNodes.offset(next)] = 1;
                open.push_back(next);
            }
        }
    }
    return reached;
}

// Whatever its angle and place, a plate that is thicker than an eighth of a cell parts the nodes before it from those
// behind it, and holds none that is more than 0.6 cells off it.
TEST(HeldNodes, APlatePartsWhatLiesOnItsSides)
{
    std::mt19937 random(18);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> thickness(0.13, 1.2), place(5.0, 7.0);
    for (int run = 0; run < 200; ++run) {
        const Vec3 way = glm::normalize(glm::abs(Vec3(normal(random), normal(random), normal(random))) + 1e-3);
        const double thick = thickness(random), from = glm::dot(way, Vec3(place(random)));
        const auto depth = [&](Vec3 p) { return glm::dot(way, p) - from; };
        auto materials = materialsOf([&](Vec3 p) { return depth(p) >= 0.0 && depth(p) <= thick; });
        const auto held = heldNodes(boneCells, boneNodes, materials);
        const auto reached = reachedFrom(Index3(0), held);
        volume::forEachIndex(Index3(0), boneNodes.size - 1, [&](Index3 n) {
            const double d = depth(Vec3(n));
            EXPECT_FALSE(d > thick && reached[boneNodes.offset(n)] != 0) << run << " " << d;
            EXPECT_FALSE((d < -0.6 || d > thick + 0.6) && held[boneNodes.offset(n)] != 0) << run << " " << d;
        });
    }
}

// A plate along the grid holds one plane of nodes. What the tissue on its two sides has lost or won so is made up for: a
// cell that is shorter by g has 1 / (1 - g) times its modulus, and one that is longer between the 1 / (1 + g) of tissue
// that is pressed together alone and the cube of that, of tissue that flows sideways.
TEST(HeldNodes, WhatAPlateIsMovedByIsMadeUpFor)
{
    for (int axis = 0; axis < 3; ++axis) {
        for (const double gap : {0.125, 0.25}) {
            for (const bool isLow : {true, false}) {
                const double low = isLow ? 6.0 + gap : 6.75 - gap, high = low + 0.25;
                auto materials = materialsOf([&](Vec3 p) { return p[axis] >= low && p[axis] <= high; });
                const auto held = heldNodes(boneCells, boneNodes, materials);
                Index3 at(5);
                at[axis] = 6;
                Index3 before = at, other = at;
                before[axis] += isLow ? -1 : 1;
                other[axis] += isLow ? 1 : 0;
                Index3 holds = at;
                holds[axis] += isLow ? 0 : 1;
                EXPECT_NE(held[boneNodes.offset(holds)], 0);
                EXPECT_EQ(held[boneNodes.offset(isLow ? other : at)], 0);
                const double longer = materials[boneCells.offset(before)].youngsModulus / 1e3;
                EXPECT_LT(longer, 1.0 / (1.0 + gap));
                EXPECT_GT(longer, std::pow(1.0 + gap, -3.0));
                EXPECT_NEAR(materials[boneCells.offset(at)].youngsModulus, 1e3 / (1.0 - 0.25 - gap), 1.0);
                EXPECT_NEAR(materials[boneCells.offset(at)].fixed, 0.25 + gap, 1e-3);
            }
        }
    }
}

// A rod through the middles of cells crosses none of their edges.
TEST(HeldNodes, ARodIsHeldAllAlong)
{
    auto materials = materialsOf([](Vec3 p) { return std::hypot(p.x - 6.4, p.y - 6.4) < 0.3; });
    const auto held = heldNodes(boneCells, boneNodes, materials);
    for (int z = 0; z < gridSide; ++z) {
        EXPECT_TRUE(held[boneNodes.offset({6, 6, z})] != 0 || held[boneNodes.offset({6, 6, z + 1})] != 0) << z;
    }
}

// Bone of a share of a cell that no segmentation means.
TEST(HeldNodes, AFleckIsNot)
{
    auto materials = materialsOf([](Vec3 p) { return glm::length(p - Vec3(6.3)) < 0.2; });
    for (const std::uint8_t is : heldNodes(boneCells, boneNodes, materials)) {
        EXPECT_EQ(is, 0);
    }
}

constexpr double tipRadius = 6e-3, tipDepth = 3e-3;

// Of a ball on a block of 60 mm of soft tissue over bone [N]. Between 9 mm under the surface and `thick` more is bone.
double forceOver(double spacing, double thick)
{
    const auto body = tests::voxelBody(Index3(78, 72, 78), Vec3(-39e-3, -6e-3, -39e-3), spacing, [&](Vec3 p) {
        const bool inside = std::abs(p.x) < 34e-3 && p.y > 0.0 && p.y < 60e-3 && std::abs(p.z) < 34e-3;
        const bool isBone = p.y > 56e-3 || (p.y > 9e-3 && p.y < 9e-3 + thick);
        return !inside ? 0 : isBone ? 2 : 1;
    });
    Elastic elastic(body, {}, tests::focusUnder(Vec3(0.0)));
    const std::array tools{tests::ball(Vec3(0.7e-3, tipDepth - tipRadius, 0.4e-3), tipRadius)};
    tests::settle(elastic, tests::loadOf(tools, {}, tools[0].shape.a), 1e-3, 100);
    return -elastic.toolForce(0).y;
}

// What lies behind bone is not felt, however thin the bone is. Without a rule for thin bone there was 0.74 of the force.
TEST(HeldNodes, WhatLiesBehindBoneIsNotFelt)
{
    for (const double spacing : {2e-3, 4e-3}) {
        const double thick = forceOver(spacing, 47e-3);
        for (const double plate : {1e-3, 2e-3, 3e-3}) {
            EXPECT_NEAR(forceOver(spacing, plate) / thick, 1.0, 0.07) << spacing << " " << plate;
        }
        EXPECT_LT(forceOver(spacing, 0.0), 0.78 * thick);
    }
}

// A plate through all of a body parts the nodes of every level, also of those whose cells are far wider than it is thick.
TEST(HeldNodes, APlatePartsWiderLevelsToo)
{
    for (const double place : {9e-3, 14e-3, 23e-3, 31e-3, 41e-3}) {
        const auto body = tests::voxelBody(Index3(78, 72, 78), Vec3(-39e-3, -6e-3, -39e-3), 2e-3, [&](Vec3 p) {
            const bool inside = std::abs(p.x) < 34e-3 && p.y > 0.0 && p.y < 60e-3 && std::abs(p.z) < 34e-3;
            return !inside ? 0 : p.y > place && p.y < place + 1e-3 ? 2 : 1;
        });
        for (const CellLevel& level : body.levels) {
            const auto& g = level.nodes;
            for (int x = 0; x < g.size.x; ++x) {
                int held = 0, above = 0, below = 0;
                for (int y = 0; y < g.size.y; ++y) {
                    const Index3 n(x, y, g.size.z / 2);
                    const double off = g.position(n).y - place;
                    const bool is = level.fixed[g.offset(n)] != 0, isTissue = level.diagonal[g.offset(n)] > 0.0F;
                    held += is && std::abs(off - 0.5e-3) < g.spacing ? 1 : 0;
                    above += isTissue && off < -g.spacing ? 1 : 0;
                    below += isTissue && off > g.spacing ? 1 : 0;
                }
                const bool isInside = std::abs(g.position({x, 0, 0}).x) < 33e-3;
                EXPECT_TRUE(held > 0 || above == 0 || below == 0 || !isInside) << place << " " << g.spacing << " " << x;
            }
        }
    }
}

// Force on a ball that is pressed 5 mm through soft tissue and 2 mm into bone of this thickness [N].
double forceInBone(double spacing, double thick)
{
    const auto body = tests::voxelBody(Index3(60, 42, 60), Vec3(-30e-3, -5e-3, -30e-3), spacing, [&](Vec3 p) {
        const bool inside = std::abs(p.x) < 25e-3 && p.y > 0.0 && p.y < 33e-3 && std::abs(p.z) < 25e-3;
        return !inside ? 0 : p.y > 30e-3 || (p.y > 5e-3 && p.y < 5e-3 + thick) ? 2 : 1;
    });
    Elastic elastic(body, {}, tests::focusUnder(Vec3(0.0)));
    for (double d = -1e-3; d <= 7e-3; d += 20e-6) {
        std::array tools{tests::ball(Vec3(0.7e-3, d - 10e-3, 0.4e-3), 10e-3)};
        tools[0].pushed = Vec3(0.0, std::max(d, 0.0), 0.0);
        elastic.relax(tests::loadOf(tools, {}, tools[0].shape.a));
    }
    return -elastic.toolForce(0).y;
}

// A tool is stopped by 4 N per millimetre where bone begins, however thin the bone is. Without a rule for it a plate of a
// millimetre was gone through with a third of that.
TEST(HeldNodes, ThinBoneStopsATool)
{
    for (const double spacing : {2e-3, 4e-3}) {
        const double thick = forceInBone(spacing, 25e-3);
        EXPECT_GT(thick, 8.0);
        for (const double plate : {1e-3, 2e-3, 3e-3}) {
            EXPECT_NEAR(forceInBone(spacing, plate), thick, 2.0) << spacing << " " << plate;
        }
    }
}

// A column on a board that ends inside of a cell of each wider window: it was held in none of these, and went away from the
// ball without a force.
TEST(HeldNodes, AThinBoardHoldsATallBody)
{
    const auto force = [](double board) {
        const auto body = tests::voxelBody(Index3(68, 160, 68), Vec3(-34e-3, -5e-3, -34e-3), 4e-3, [&](Vec3 p) {
            const bool inside = std::abs(p.x) < 30e-3 && p.y > 0.0 && p.y < 148e-3 + board && std::abs(p.z) < 30e-3;
            return !inside ? 0 : p.y > 148e-3 ? 2 : 1;
        });
        Elastic elastic(body, {}, tests::focusUnder(Vec3(0.0)));
        for (double d = 0.0; d <= tipDepth; d += 20e-6) {
            const std::array tools{tests::ball(Vec3(0.7e-3, d - tipRadius, 0.4e-3), tipRadius)};
            elastic.relax(tests::loadOf(tools, {}, tools[0].shape.a));
        }
        return -elastic.toolForce(0).y;
    };
    const double thick = force(6e-3);
    EXPECT_GT(thick, 0.1);
    EXPECT_NEAR(force(2e-3) / thick, 1.0, 0.05);
    EXPECT_NEAR(force(1e-3) / thick, 1.0, 0.05);
}

}  // namespace
}  // namespace palpate::chainmail
