// Which nodes of the windows are degrees of freedom: those that tissue holds, and no others.
#include "gap_bodies.h"

#include <gtest/gtest.h>

namespace palpate::chainmail {
namespace {

using tests::randomiseAll;

// Whether a node moves, is fixed, or follows nodes of which that is true.
bool isHandled(const WindowStack& stack, std::size_t level, std::size_t node)
{
    const Window& w = stack.windows()[level];
    const std::size_t at = w.fragments.original(node);
    bool handled = w.dof[at] != 0.0F || w.open[at] == 0.0F;
    if (w.border[at] != 0.0F) {
        handled = true;
        w.visitParents(at, stack.windows()[level + 1],
                       [&](std::size_t parent, double) { handled = handled && isHandled(stack, level + 1, parent); });
    }
    return handled;
}

// Of a window the corners of cells that count and are left out.
int leftOut(const WindowStack& stack, std::size_t level)
{
    const Window& w = stack.windows()[level];
    int sum = 0;
    for (std::size_t cell = 0; cell < w.layout.count; ++cell) {
        for (int c = 0; c < 8 && w.uncoveredMu[cell] > 0.0F; ++c) {
            sum += isHandled(stack, level, w.layout.corner(cell, c)) ? 0 : 1;
        }
    }
    return sum;
}

// Of a window the degrees of freedom at which random displacements leave no force at all: nothing holds them, and contacts
// would carry them away.
int looseIn(WindowStack& stack, std::size_t level, std::minstd_rand& random)
{
    randomiseAll(stack, Field::p, random);
    stack.apply(Field::p, Field::q);
    const Window& w = stack[level];
    int sum = 0;
    for (std::size_t i = 0; i < w.layout.count; ++i) {
        sum += w.dof[i] != 0.0F && w.value(Field::q, i) == Vec3(0.0) ? 1 : 0;
    }
    return sum;
}

// Every corner of a cell that counts moves, is fixed, or follows what does: also where a window has more fragments than
// room for them. And what moves has such a corner.
TEST(WindowFreedom, NoNodeOfTissueBesideGapsIsLeftOutAndNoOtherMoves)
{
    std::size_t withoutRoom = 0;
    std::minstd_rand random(3);
    for (const ElasticBody& body : {tests::fingers(1, true, 64), tests::fingers(3, true, 64), tests::foam(7, 0.45),
                                    tests::foam(9, 0.5), tests::brush()}) {
        for (double z = 8e-3; z < 0.13; z += 7e-3) {
            WindowStack stack(body, 9, tests::focusUnder({26e-3, 0.0, z}));
            for (std::size_t l = 0; l < stack.size(); ++l) {
                withoutRoom += stack[l].fragments.left().size();
                EXPECT_EQ(leftOut(stack, l), 0) << l << ", z " << z;
                EXPECT_EQ(looseIn(stack, l, random), 0) << l << ", z " << z;
            }
        }
    }
    EXPECT_GT(withoutRoom, 0U);
}

// Over the surface of a block windows' borders lie over each other, up to the third: a node on which only nodes of finer
// windows hang may have nothing but air and covered cells around all of them.
TEST(WindowFreedom, NoNodeOfABlockIsLeftOutAndNoOtherMoves)
{
    std::minstd_rand random(7);
    const auto upTo = [&](int most) { return static_cast<int>(random() % static_cast<unsigned>(most + 1)); };
    for (int i = 0; i < 24; ++i) {
        tests::ElasticBlock block = tests::heldBlock({30 + upTo(45), 2 + upTo(20), 30 + upTo(45)}, 1e-3, 1e4, 0.45);
        block.air = 1 + upTo(7);
        const ElasticBody body = tests::bodyOf(block);
        const Vec3 start = 1e-3 * Vec3{upTo(block.cells.x), upTo(12) - 4, upTo(block.cells.z)};
        const auto focus = [&](Vec3 at) { return i % 2 == 0 ? tests::focusAt(at) : tests::focusUnder(at); };
        WindowStack stack(body, 9 + 2 * upTo(4), focus(start));
        for (int move = 0; move < 3; ++move) {
            for (std::size_t l = 0; l < stack.size(); ++l) {
                EXPECT_EQ(leftOut(stack, l), 0) << i << ", level " << l << ", move " << move;
                EXPECT_EQ(looseIn(stack, l, random), 0) << i << ", level " << l << ", move " << move;
            }
            stack.follow(focus(start + 1e-3 * Vec3{upTo(10) - 5, upTo(4) - 2, upTo(10) - 5}), false);
        }
    }
}

}  // namespace
}  // namespace palpate::chainmail
