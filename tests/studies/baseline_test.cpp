#include <studies/kernel/baselines/fifo_mail.h>
#include <studies/kernel/baselines/lattice.h>
#include <studies/kernel/baselines/mean_sweeps.h>
#include <studies/kernel/baselines/relaxed_grid.h>
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

TEST(FifoMail, AScaleIsThatOfAllLimits)
{
    const Lattice lattice = cube(15), tight = cube(15, withLimits(oneTissue(), 0.4));
    const std::vector<Seed> seeds{{static_cast<Node>(lattice.grid.offset(Index3(8))), Vec3f(1.5e-3F, 0.2e-3F, 0.9e-3F)}};
    std::vector<Vec3f> scaled(lattice.tissue.size(), Vec3f(0.0F)), made(scaled);
    FifoScratch scratch(lattice);
    propagateFifo(lattice, scaled, scratch, seeds, 0.4F);
    propagateFifo(tight, made, scratch, seeds);
    for (std::size_t n = 0; n < made.size(); ++n) {
        EXPECT_NEAR(glm::length(scaled[n] - made[n]), 0.0F, 1e-4F * static_cast<float>(h));
    }
    EXPECT_LT(chainmail::worstViolation(tight, scaled), 1e-4 * h);
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

// The mean of the neighbours of a linear field is the field: with its faces held, the inside comes back to it.
TEST(MeanSweeps, ALinearFieldIsTheirEnd)
{
    const Lattice lattice = cube(9);
    const auto linear = [](Index3 at) { return 1e-5F * Vec3f(at.x - 2 * at.y, at.y + 3 * at.z, at.x); };
    std::vector<Vec3f> u(lattice.tissue.size(), Vec3f(0.0F));
    std::vector<Node> all, faces;
    forEachNode(lattice, [&](Node n, Index3 at) {
        const bool face = glm::any(glm::equal(at, Index3(1))) || glm::any(glm::equal(at, Index3(9)));
        u[n] = face ? linear(at) : Vec3f(1e-4F * static_cast<float>(n % 7));
        all.push_back(n);
        if (face) {
            faces.push_back(n);
        }
    });
    MeanSweeps means(lattice);
    means.sweep(u, all, faces, 100);
    forEachNode(lattice, [&](Node n, Index3 at) { EXPECT_NEAR(glm::length(u[n] - linear(at)), 0.0F, 1e-8F); });
}

// Faces are free: what is held by one end only goes with it as a whole.
TEST(MeanSweeps, WhatIsHeldByOneEndFollowsIt)
{
    const Lattice lattice = cube(4);
    std::vector<Vec3f> u(lattice.tissue.size(), Vec3f(0.0F));
    std::vector<Node> end;
    forEachNode(lattice, [&](Node n, Index3 at) {
        if (at.z == 1) {
            u[n] = Vec3f(0, 0, 1e-3F);
            end.push_back(n);
        }
    });
    MeanSweeps means(lattice);
    means.sweep(u, end, end, 1);
    EXPECT_EQ(u[lattice.grid.offset({2, 2, 3})], Vec3f(0.0F));  // one sweep reaches one link
    means.sweep(u, end, end, 400);
    forEachNode(lattice, [&](Node n, Index3) { EXPECT_NEAR(u[n].z, 1e-3F, 1e-7F); });
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

TrialErrors medianErrors(const TrialModel& model)
{
    const TrialResult result = runTrial(model, basePressed().path, 20e-3, basePressed().reference);
    return {TrialPhase::press, spreadOf(result.looks, &TrialErrors::rms).median,
            spreadOf(result.looks, &TrialErrors::near).median, 0.0, spreadOf(result.looks, &TrialErrors::force).median};
}

RigidSphere deepSphere()
{
    TrialLoad load(basePressed().path);
    load.set({basePressed().path.press, 0.0});
    const auto& shape = load.load().tools.front().shape;
    return {shape.b, shape.radiusB};
}

// Relaxed to the end, free nodes are in balance, those on the sphere push it, none is inside it, and the block's symmetry
// leaves no force across.
TEST(RelaxedGrid, ItsEndIsTheEquilibriumUnderTheSphere)
{
    const auto& p = basePressed();
    const RigidSphere sphere = deepSphere();
    RelaxedGrid grid(p.body.body.levels.front(), p.model.surface, {sphere.centre - 0.02, sphere.centre + 0.02});
    grid.project(sphere);
    grid.sweep(sphere, 4000);
    EXPECT_LT(grid.imbalance(), 1e-8);
    for (const ContactNode& c : grid.contacts()) {
        const Vec3 at = c.rest + grid.displacement(c.rest);
        EXPECT_GT(glm::distance(at, sphere.centre) - sphere.radius + c.surface, -1e-8);
    }
    const Vec3 force = grid.force();
    EXPECT_GT(-glm::dot(force, p.path.inward), 0.01);
    EXPECT_LT(glm::length(force - glm::dot(force, p.path.inward) * p.path.inward), 0.02 * glm::length(force));
}

// Another solver with another contact (a soft one, at four points per cell) on the same cells has the same equilibrium.
TEST(RelaxedGrid, ManySweepsPerTickAgreeWithMultigridOnTheWholeGrid)
{
    const TrialErrors errors = medianErrors(relaxedModel(basePressed().scene, 1e-3, 60, false));
    EXPECT_LT(errors.rms, 1.0);
    EXPECT_LT(errors.near, 1.5);
    EXPECT_LT(errors.force, 6.0);
}

// The increment of a node on the sphere goes straight down with what the links keep back, whatever the tissue.
TEST(IncrementMail, TakesAnIncrementThroughTheBodyByTheClosedForm)
{
    const auto& level = basePressed().body.body.levels.front();
    IncrementMail mail(level);
    Index3 top(level.nodes.size / 2);
    for (top.y = 0; level.diagonal[level.nodes.offset(top)] <= 0.0F; ++top.y) {
    }
    const auto seed = static_cast<Node>(level.nodes.offset(top));
    const double step = 20e-6, strain = step / 8e-3;
    const auto increment = [&](int down) {
        return mail.increment(static_cast<Node>(level.nodes.offset(top + Index3(0, down, 0)))).y;
    };
    for (const double fraction : {1.0, 0.5}) {  // and nothing is left of the tick before
        const std::vector<Seed> seeds{{seed, Vec3f(0, fraction * step, 0)}};
        const auto moved = mail.spread(seeds, strain);
        EXPECT_GT(moved.size(), 10U);
        for (int down = 0; down < 10; ++down) {
            EXPECT_NEAR(static_cast<double>(increment(down)), std::max(0.0, fraction * step - strain * h * down),
                        1e-4 * step);
        }
    }
}

TEST(LatticeBaselines, ChainMailBeforeTheSweepsIsWorthMoreThanAnotherSweep)
{
    const double alone = medianErrors(relaxedModel(basePressed().scene, 1e-3, 2, false)).rms;
    const double predicted = medianErrors(relaxedModel(basePressed().scene, 1e-3, 1, true)).rms;
    EXPECT_LT(predicted, 0.9 * alone);
}

TEST(LatticeBaselines, RelaxationTowardsTheMeanImprovesChainMail)
{
    const auto& scene = basePressed().scene;
    const double rms = medianErrors(fifoMailModel(scene, 2e-3, 1.0, 0)).rms;
    EXPECT_LT(medianErrors(fifoMailModel(scene, 2e-3, 1.0, 10)).rms, 0.95 * rms);
    EXPECT_LT(rms, medianErrors(nothingModel()).rms);
}

// ChainMail from rest forgets where the tool has been: out of the tissue, everything is at rest.
TEST(LatticeBaselines, ChainMailFromRestGoesBackToRest)
{
    const auto& p = basePressed();
    for (const int sweeps : {0, 5}) {
        const TrialModel model = fifoMailModel(p.scene, 2e-3, 0.5, sweeps);
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
        EXPECT_EQ(model.force != nullptr, b.method == "chainmail_navier" || b.method == "relaxation");
    }
    EXPECT_GE(names.size(), 15U);
}

TEST(LatticeBaselines, TooFineANetIsRefused)
{
    EXPECT_THROW(fifoMailModel(basePressed().scene, 0.05e-3, 1.0, 0), std::runtime_error);
    EXPECT_THROW(relaxedModel(basePressed().scene, 0.05e-3, 1, true), std::runtime_error);
}

}  // namespace
}  // namespace palpate::studies
