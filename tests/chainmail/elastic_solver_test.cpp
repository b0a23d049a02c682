#include "elastic_bodies.h"

#include <tests/allocations.h>

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

namespace palpate::chainmail {
namespace {

constexpr double fineSpacing = 1e-3;
constexpr double radius = 5e-3;

ElasticBody body(double nu = 0.45)
{
    return tests::bodyOf(tests::heldBlock({30, 18, 26}, fineSpacing, 1e4, nu));
}

const Vec3 top(15e-3, 0.0, 13e-3);

// A ball `depth` deep in the middle of the top, moved aside by `aside`.
ElasticTool pressed(double depth, Vec3 aside = Vec3(0.0))
{
    return tests::ball(top + Vec3(0.0, depth - radius, 0.0) + aside, radius);
}

Tie tieAt(Vec3 rest, Vec3 u)
{
    return {rest, u, glm::normalize(Vec3(0.3, 1.0, -0.2)), 40.0, 15.0};
}

// Ties are springs and the tissue is linear: displacements and forces of two loads add.
TEST(Elastic, LoadsOfTiesSuperpose)
{
    const ElasticBody block = body();
    const Vec3 a(12e-3, 3.3e-3, 10.2e-3);
    const Vec3 b(17.5e-3, 6e-3, 15.1e-3);
    const std::array<Vec3, 3> probes{a, b, {14e-3, 9e-3, 13e-3}};
    const auto solved = [&](Vec3 ua, Vec3 ub) {
        Elastic elastic(block, {}, tests::focusUnder(top));
        const std::array<Tie, 2> ties{tieAt(a, ua), tieAt(b, ub)};
        tests::settle(elastic, tests::loadOf({}, ties, top), 1e-6);
        std::array<Vec3, 5> out;
        for (std::size_t i = 0; i < 3; ++i) {
            out[i] = elastic.displacement(probes[i]);
        }
        out[3] = 1e-2 * elastic.tieForce(0);
        out[4] = 1e-2 * elastic.tieForce(1);
        return out;
    };
    const Vec3 ua(1e-3, 2e-3, -0.5e-3);
    const Vec3 ub(-0.3e-3, -1e-3, 1.5e-3);
    const auto first = solved(ua, Vec3(0.0));
    const auto second = solved(Vec3(0.0), ub);
    const auto both = solved(ua, ub);
    for (std::size_t i = 0; i < both.size(); ++i) {
        EXPECT_LT(glm::distance(both[i], first[i] + second[i]), 1e-3 * glm::length(both[i])) << i;
        EXPECT_GT(glm::length(first[i]), 1e-6);
    }
}

// Whatever the load, no call raises the energy that it starts with, but for the rounding of its sums; and while the load
// stays the same, calls come to rest.
TEST(Elastic, NoCallRaisesTheEnergy)
{
    const ElasticBody block = body();
    std::minstd_rand random(1);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    for (const bool finite : {false, true}) {
        ElasticOptions options;
        options.law = finite ? volume::Law(volume::NeoHookean{}) : volume::Law();
        Elastic elastic(block, options, tests::focusUnder(top));
        for (int load = 0; load < 12; ++load) {
            const std::array tools{pressed(2.5e-3 + 2e-3 * unit(random), 5e-3 * Vec3(unit(random), 0.0, unit(random)))};
            const std::array ties{tieAt(top + 4e-3 * Vec3(unit(random), 1.2, unit(random)),
                                        2e-3 * Vec3(unit(random), unit(random), unit(random)))};
            const auto both = tests::loadOf(tools, ties, top);
            for (int call = 0; call < 40; ++call) {
                const auto result = elastic.relax(both);
                ASSERT_LE(result.energy, result.start * (1.0 + 1e-5)) << "load " << load << ", call " << call;
            }
            const double rests = elastic.relax(both).energy;
            EXPECT_NEAR(elastic.relax(both).energy, rests, 1e-3 * rests) << load;
        }
    }
}

// Nothing touches: the body is at rest to the bit, whatever was before.
TEST(Elastic, UnloadedBodyIsExactlyAtRest)
{
    const ElasticBody block = body();
    Elastic elastic(block, {}, tests::focusUnder(top));
    const std::array ties{tieAt(top + Vec3(0.0, 4e-3, 0.0), Vec3(1e-3))};
    for (int i = 0; i < 20; ++i) {
        const std::array tools{pressed(0.2e-3 * i, Vec3(0.3e-3 * i, 0.0, 0.0))};
        elastic.relax(tests::loadOf(tools, ties, tools[0].shape.a));
    }
    EXPECT_FALSE(elastic.atRest());
    EXPECT_GT(glm::length(elastic.displacement(top)), 1e-4);
    const std::array away{pressed(-8e-3)};
    const auto result = elastic.relax(tests::loadOf(away, {}, top));
    EXPECT_TRUE(elastic.atRest());
    EXPECT_EQ(result.energy, 0.0);
    EXPECT_EQ(result.contacts, 0U);
    EXPECT_EQ(elastic.toolForce(0), Vec3(0.0));
    for (const Window& w : elastic.stack().windows()) {
        for (const Field f : {Field::u, Field::a}) {
            const float* v = w.field(f);
            EXPECT_TRUE(std::all_of(v, v + 3 * w.layout.count, [](float x) { return x == 0.0F; }));
        }
    }
}

// Work done on a tool is energy taken from the tissue: F = -dE/dx, each E at its equilibrium. A ball and a tie, along each
// axis, by central differences.
TEST(Elastic, ReactionIsTheDerivativeOfTheConvergedEnergy)
{
    const ElasticBody block = body();
    const double step = 0.1e-3;
    for (const int axis : {0, 1, 2}) {
        Vec3 way(0.0);
        way[axis] = step;
        const auto solved = [&](Vec3 ball, Vec3 tie) {
            Elastic elastic(block, {}, tests::focusUnder(top));
            const std::array tools{pressed(2.5e-3, Vec3(-2e-3, 0.0, 1e-3) + ball)};
            const std::array ties{tieAt(top + Vec3(4e-3, 3.5e-3, 2e-3), Vec3(1e-3, -0.5e-3, 2e-3) + tie)};
            const auto result = tests::settle(elastic, tests::loadOf(tools, ties, top), 1e-6);
            return std::array{result.energy, elastic.toolForce(0)[axis], elastic.tieForce(0)[axis]};
        };
        const auto here = solved(Vec3(0.0), Vec3(0.0));
        const double byBall = (solved(way, Vec3(0.0))[0] - solved(-way, Vec3(0.0))[0]) / (2.0 * step);
        const double byTie = (solved(Vec3(0.0), way)[0] - solved(Vec3(0.0), -way)[0]) / (2.0 * step);
        EXPECT_NEAR(here[1], -byBall, 0.002 * 0.3) << "axis " << axis;
        EXPECT_NEAR(here[2], -byTie, 0.002 * 0.05) << "axis " << axis;
    }
}

// A ball that presses and slides, with one cycle a call: the force by virtual work is nearer to the converged one than the
// contacts' own sum is, by more than a factor of two.
TEST(Elastic, ForceOfAFewCyclesIsNearTheConverged)
{
    const ElasticBody block = body();
    ElasticOptions oneCycle;
    oneCycle.cycles = 1;
    Elastic quick(block, oneCycle, tests::focusUnder(top));
    Elastic exact(block, {}, tests::focusUnder(top));
    double error = 0.0, errorOfContacts = 0.0, sum = 0.0;
    for (int i = 0; i < 30; ++i) {
        const std::array tools{pressed(std::min(0.2e-3 * i, 2e-3), {0.3e-3 * std::max(0, i - 10), 0, 0})};
        quick.relax(tests::loadOf(tools, {}, tools[0].shape.a));
        exact.relax(tests::loadOf(tools, {}, tools[0].shape.a), 30, 1e-5);
        Vec3 contacts(0.0);
        for (const ContactSite& site : quick.sites()) {
            contacts -= site.force;
        }
        const Vec3 force = exact.toolForce(0);
        error += glm::distance(quick.toolForce(0), force);
        errorOfContacts += glm::distance(contacts, force);
        sum += glm::length(force);
    }
    EXPECT_LT(error, 0.5 * errorOfContacts);
    EXPECT_LT(error, 0.05 * sum);
    EXPECT_GT(sum, 1.0);
}

// A ball that touches quickly: with forces that nobody feels left out of balance, ticks have fewer cycles beyond those of
// the setting, and no force differs by more than that.
TEST(Elastic, UnfeltForcesCostNoFurtherCycle)
{
    const ElasticBody block = body();
    Elastic balanced(block, {}, tests::focusUnder(top));
    Elastic felt(block, {.unfelt = 1e-3}, tests::focusUnder(top));
    const auto most = static_cast<std::uint32_t>(ElasticOptions{}.cycles);
    int longer = 0, longerFelt = 0;
    for (int i = -10; i <= 50; ++i) {
        const std::array tools{pressed(50e-6 * (i <= 20 ? i : 40 - i))};
        const auto load = tests::loadOf(tools, {}, tools[0].shape.a);
        longer += balanced.relax(load).cycles > most;
        const ElasticResult result = felt.relax(load);
        longerFelt += result.cycles > most;
        EXPECT_LT(glm::distance(felt.toolForce(0), balanced.toolForce(0)), 1e-3) << i;
        EXPECT_TRUE(result.cycles <= most || result.moved || result.residual > 1e-3) << i;
    }
    EXPECT_GE(longer, 4);
    EXPECT_LE(longerFelt, longer / 2) << longer;
}

// A load solved in parts ends with the bits of one call: the same cycles, each in two parts, and none once balanced. A
// needle that is drawn through the tissue beside a ball that rests, so far at once that a call takes three, but not so far
// that a step is shortened: a part has no time for that.
TEST(Elastic, PartsOfALoadEndWhereOneCallEnds)
{
    const ElasticBody block = body();
    for (const bool finite : {false, true}) {
        ElasticOptions options;
        options.law = finite ? volume::Law(volume::NeoHookean{}) : volume::Law();
        Elastic whole(block, options, tests::focusUnder(top)), inParts(block, options, tests::focusUnder(top));
        std::array<int, 4> ofCycles{};
        for (int i = 0; i < 56; ++i) {
            const std::array tools{pressed(1.5e-3)};
            const std::array ties{
                tieAt(top + Vec3(3e-3, 5e-3, 0.0), (i % 7 == 0 ? 0.18e-3 : 0.02e-3) * i * Vec3(0, 1, 0.3))};
            const auto load = tests::loadOf(tools, ties, top);
            const ElasticResult once = whole.relax(load);
            ElasticResult part = inParts.begin(load);
            EXPECT_LE(part.cycles, i == 0 ? 1U : 0U) << i;
            std::uint32_t cycles = part.cycles;
            for (int parts = 1; parts < 8; ++parts) {
                part = inParts.goOn();
                EXPECT_LE(part.cycles, static_cast<std::uint32_t>((i == 0 ? 1 : 0) + parts / 2)) << i << ' ' << parts;
                cycles = std::max(cycles, part.cycles);
            }
            ASSERT_EQ(once.shortened, 0U) << i;
            ASSERT_EQ(cycles, once.cycles) << i;
            ++ofCycles.at(cycles);
            ASSERT_EQ(inParts.toolForce(0), whole.toolForce(0)) << i;
            ASSERT_EQ(inParts.tieForce(0), whole.tieForce(0)) << i;
            ASSERT_EQ(inParts.displacement(top + Vec3(0, 2e-3, 0)), whole.displacement(top + Vec3(0, 2e-3, 0))) << i;
        }
        EXPECT_GT(ofCycles[2] + ofCycles[3], 3) << "nothing was left for the other parts";
    }
}

// A tie that is led along a long block: the call that moves windows only moves them, the next meets the tie and has no
// cycle, and the third has one. The tissue does not jump with its windows. A whole call in place of the second solves the
// load as if nothing had been begun.
TEST(Elastic, AMoveOfTheWindowsIsAPartOfItsOwn)
{
    const ElasticBody block = tests::bodyOf(tests::heldBlock({60, 18, 26}, fineSpacing, 1e4, 0.45));
    ElasticOptions options{.window = 9, .law = volume::NeoHookean{}};
    const auto pathAt = [](int i) { return Vec3(15e-3 + 0.2e-3 * i, 4e-3, 13e-3); };
    Elastic whole(block, options, tests::focusUnder(pathAt(0))), inParts(block, options, tests::focusUnder(pathAt(0)));
    int moves = 0;
    for (int i = 0; i < 120; ++i) {
        const std::array ties{tieAt(pathAt(i), 0.5e-3 * Vec3(0.2, 1.0, 0.0))};
        const auto load = tests::loadOf({}, ties, pathAt(i));
        const Vec3 before = inParts.displacement(pathAt(i));
        const ElasticResult first = inParts.begin(load);
        if (first.moved && i > 0) {
            ++moves;
            EXPECT_EQ(first.cycles, 0U);
            EXPECT_LT(glm::distance(inParts.displacement(pathAt(i)), before), 1e-9);
        }
        const ElasticResult second = moves % 2 == 1 && first.moved ? inParts.relax(load) : inParts.goOn();
        EXPECT_TRUE(!first.moved || i == 0 || moves % 2 == 1 || second.cycles <= 1) << i;
        inParts.goOn();
        for (int further = 0; further < 6; ++further) {
            inParts.begin(load);
            inParts.goOn();
            inParts.goOn();
        }
        for (int calls = 0; calls < 8; ++calls) {
            whole.relax(load);
        }
        ASSERT_LT(glm::distance(inParts.tieForce(0), whole.tieForce(0)), 0.02 * glm::length(whole.tieForce(0))) << i;
    }
    EXPECT_GT(moves, 5);
}

// Two halves of a cycle make a whole one, and the last part of a load leaves no half to the next.
TEST(Elastic, TheLastPartEndsACycle)
{
    const ElasticBody block = body();
    const ElasticOptions options{.law = volume::NeoHookean{}};
    Elastic inTwo(block, options, tests::focusUnder(top)), inOne(block, options, tests::focusUnder(top));
    int cycles = 0;
    for (int i = 1; i <= 40; ++i) {
        const std::array ties{tieAt(top + Vec3(3e-3, 5e-3, 0.0), (i % 4 == 0 ? 0.06e-3 : 0.05e-3) * i * Vec3(0, 1, 0.3))};
        const auto load = tests::loadOf({}, ties, top);
        if (i == 1) {  // there is no increment yet, so that to begin has a cycle
            inTwo.relax(load);
            inOne.relax(load);
            continue;
        }
        ASSERT_EQ(inTwo.begin(load).cycles, inOne.begin(load).cycles);
        const std::uint32_t before = inTwo.goOn().cycles;
        const std::uint32_t whole = inOne.goOn(true).cycles;
        ASSERT_EQ(std::max(before, inTwo.goOn(true).cycles), whole) << i;
        cycles += static_cast<int>(whole);
        ASSERT_EQ(inTwo.tieForce(0), inOne.tieForce(0)) << i;
        ASSERT_EQ(inTwo.displacement(top), inOne.displacement(top)) << i;
    }
    EXPECT_GT(cycles, 10);
}

// Without a load there is nothing to go on with.
TEST(Elastic, GoingOnAtRestIsNothing)
{
    const ElasticBody block = body();
    Elastic elastic(block, {}, tests::focusUnder(top));
    EXPECT_EQ(elastic.goOn().cycles, 0U);
    const std::array tools{pressed(2e-3)};
    elastic.begin(tests::loadOf(tools, {}, top));
    elastic.relax({});
    EXPECT_TRUE(elastic.atRest());
    EXPECT_EQ(elastic.goOn().cycles, 0U);
    EXPECT_TRUE(elastic.atRest());
}

// What tools and ties push in, the fixed nodes hold.
TEST(Elastic, ActionEqualsReaction)
{
    const ElasticBody block = body();
    ElasticOptions whole;
    whole.window = 65;
    Elastic elastic(block, whole, tests::focusUnder(top));
    const std::array tools{pressed(2.5e-3, Vec3(-3e-3, 0.0, 0.0)), pressed(1.5e-3, Vec3(6e-3, 0.0, 2e-3))};
    const std::array ties{tieAt(top + Vec3(0.0, 5e-3, -5e-3), Vec3(2e-3, 1e-3, 0.0))};
    tests::settle(elastic, tests::loadOf(tools, ties, top), 1e-6);
    const Vec3 pushed = elastic.toolForce(0) + elastic.toolForce(1) + elastic.tieForce(0);

    Window w = elastic.stack().windows().front();
    Floats scratch(w.layout.scratchSize());
    kernels().apply(w.layout, w.stiffness(), w.field(Field::u), w.field(Field::t), scratch.data());
    Vec3 held(0.0);
    volume::forEachIndex(Index3(0), w.size() - 1, [&](Index3 n) {
        const std::size_t node = w.layout.at(n.x, n.y, n.z);
        held += w.open[node] == 0.0F ? tests::valueAt(w, node, Field::t) : Vec3(0.0);
    });
    EXPECT_LT(pushed.y, -0.1);
    EXPECT_LT(glm::distance(held, pushed), 1e-3 * glm::length(pushed));
}

// Two balls and a tie go their ways at the same time, slowly: the work of all three, each force times its way, is the
// energy in the end. By the trapezoidal rule, 1 %.
TEST(Elastic, WorkOfAllToolsAndTiesIsTheEnergy)
{
    const ElasticBody block = body();
    Elastic elastic(block, {}, tests::focusUnder(top));
    const Vec3 wayA(0.0, 2e-3, 0.0);
    const Vec3 wayB(1e-3, 1.5e-3, 0.5e-3);
    const Vec3 wayTie(1e-3, -1e-3, 2e-3);
    const int steps = 40;
    double work = 0.0;
    double energy = 0.0;
    std::array<Vec3, 3> before{Vec3(0.0), Vec3(0.0), Vec3(0.0)};
    for (int i = 1; i <= steps; ++i) {
        const double s = static_cast<double>(i) / steps;
        const std::array tools{pressed(0.0, Vec3(-5e-3, 0.0, 0.0) + s * wayA),
                               pressed(0.0, Vec3(5e-3, 0.0, 0.0) + s * wayB)};
        const std::array ties{tieAt(top + Vec3(0.0, 6e-3, 3e-3), s * wayTie)};
        energy = tests::settle(elastic, tests::loadOf(tools, ties, top), 1e-4).energy;
        const std::array now{elastic.toolForce(0), elastic.toolForce(1), elastic.tieForce(0)};
        const std::array ways{wayA, wayB, wayTie};
        for (std::size_t t = 0; t < 3; ++t) {
            work -= 0.5 * glm::dot(now[t] + before[t], ways[t]) / steps;
        }
        before = now;
    }
    EXPECT_GT(energy, 1e-4);
    // Contacts' stiffness goes with the area under the tool from call to call, and not along the work.
    EXPECT_NEAR(work, energy, 0.02 * energy);
}

// Sixteen tools are the most that one body feels; those behind have no force, and change nothing.
TEST(Elastic, ToolsBeyondTheSixteenthAreLeftOut)
{
    const ElasticBody block = body();
    std::vector<ElasticTool> tools;
    for (int i = 0; i < 40; ++i) {
        tools.push_back(pressed(1e-3, 2.5e-3 * Vec3(i % 4 - 1.5, 0.0, i / 4 - 1.5)));
    }
    Elastic some(block, {}, tests::focusUnder(top));
    Elastic all(block, {}, tests::focusUnder(top));
    const auto sixteen = some.relax(tests::loadOf(std::span(tools).first(16), {}, top));
    const auto forty = all.relax(tests::loadOf(tools, {}, top));
    EXPECT_GT(sixteen.contacts, 16U);
    EXPECT_EQ(sixteen.energy, forty.energy);
    EXPECT_EQ(all.toolForce(16), Vec3(0.0));
}

// Touching, sliding, moving windows, letting go: nothing comes from the heap.
TEST(Elastic, RelaxAllocatesNothing)
{
    const ElasticBody block = body();
    for (const bool finite : {false, true}) {
        ElasticOptions options;
        options.window = 11;
        options.law = finite ? volume::Law(volume::NeoHookean{}) : volume::Law();
        Elastic elastic(block, options, tests::focusUnder(top));
        std::array tools{pressed(1e-3), pressed(0.5e-3)};
        const std::array ties{tieAt(top + Vec3(0.0, 4e-3, 0.0), Vec3(1e-3))};
        bool moved = false;
        const auto allocations = tests::allocationsIn([&] {
            for (int i = 0; i < 60; ++i) {
                tools[0] = pressed(2e-3, Vec3(-8e-3 + 0.3e-3 * i, 0.0, 0.0));
                const auto load =
                    tests::loadOf(tools, i % 2 == 0 ? std::span(ties) : std::span<const Tie>(), tools[0].shape.a);
                moved = elastic.relax(load).moved || moved;
            }
            elastic.relax({});
        });
        EXPECT_EQ(allocations, 0U);
        EXPECT_TRUE(moved);
        EXPECT_TRUE(elastic.atRest());
    }
}

}  // namespace
}  // namespace palpate::chainmail
