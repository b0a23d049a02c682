#include "elastic_bodies.h"

#include <gtest/gtest.h>

#include <glm/mat3x3.hpp>
#include <glm/vector_relational.hpp>

#include <cmath>

namespace palpate::chainmail {
namespace {

constexpr double spacing = 1e-3;
constexpr double modulus = 1e4;

// A block whose outer cells are fixed at every level: every degree of freedom lies in the same material.
ElasticBody wholeBody(double nu)
{
    return tests::bodyOf(tests::shell(48, 4, spacing, modulus, nu, 4));
}

Vec3 affine(Vec3 x)
{
    const Mat3 gradient(0.02, -0.01, 0.03, 0.015, -0.04, 0.01, 0.005, 0.02, 0.03);
    return Vec3(1e-4, 2e-4, -3e-4) + gradient * x;
}

double largest(WindowStack& stack, Field field)
{
    double most = 0.0;
    tests::forEachNode(stack, [&](std::size_t, Window& w, std::size_t node, Vec3) {
        most = std::max(most, glm::length(tests::valueAt(w, node, field)));
    });
    return most;
}

// Largest |field - affine| over the nodes of all windows that are at least `off` [m] from the body's border.
double offAffine(WindowStack& stack, Field field, double off = 0.0)
{
    double most = 0.0;
    tests::forEachNode(stack, [&](std::size_t, Window& w, std::size_t node, Vec3 rest) {
        if (off == 0.0 ||
            (glm::all(glm::greaterThan(rest, Vec3(off))) && glm::all(glm::lessThan(rest, Vec3(48e-3 - off))))) {
            most = std::max(most, glm::distance(tests::valueAt(w, node, field), affine(rest)));
        }
    });
    return most;
}

// What stands at a border before apply() must not matter.
void spoilBorders(WindowStack& stack, Field field)
{
    tests::forEachNode(stack, [&](std::size_t, Window& w, std::size_t node, Vec3) {
        if (w.border[node] != 0.0F) {
            tests::setAt(w, node, field, spacing * Vec3(1.0, -2.0, 3.0));
        }
    });
}

// An affine displacement is in the composite space, across every border, and leaves no force at any degree of freedom; one
// node of the finest window moved aside does.
TEST(ElasticWindows, AffineFieldsPassThePatchTestAcrossBorders)
{
    for (const double nu : {0.3, 0.49}) {
        const ElasticBody body = wholeBody(nu);
        WindowStack stack(body, 15, tests::focusAt({0.022, 0.024, 0.026}));
        ASSERT_GE(stack.size(), 3U);
        tests::setField(stack, Field::u, affine);
        spoilBorders(stack, Field::u);
        stack.joinBorders(Field::u);
        stack.apply(Field::u, Field::a);
        EXPECT_LT(offAffine(stack, Field::u), 1e-9) << "nu " << nu;
        const double forces = largest(stack, Field::a);

        Window& finest = stack[0];
        const std::size_t middle = finest.layout.at(7, 7, 7);
        tests::setAt(finest, middle, Field::u, tests::valueAt(finest, middle, Field::u) + Vec3(spacing * 0.02, 0.0, 0.0));
        stack.joinBorders(Field::u);
        stack.apply(Field::u, Field::a);
        EXPECT_LT(forces, 1e-4 * largest(stack, Field::a)) << "nu " << nu;
    }
}

// Every node inside the body is a degree of freedom of exactly one window, but those at borders, which follow.
TEST(ElasticWindows, CoveredNodesAreNoDegreesOfFreedom)
{
    const ElasticBody body = wholeBody(0.45);
    WindowStack stack(body, 15, tests::focusAt(Vec3(0.024)));
    tests::forEachNode(stack, [&](std::size_t l, Window& w, std::size_t node, Vec3 rest) {
        EXPECT_EQ(w.dof[node] * w.border[node], 0.0F);
        if (l == 0) {
            return;
        }
        const Window& finer = stack[l - 1];
        const auto& grid = body.levels[l - 1].nodes;
        const Vec3 low = grid.position(finer.low);
        const Vec3 high = grid.position(finer.low + finer.size() - 1);
        if (tests::boxDistance(rest, low, high) < -0.1 * grid.spacing) {
            EXPECT_EQ(w.dof[node], 0.0F);
        }
    });
}

TEST(ElasticWindows, CompositeOperatorIsSymmetricAndPositive)
{
    std::minstd_rand random(1);
    for (const double nu : {0.3, 0.499}) {
        const ElasticBody body = tests::bodyOf(tests::heldBlock({40, 30, 36}, spacing, modulus, nu));
        WindowStack stack(body, 13, tests::focusUnder({0.02, 0.0, 0.02}));
        for (int i = 0; i < 5; ++i) {
            tests::randomise(stack, Field::p, random);
            tests::randomise(stack, Field::z, random);
            stack.joinBorders(Field::p);
            stack.apply(Field::p, Field::q);
            stack.joinBorders(Field::z);
            stack.apply(Field::z, Field::a);
            const double own = -stack.dot(Field::p, Field::q);
            EXPECT_GT(own, 0.0);
            EXPECT_NEAR(stack.dot(Field::z, Field::q), stack.dot(Field::p, Field::a), 1e-5 * own) << "nu " << nu;
        }
    }
}

// Largest |b.M^-1 a - a.M^-1 b| over a.M^-1 a, a and b random.
double asymmetry(WindowStack& stack, Multigrid& multigrid)
{
    std::minstd_rand random(2);
    double most = 0.0;
    for (int i = 0; i < 5; ++i) {
        tests::randomise(stack, Field::p, random);
        tests::randomise(stack, Field::q, random);
        stack.copy(Field::p, Field::r);
        multigrid.solve();
        const double own = stack.dot(Field::p, Field::z);
        const double mixed = stack.dot(Field::q, Field::z);
        EXPECT_GT(own, 0.0);
        stack.copy(Field::q, Field::r);
        multigrid.solve();
        most = std::max(most, std::abs(stack.dot(Field::p, Field::z) - mixed) / own);
    }
    return most;
}

// The cycle may precondition conjugate gradients: b.M^-1 a = a.M^-1 b, and a.M^-1 a > 0.
TEST(ElasticWindows, MultigridIsSymmetricAndPositive)
{
    for (const double nu : {0.3, 0.45, 0.49}) {
        const ElasticBody body = tests::bodyOf(tests::heldBlock({40, 30, 36}, spacing, modulus, nu));
        WindowStack stack(body, 13, tests::focusUnder({0.02, 0.0, 0.02}));
        Multigrid multigrid(stack, 1);
        EXPECT_LT(asymmetry(stack, multigrid), 1e-5) << "nu " << nu;
    }
}

// And with a contact on top that is stiffer than the tissue.
TEST(ElasticWindows, MultigridWithContactsIsSymmetricAndPositive)
{
    for (const double nu : {0.3, 0.49}) {
        const ElasticBody body = tests::bodyOf(tests::heldBlock({40, 30, 36}, spacing, modulus, nu));
        WindowStack stack(body, 13, tests::focusUnder({0.02, 0.0, 0.02}));
        Multigrid multigrid(stack, 64);
        const Window& finest = stack[0];
        for (int i = 0; i < 9; ++i) {
            multigrid.addContact(0, finest.layout.at(5 + i % 3, 3, 5 + i / 3), glm::dmat3(30.0));
        }
        multigrid.prepare();
        EXPECT_LT(asymmetry(stack, multigrid), 1e-5) << "nu " << nu;
    }
}

// Cycles of conjugate gradients until a force on the surface is in balance to 1e-4.
int cyclesFor(int cells, double nu)
{
    const ElasticBody body = tests::bodyOf(tests::heldBlock(Index3(cells), spacing, modulus, nu));
    const Vec3 top(0.5 * cells * spacing, 0.0, 0.5 * cells * spacing);
    WindowStack stack(body, 15, tests::focusUnder(top));
    Multigrid multigrid(stack, 1);
    tests::forEachNode(stack, [&](std::size_t l, Window& w, std::size_t node, Vec3 rest) {
        const bool pressed = l == 0 && glm::distance(rest, top) < 2.5 * spacing;
        tests::setAt(w, node, Field::r, pressed ? Vec3(0.0, static_cast<double>(w.dof[node]) * 1e-3, 0.0) : Vec3(0.0));
    });
    return tests::solve(stack, multigrid, 1e-4, 800);
}

// Each cycle takes the residual down by a factor, on the average, that depends on Poisson's ratio: one point per cell holds
// the divergence, and the point smoother sees it less the nearer nu is to 0.5. Bounds a little over the largest of the
// three bodies.
TEST(ElasticWindows, EachCycleLowersTheResidual)
{
    for (const auto& [nu, factor] : {std::pair(0.3, 0.88), std::pair(0.45, 0.95), std::pair(0.49, 0.985)}) {
        for (const int cells : {12, 26, 54}) {
            const int most = static_cast<int>(std::log(1e-4) / std::log(factor));
            EXPECT_LE(cyclesFor(cells, nu), most) << "nu " << nu << ", " << cells << " cells";
        }
    }
}

// The 26 cells take three levels and the 54 four: a level more costs less than the eightfold work of no levels at all.
TEST(ElasticWindows, CyclesGrowSlowlyWithTheNumberOfLevels)
{
    for (const double nu : {0.3, 0.45}) {
        EXPECT_LE(cyclesFor(54, nu), 3 * cyclesFor(26, nu)) << "nu " << nu;
    }
}

// Where old and new windows overlap, the finest has what it had, to the bit.
TEST(ElasticWindows, FollowingKeepsTheDisplacement)
{
    std::minstd_rand random(3);
    const ElasticBody body = wholeBody(0.45);
    WindowStack stack(body, 15, tests::focusAt(Vec3(0.02)));
    tests::randomise(stack, Field::u, random);
    tests::randomise(stack, Field::d, random);
    stack.joinBorders(Field::u);
    stack.apply(Field::u, Field::a);
    stack.joinBorders(Field::d);
    stack.apply(Field::d, Field::e);
    const Window before = stack[0];
    ASSERT_FALSE(stack.follow(tests::focusAt(Vec3(0.021)), true));
    ASSERT_TRUE(stack.follow(tests::focusAt(Vec3(0.026, 0.02, 0.014)), true));
    const Window& now = stack[0];
    ASSERT_NE(now.low, before.low);
    int kept = 0;
    volume::forEachIndex(now.low, now.low + now.size() - 1, [&](Index3 n) {
        if (before.contains(n)) {
            ++kept;
            for (const Field f : {Field::u, Field::d}) {
                EXPECT_EQ(tests::valueAt(now, now.at(n), f), tests::valueAt(before, before.at(n), f));
            }
        }
    });
    const Index3 size = now.size();
    EXPECT_GT(kept, 500);
    EXPECT_LT(kept, size.x * size.y * size.z);
}

// Windows of `size` nodes jump about 40 times with an affine field in them; returns how far off it is at the worst node.
// What is held at the body's border goes back to where it is held, at every level, and no node from there on is looked at.
double offAfterJumps(int size)
{
    std::minstd_rand random(4);
    std::uniform_real_distribution<double> place(-0.01, 0.06);
    const ElasticBody body = wholeBody(0.45);
    WindowStack stack(body, size, tests::focusAt(Vec3(0.024)));
    tests::setField(stack, Field::u, affine);
    int moves = 0;
    double off = 0.0;
    for (int i = 0; i < 40; ++i) {
        moves += stack.follow(tests::focusAt({place(random), place(random), place(random)}), true) ? 1 : 0;
        off = std::max(off, offAffine(stack, Field::u, 2.0 * body.levels.back().nodes.spacing));
    }
    EXPECT_GT(moves, 30);
    return off;
}

// However the windows go, an affine field stays what it is.
TEST(ElasticWindows, FollowingKeepsAnAffineFieldExactly)
{
    EXPECT_LT(offAfterJumps(15), 2e-9);
}

// Small windows, of which more levels lie within the body.
TEST(ElasticWindows, FollowingWithSmallWindowsKeepsAnAffineFieldExactly)
{
    EXPECT_LT(offAfterJumps(9), 2e-9);
}

// A surface at every second node, so that wider cells are half full: their nodes over the surface have tissue where those
// of the finer window at the same places have none, and whatever displacement. With or without a slit; not beside it.
void checkFollowingOfSurface(bool hasSlit)
{
    constexpr int slit = 32;
    auto block = tests::heldBlock({40, 24, 40}, spacing, modulus, 0.3);
    if (hasSlit) {
        block.material = [whole = block.material](Index3 c) {
            return c.x == slit && c.y < 12 ? volume::CellMaterial{} : whole(c);
        };
    }
    block.air = 3;
    const ElasticBody body = tests::bodyOf(block);
    WindowStack stack(body, 13, tests::focusUnder({10e-3, 0.0, 20e-3}));
    tests::setField(stack, Field::u, affine);
    int spoilt = 0;
    tests::forEachNode(stack, [&](std::size_t level, Window& w, std::size_t node, Vec3) {
        if (w.tissue[node] == 0.0F) {
            tests::setAt(w, node, Field::u, spacing * Vec3(1.0, -2.0, 3.0));
            spoilt += level == 0 ? 1 : 0;
        }
    });
    EXPECT_GT(spoilt, 100);
    ASSERT_TRUE(stack.follow(tests::focusUnder({30e-3, 0.0, 20e-3}), true));
    double most = 0.0;
    tests::forEachNode(stack, [&](std::size_t, Window& w, std::size_t node, Vec3 rest) {
        const bool isBeside = hasSlit && rest.x > slit * spacing - 2.0 * body.levels.back().nodes.spacing;
        if (w.dof[node] != 0.0F && !isBeside && rest.y < 24e-3 - 2.0 * body.levels.back().nodes.spacing) {
            most = std::max(most, glm::distance(tests::valueAt(w, node, Field::u), affine(rest)));
        }
    });
    EXPECT_LT(most, 1e-6 * spacing);
}

TEST(ElasticWindows, FollowingTakesNothingFromNodesWithoutTissue)
{
    checkFollowingOfSurface(false);
}

TEST(ElasticWindows, NorDoesItInABodyThatHasASlitElsewhere)
{
    checkFollowingOfSurface(true);
}

// Cells of 1, 2 and 4 mm hold other nodes: a fine node beside the base may be free and the coarse one at its place held,
// and the other way round. With windows that come and go, neither takes the displacement of the other.
TEST(ElasticWindows, WhatIsHeldStaysWhereItIs)
{
    std::minstd_rand random(6);
    std::uniform_real_distribution<double> place(-0.01, 0.06);
    const ElasticBody body = tests::bodyOf(tests::shell(47, 3, spacing, modulus, 0.45, 4));
    WindowStack stack(body, 11, tests::focusAt(Vec3(0.024)));
    const auto moved = [&] {
        double most = 0.0;
        tests::forEachNode(stack, [&](std::size_t, Window& w, std::size_t node, Vec3) {
            most = std::max(most, w.open[node] == 0.0F ? glm::length(tests::valueAt(w, node, Field::u)) : 0.0);
        });
        return most;
    };
    int held = 0;
    for (int i = 0; i < 40; ++i) {
        tests::forEachNode(stack, [&](std::size_t, Window& w, std::size_t node, Vec3 rest) {
            tests::setAt(w, node, Field::u, w.open[node] != 0.0F ? affine(rest) : Vec3(0.0));
            held += w.open[node] == 0.0F ? 1 : 0;
        });
        stack.follow(tests::focusAt({place(random), place(random), place(random)}), true);
        ASSERT_EQ(moved(), 0.0) << i;
    }
    EXPECT_GT(held, 1000);
}

// What a wider window solves for itself is not taken from a finer one that moves, nor continued from it: on the finer one's
// border the wider one has the say. The surface lies at every second node, so that nodes of the border hold no tissue.
TEST(ElasticWindows, AWiderWindowKeepsWhatItSolvesItself)
{
    std::minstd_rand random(7);
    auto block = tests::heldBlock({40, 24, 40}, spacing, modulus, 0.3);
    block.air = 3;
    const ElasticBody body = tests::bodyOf(block);
    WindowStack stack(body, 13, tests::focusUnder({10e-3, 0.0, 20e-3}));
    tests::randomise(stack, Field::u, random);
    stack.joinBorders(Field::u);
    const Window before = stack[1];
    ASSERT_TRUE(stack.follow(tests::focusUnder({12e-3, 0.0, 20e-3}), true));
    ASSERT_EQ(stack[1].low, before.low) << "only the finest window has moved";
    int kept = 0;
    for (std::size_t node = 0; node < before.layout.count; ++node) {
        if (before.dof[node] != 0.0F) {
            ++kept;
            ASSERT_EQ(tests::valueAt(stack[1], node, Field::u), tests::valueAt(before, node, Field::u)) << node;
        }
    }
    EXPECT_GT(kept, 500);
}

// Windows stay nested and inside the body wherever the focus is, far outside too.
TEST(ElasticWindows, WindowsStayNested)
{
    std::minstd_rand random(5);
    std::uniform_real_distribution<double> place(-0.2, 0.2);
    const ElasticBody body = tests::bodyOf(tests::heldBlock({50, 20, 33}, spacing, modulus, 0.45));
    WindowStack stack(body, 11, tests::focusAt(Vec3(0.0)));
    for (int i = 0; i < 200; ++i) {
        stack.follow(tests::focusAt({place(random), place(random), place(random)}), false);
        for (std::size_t l = 0; l < stack.size(); ++l) {
            const Window& w = stack[l];
            const auto& level = body.levels[l].nodes;
            EXPECT_TRUE(level.contains(w.low) && level.contains(w.low + w.size() - 1));
            if (l + 1 < stack.size()) {
                EXPECT_EQ(w.low % 2, Index3(0));
                EXPECT_TRUE(stack[l + 1].contains(w.low / 2) && stack[l + 1].contains((w.low + w.size() - 1) / 2));
            }
        }
    }
}

}  // namespace
}  // namespace palpate::chainmail
