#include <studies/kernel/baselines/lattice.h>
#include <studies/kernel/kernel_rivals.h>
#include <studies/kernel/node_values.h>

#include <tests/studies/small_block.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>

namespace palpate::studies {
namespace {

using chainmail::Lattice;
using chainmail::Node;
using chainmail::Seed;

constexpr double h = 1e-3;                                       // spacing of the test lattices [m]
constexpr double pressSlack = 0.4, lengthen = 0.5, shear = 0.3;  // slack, in spacings

volume::TissueTable oneTissue()
{
    volume::TissueTable table;
    table.rows.resize(2);
    table.rows[1].compress = 1.0 - pressSlack;
    table.rows[1].stretch = 1.0 + lengthen;
    table.rows[1].shear = shear;
    return table;
}

// A cube of one tissue, `side` nodes along each edge, and a layer of nothing around it.
Lattice cube(int side, const volume::TissueTable& table = oneTissue())
{
    const volume::NodeGrid grid{Index3(side + 2), Vec3(0.0), h};
    return {grid, std::vector<std::uint8_t>(grid.count(), 1), table};
}

template <typename Visit>
void forEachNode(const Lattice& lattice, Visit&& visit)
{
    volume::forEachIndex(Index3(1), lattice.grid.size - 2,
                         [&](Index3 at) { visit(static_cast<Node>(lattice.grid.offset(at)), at); });
}

// A node pushed by d along z moves the one that is (i, j, k) links away by what the links between do not give:
// max(0, d - a |k| - g (|i| + |j|)), a the slack of links that shorten ahead of it, of links that lengthen behind it.
TEST(FifoMail, APushedNodeMovesTheOthersByTheClosedForm)
{
    const Lattice lattice = cube(21);
    std::vector<Vec3f> u(lattice.tissue.size(), Vec3f(0.0F));
    FifoScratch scratch(lattice);
    const Index3 middle(11);
    const double d = 3.7 * h;
    propagateFifo(lattice, u, scratch, std::vector<Seed>{{static_cast<Node>(lattice.grid.offset(middle)), {0, 0, d}}});
    forEachNode(lattice, [&](Node n, Index3 at) {
        const Index3 off = at - middle;
        const double along = off.z > 0 ? pressSlack * off.z : -lengthen * off.z;
        const double expected = std::max(0.0, d - h * (along + shear * (std::abs(off.x) + std::abs(off.y))));
        EXPECT_NEAR(static_cast<double>(u[n].z), expected, 1e-4 * h);
        EXPECT_EQ(u[n].x, 0.0F);
    });
}

// In one tissue, under a flat punch, the order of pulls does not matter: what links do not give grows with the links
// between.
TEST(FifoMail, UnderAFlatPunchItIsTheOrderOfViolation)
{
    const Lattice lattice = cube(19);
    std::vector<Seed> seeds;
    volume::forEachIndex({6, 6, 3}, {13, 13, 3}, [&](Index3 at) {
        if (glm::length(Vec3(at) - 10.0) < 8.0) {
            seeds.push_back({static_cast<Node>(lattice.grid.offset(at)), Vec3f(0.5e-3F, 0.0F, 2.6e-3F)});
        }
    });
    std::vector<Vec3f> fifo(lattice.tissue.size(), Vec3f(0.0F)), ordered(fifo);
    FifoScratch scratch(lattice);
    chainmail::PropagateScratch orderedScratch(lattice, 100000, 100);
    propagateFifo(lattice, fifo, scratch, seeds);
    propagate(lattice, ordered, orderedScratch, seeds);
    std::size_t moved = 0;
    forEachNode(lattice, [&](Node n, Index3) {
        EXPECT_NEAR(glm::length(fifo[n] - ordered[n]), 0.0F, 1e-4F * static_cast<float>(h));
        moved += fifo[n] != Vec3f(0.0F) ? 1 : 0;
    });
    EXPECT_GT(moved, 200U);
    EXPECT_EQ(scratch.moved.size(), moved);
}

// Held nodes that no links allow: the work is bounded, and they stay where they are.
TEST(FifoMail, EndsWhereNoAnswerIsLegal)
{
    const Lattice lattice = cube(5);
    const Node a = static_cast<Node>(lattice.grid.offset({2, 3, 3})), b = static_cast<Node>(lattice.grid.offset({4, 3, 3}));
    std::vector<Vec3f> u(lattice.tissue.size(), Vec3f(0.0F));
    FifoScratch scratch(lattice);
    const auto far = static_cast<float>(9.0 * h);
    const std::size_t moves = propagateFifo(lattice, u, scratch, std::vector<Seed>{{a, {0, 0, -far}}, {b, {0, 0, far}}});
    EXPECT_LE(moves, 4 * lattice.tissue.size());
    EXPECT_EQ(u[a].z, -far);
    EXPECT_EQ(u[b].z, far);
}

// Linear fields are kept between nodes; nodes without tissue have no say; just outside, the nearest node speaks for all.
TEST(NodeValues, AreTrilinearOverTissue)
{
    const volume::NodeGrid grid{Index3(6), Vec3(1.0, 2.0, 3.0), 0.5};
    const auto half = [](Index3 n) { return n.z < 3; };
    const auto field = [&](Index3 n) { return n.z < 3 ? 2.0 * grid.position(n) : Vec3(1e9); };
    const Vec3 inside(2.13, 3.27, 3.71), flush(2.13, 3.27, 4.2);
    EXPECT_NEAR(glm::distance(valueAt(grid, inside, half, field), 2.0 * inside), 0.0, 1e-12);
    EXPECT_NEAR(glm::distance(valueAt(grid, flush, half, field), 2.0 * Vec3(2.13, 3.27, 4.0)), 0.0, 1e-12);
    EXPECT_EQ(valueAt(grid, Vec3(2.1, 3.1, 4.6), half, field), 2.0 * Vec3(2.0, 3.0, 4.0));
    EXPECT_EQ(valueAt(grid, Vec3(2.1, 3.1, 5.4), half, field), Vec3(0.0));
}

// The small block, pressed by the 5 mm sphere.
struct BasePressed {
    haptics::SessionModel model = smallBlock();
    TrialPlace place = trialPlace(*model.tissue, model.surface, model.approach.entry, model.approach.aim);
    TrialPath path = trialPath(*model.tissue, model.surface, place, trialTools()[0], 1e-3);
    BaselineScene scene{*model.tissue, model.surface, path, 0.45};
    TrialBody body = trialBody(*model.tissue, model.surface, 1e-3, 0.45, 1U << 20);
    std::array<double, 1> speeds{20e-3};
    Reference reference = solveReference(body.body, path, speeds, {.tolerance = 1e-3, .maxPoints = 4000});
};

const BasePressed& basePressed()
{
    static const BasePressed p;
    return p;
}

// ChainMail from rest forgets where the tool has been: out of the tissue, everything is at rest.
TEST(LatticeBaselines, ChainMailFromRestGoesBackToRest)
{
    const auto& p = basePressed();
    const TrialModel model = fifoMailModel(p.scene, 2e-3, 0.5);
    TrialLoad load(p.path);
    load.set({p.path.press, p.path.drag});
    model.tick(load);
    const Vec3 under = p.place.entry + p.path.drag * p.path.sideways + 1e-3 * p.path.inward;
    EXPECT_GT(glm::length(model.displacement(under)), 1e-3);
    EXPECT_GT(model.touched(), 0U);
    load.set({0.0, 0.0});
    model.tick(load);
    for (const Vec3f& at : p.reference.position) {
        EXPECT_EQ(model.displacement(Vec3(at)), Vec3(0.0));
    }
    EXPECT_EQ(model.touched(), 0U);
}

TEST(LatticeBaselines, EachHasItsOwnNameAndFollowsTheTool)
{
    const auto& p = basePressed();
    std::set<std::string> names;
    for (const Baseline& b : latticeBaselines(p.scene)) {
        EXPECT_TRUE(names.insert(b.method + " " + b.setting).second) << b.method << " " << b.setting;
        const TrialModel model = b.build();
        TrialLoad load(p.path);
        for (int t = 1; t <= 20; ++t) {
            load.set({p.path.press * t / 20, 0.0});
            model.tick(load);
        }
        const double follows = glm::dot(model.displacement(p.place.entry + 0.1e-3 * p.path.inward), p.path.inward);
        EXPECT_GT(follows, 0.2 * (p.path.press - p.path.gap)) << b.method << " " << b.setting;
        EXPECT_GT(model.touched(), 0U);
        EXPECT_FALSE(model.force) << "ChainMail has none";
    }
    EXPECT_EQ(names.size(), 5U);
}

TEST(LatticeBaselines, TooFineANetIsRefused)
{
    EXPECT_THROW(fifoMailModel(basePressed().scene, 0.05e-3, 1.0), std::runtime_error);
    EXPECT_THROW(orderedMailModel(basePressed().scene, 0.05e-3), std::runtime_error);
}

}  // namespace
}  // namespace palpate::studies
