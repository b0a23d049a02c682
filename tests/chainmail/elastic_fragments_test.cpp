// Gaps that are narrower than the cells of the wider windows.
#include "gap_bodies.h"

#include <chainmail/split_level.h>
#include <tests/allocations.h>

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <span>
#include <vector>

namespace palpate::chainmail {
namespace {

using tests::brush;
using tests::cellSize;
using tests::fatModulus;
using tests::fingers;
using tests::foam;
using tests::randomiseAll;

ElasticTool fingerBall(Vec3 centre)
{
    return {{centre, centre, 6e-3, 6e-3}, Vec3(0.0, 3e-3, 0.0)};
}

// Force of a ball that presses the second finger's end by 3 mm, along y or x, with windows of that many nodes.
double forceOnFinger(const ElasticBody& body, int gap, int window, bool acrossGap)
{
    ElasticOptions options;
    options.window = window;
    options.law = volume::NeoHookean{};
    const double low = (8 + gap) * cellSize;  // of the finger along x
    const Vec3 way = acrossGap ? Vec3(-1, 0, 0) : Vec3(0, 1, 0);
    const Vec3 top = acrossGap ? Vec3(low + 16e-3, 8e-3, 8e-3) : Vec3(low + 8e-3, 0.0, 8e-3);
    const Focus focus{top, way, 0.0};
    Elastic elastic(body, options, focus);
    ElasticTool tool = fingerBall(top);
    for (int i = 0; i <= 30; ++i) {
        const double depth = 1e-4 * i;
        tool.shape.a = tool.shape.b = top + (depth - 6e-3) * way;
        tool.pushed = depth * way;
        elastic.relax({std::span(&tool, 1), {}, focus}, i < 30 ? 4 : 300, 1e-5);
    }
    return -glm::dot(elastic.toolForce(0), way);
}

// A finger beside another one is as soft as alone, however wide the cells are that hold the rest of it. Without nodes of
// their own the fingers bend as one: then it is up to four times as stiff.
TEST(ElasticFragments, AFingerBesideAnotherBendsAsItDoesAlone)
{
    for (const bool acrossGap : {false, true}) {
        for (const int gap : {1, 2, 3, 5}) {
            const int window = gap == 2 ? 61 : 9;
            const double alone = forceOnFinger(fingers(gap, false), gap, window, acrossGap);
            const double beside = forceOnFinger(fingers(gap, true), gap, window, acrossGap);
            EXPECT_NEAR(beside, alone, 0.02 * alone) << "gap " << gap << ", across it " << acrossGap;
        }
    }
}

// The same of fingers that end in bone of their own: both sides of a gap are held.
TEST(ElasticFragments, BothSidesOfAGapAreHeld)
{
    for (const bool acrossGap : {false, true}) {
        for (const int gap : {1, 2, 3}) {
            const double alone = forceOnFinger(fingers(gap, false, 24, false, 0), gap, 9, acrossGap);
            const double beside = forceOnFinger(fingers(gap, true, 24, false, 0), gap, 9, acrossGap);
            EXPECT_NEAR(beside, alone, 0.02 * alone) << "gap " << gap << ", across it " << acrossGap;
        }
    }
}

// What is asked for of a place in a wider window is the displacement of the tissue there, and not of that across the gap.
TEST(ElasticFragments, APlaceMovesWithItsOwnTissue)
{
    for (const int gap : {1, 2, 3}) {
        const ElasticBody body = fingers(gap, true, 40, false, 0);
        ElasticOptions options;
        options.window = 9;
        options.law = volume::NeoHookean{};
        const Vec3 top((16 + 2 * gap) * 1e-3 + 8e-3, 0.0, 8e-3);
        Elastic elastic(body, options, tests::focusUnder(top));
        const ElasticTool tool = fingerBall(top - Vec3(0.0, 3e-3, 0.0));
        elastic.relax({std::span(&tool, 1), {}, tests::focusUnder(top)}, 400, 1e-4);
        for (const double z : {10e-3, 25e-3, 40e-3, 55e-3}) {
            const Vec3 one(15.5e-3, 8e-3, z), other((16 + 2 * gap) * 1e-3 + 0.5e-3, 8e-3, z);
            const double moved = glm::length(elastic.displacement(other));
            EXPECT_GT(moved, 5e-5);
            EXPECT_NEAR(moved, glm::length(elastic.displacement({top.x, 8e-3, z})), 0.05 * moved);
            EXPECT_LT(glm::length(elastic.displacement(one)), 0.02 * moved) << "gap " << gap << ", z " << z;
            const Index3 cell(4 + 7, 4 + 4, 4 + static_cast<int>(z / cellSize));
            EXPECT_LT(glm::length(elastic.displacementOf(cell)), 0.02 * moved) << "gap " << gap << ", z " << z;
        }
    }
}

// A ball that strokes the second of two fingers of 128 mm, from its middle to the palm and back, and what it feels.
std::vector<double> stroke(Elastic& elastic)
{
    std::vector<double> forces(1001);
    ElasticTool tool = fingerBall(Vec3(0.0));
    for (int i = 0; i <= 1000; ++i) {
        const Vec3 top(26e-3, 0.0, 60e-3 + 0.12e-3 * std::min(i, 1000 - i));
        tool.shape.a = tool.shape.b = top - Vec3(0.0, 3e-3, 0.0);
        const Focus focus{top, Vec3(0, 1, 0), 0.0};
        elastic.relax({std::span(&tool, 1), {}, focus});
        forces[static_cast<std::size_t>(i)] = -elastic.toolForce(0).y;
    }
    return forces;
}

// Windows that follow a tool along a gap and past its end feel what they feel without the other finger, with the history of
// tissue that relaxes. Nothing comes from the heap but the list of forces.
TEST(ElasticFragments, WindowsMoveAlongAGap)
{
    for (const bool relaxes : {false, true}) {
        const ElasticBody one = fingers(1, false, 64, relaxes), two = fingers(1, true, 64, relaxes);
        ElasticOptions options;
        options.window = 13;
        options.law = volume::NeoHookean{};
        Elastic alone(one, options, tests::focusUnder({26e-3, 0.0, 60e-3}));
        Elastic beside(two, options, tests::focusUnder({26e-3, 0.0, 60e-3}));
        const std::vector<double> expected = stroke(alone);
        std::vector<double> found;
        EXPECT_EQ(tests::allocationsIn([&] { found = stroke(beside); }), 1U);
        double off = 0.0, sum = 0.0;
        for (std::size_t i = 50; i < found.size(); ++i) {
            off += std::abs(found[i] - expected[i]);
            sum += expected[i];
        }
        EXPECT_LT(off, 0.02 * sum) << "relaxes " << relaxes;
    }
}

std::size_t fragmentsOf(const ElasticBody& body)
{
    std::size_t sum = 0;
    for (const CellLevel& level : body.levels) {
        sum += level.fragments.cells.size();
    }
    return sum;
}

// How the nodes of a level follow the next coarser one.
struct Following {
    const CellLevel &fine, &coarse;
    std::map<std::uint32_t, const NodeLink*> links;

    Following(const CellLevel& one, const CellLevel& next) : fine(one), coarse(next)
    {
        for (const NodeLink& link : fine.fragments.links) {
            EXPECT_TRUE(links.emplace(link.node, &link).second);
        }
    }
    // That a node of tissue in a coarse cell, or in a fragment of it, follows the nodes of this one.
    void check(std::uint32_t node, Index3 at, std::uint32_t fragment, Index3 coarseCell) const
    {
        const auto link = links.find(node);
        std::size_t i = 0;
        volume::forEachIndex(at / 2, at / 2 + at % 2, [&](Index3 parent) {
            const auto corner = static_cast<std::size_t>(octantOf(parent - coarseCell));
            const auto own = static_cast<std::uint32_t>(coarse.nodes.offset(parent));
            const std::uint32_t wanted = fragment == noFragment ? own : coarse.fragments.cells[fragment].nodes[corner];
            EXPECT_EQ(link == links.end() ? own : link->second->parents[i], wanted);
            ++i;
        });
    }
    void checkCell(Index3 c) const
    {
        const std::uint32_t in = coarse.fragments.holding(c, coarse.nodes.size.y);
        volume::forEachIndex(c, c + 1,
                             [&](Index3 n) { check(static_cast<std::uint32_t>(fine.nodes.offset(n)), n, in, c / 2); });
    }
    void checkFragment(const CellFragment& f) const
    {
        for (int c = 0; c < 8; ++c) {
            const Index3 at = f.cell + octant(c);
            check(f.nodes[static_cast<std::size_t>(c)], at, f.parent, f.cell / 2);
        }
    }
};

// Tissue of a level and its fragments together: each cell of the next finer level lies in one of them, and its nodes follow
// one set of nodes, whichever of the cells around asks.
TEST(ElasticFragments, EveryNodeFollowsOneSetOfNodes)
{
    for (const double filled : {0.4, 0.5, 0.6}) {
        const ElasticBody body = foam(5, filled);
        ASSERT_GT(fragmentsOf(body), 0U);
        for (std::size_t l = 0; l + 1 < body.levels.size(); ++l) {
            const Following following(body.levels[l], body.levels[l + 1]);
            volume::forEachIndex(Index3(0), following.fine.nodes.size - 2, [&](Index3 c) {
                if (following.fine.mu[following.fine.nodes.offset(c)] > 0.0F) {
                    following.checkCell(c);
                }
            });
            for (const CellFragment& f : following.fine.fragments.cells) {
                following.checkFragment(f);
            }
        }
    }
}

// A body without gaps has no fragments: whatever its surface looks like.
TEST(ElasticFragments, ABodyWithoutGapsHasNone)
{
    EXPECT_EQ(fragmentsOf(tests::bodyOf(tests::heldBlock({23, 17, 21}, cellSize, fatModulus, 0.45))), 0U);
    tests::ElasticBlock ball = tests::heldBlock({25, 25, 25}, cellSize, fatModulus, 0.45);
    ball.material = [](Index3 c) {
        const double off = glm::length(Vec3(c) - 12.0);
        return off < 12.3 ? tests::tissue(fatModulus, 0.45, off < 3.0) : volume::CellMaterial{};
    };
    EXPECT_EQ(fragmentsOf(tests::bodyOf(ball)), 0U);
}

// What hangs together with nothing that is held stays one with what is near.
TEST(ElasticFragments, LooseTissueStaysWithWhatIsNear)
{
    tests::ElasticBlock block = tests::heldBlock({16, 16, 16}, cellSize, fatModulus, 0.45);
    block.material = [](Index3 c) {
        return c.y == 9 ? volume::CellMaterial{} : tests::tissue(fatModulus, 0.45, c.y == 15);
    };
    EXPECT_EQ(fragmentsOf(tests::bodyOf(block)), 0U);
    block.material = [](Index3 c) {
        const bool isBridge = c.x < 2;
        return c.y == 9 && !isBridge ? volume::CellMaterial{} : tests::tissue(fatModulus, 0.45, c.y == 15);
    };
    EXPECT_GT(fragmentsOf(tests::bodyOf(block)), 0U);
}

// x . A y = A x . y, over all windows, fragments and links; and the multigrid's answer likewise.
TEST(ElasticFragments, OperatorAndMultigridAreSymmetricAndPositive)
{
    for (const double filled : {0.4, 0.5}) {
        const ElasticBody body = foam(11, filled);
        WindowStack stack(body, 9, tests::focusAt({0.02, 0.018, 0.02}));
        std::size_t placed = 0;
        for (const Window& w : stack.windows()) {
            placed += w.fragments.placed().size();
        }
        ASSERT_GT(placed, 20U);
        std::minstd_rand random(3);
        randomiseAll(stack, Field::u, random);
        randomiseAll(stack, Field::d, random);
        stack.apply(Field::u, Field::a);
        stack.apply(Field::d, Field::e);
        const double one = stack.dot(Field::d, Field::a), other = stack.dot(Field::u, Field::e);
        const double scale = -stack.dot(Field::u, Field::a);
        EXPECT_GT(scale, 0.0);
        EXPECT_NEAR(one, other, 2e-5 * scale);

        Multigrid multigrid(stack, 8);
        multigrid.prepare();
        const auto answer = [&](Field right, Field out) {
            stack.copy(right, Field::r);
            multigrid.solve();
            stack.copy(Field::z, out);
        };
        answer(Field::a, Field::p);
        const double energy = stack.dot(Field::p, Field::a);
        const double mixed = stack.dot(Field::p, Field::e);
        answer(Field::e, Field::q);
        EXPECT_GT(energy, 0.0);
        EXPECT_GT(stack.dot(Field::q, Field::e), 0.0);
        EXPECT_NEAR(mixed, stack.dot(Field::q, Field::a), 1e-4 * std::max(energy, std::abs(mixed)));
    }
}

// Two fingers take about as many cycles as one: smoothers are damped by the fragments' stiffness, and all levels know the
// gap.
TEST(ElasticFragments, AGapCostsFewCycles)
{
    const auto cycles = [](bool both) {
        const ElasticBody body = fingers(1, both);
        WindowStack stack(body, 61, tests::focusAt({26e-3, 8e-3, 8e-3}));
        Multigrid multigrid(stack, 8);
        multigrid.prepare();
        const Index3 end(4 + 13, 4 + 4, 4);  // of the second finger
        stack[0].set(Field::r, stack[0].at(end), Vec3(0.0, 1.0, 0.0));
        return tests::solve(stack, multigrid, 1e-4, 200);
    };
    EXPECT_LE(cycles(true), 1.5 * cycles(false));
}

// No fragment is stiffer than what the smoothers are damped for: the largest eigenvalue of D^-1 A by power iteration.
TEST(ElasticFragments, SmoothersAreDampedForFragments)
{
    const ElasticBody body = foam(5, 0.42);
    WindowStack stack(body, 61, tests::focusAt({0.02, 0.018, 0.02}));
    std::minstd_rand random(1);
    std::uniform_real_distribution<float> value(-1.0F, 1.0F);
    for (std::size_t l = 1; l < stack.size(); ++l) {
        Window& w = stack[l];
        ASSERT_EQ(w.size(), body.levels[l].nodes.size);
        const std::size_t count = 3 * w.layout.count;
        std::span<float> z(w.field(Field::z), count), r(w.field(Field::r), count);
        std::ranges::generate(r, [&] { return value(random); });
        double after = 1.0;
        for (int i = 0; i < 40; ++i) {
            const auto scale = static_cast<float>(1.0 / std::sqrt(after));
            stack.kernels().smoothFirst(scale, w.diagonal.data(), r.data(), z.data(), w.layout.count);
            w.share(Field::z);
            stack.kernels().apply(w.layout, w.stiffness(), z.data(), r.data(), stack.scratch());
            w.collect(Field::r);
            after = 0.0;
            for (std::size_t k = 0; k < count; ++k) {
                after += static_cast<double>(w.diagonal[k % w.layout.count] * r[k] * r[k]);
            }
        }
        EXPECT_LT(std::sqrt(after), 1.05 * body.levels[l].radius) << "level " << l;
        EXPECT_GT(std::sqrt(after), 0.5 * body.levels[l].radius) << "level " << l;
    }
}

// A body that moves as a whole has no force in it: fragments follow across borders and between levels.
TEST(ElasticFragments, ARigidMotionHasNoForce)
{
    const ElasticBody body = foam(7, 0.45);
    WindowStack stack(body, 9, tests::focusAt({0.02, 0.018, 0.02}));
    std::minstd_rand random(1);
    randomiseAll(stack, Field::u, random);
    stack.apply(Field::u, Field::a);
    const double much = std::sqrt(stack.dot(Field::a, Field::a));
    for (Window& w : stack.windows()) {
        for (std::size_t i = 0; i < 3 * w.layout.count; ++i) {
            w.field(Field::u)[i] = i < w.layout.count ? 0.3F : i < 2 * w.layout.count ? -0.5F : 0.7F;
        }
    }
    stack.joinBorders(Field::u);
    stack.apply(Field::u, Field::a);
    EXPECT_LT(std::sqrt(stack.dot(Field::a, Field::a)), 1e-4 * much);
}

// What moves as one still does where the windows are next. Covered nodes of wider windows have meant nothing: there the
// finer window's displacement is taken, and its mean where a virtual node lies in the gap.
TEST(ElasticFragments, FollowingKeepsTheDisplacement)
{
    const ElasticBody body = fingers(1, true, 64);
    WindowStack stack(body, 9, tests::focusUnder({26e-3, 0.0, 8e-3}));
    int moves = 0;
    for (double z = 8e-3; z < 0.13; z += 2e-3) {
        for (Window& w : stack.windows()) {
            for (std::size_t i = 0; i < 3 * w.layout.count; ++i) {
                const std::size_t node = i % w.layout.count;
                const bool isCovered = w.tissue[node] > 0.0F && w.dof[node] + w.border[node] == 0.0F;
                w.field(Field::u)[i] = isCovered ? 7.0F : 1.0F;
            }
            w.share(Field::u);
        }
        if (!stack.follow(tests::focusUnder({26e-3, 0.0, z}), true)) {
            continue;
        }
        ++moves;
        for (Window& w : stack.windows()) {
            for (const auto& v : w.fragments.virtuals()) {
                EXPECT_TRUE(w.dof[v.at] == 0.0F || std::abs(w.field(Field::u)[v.at] - 1.0F) < 1e-5F) << z;
            }
            for (const auto& copy : w.fragments.copies()) {
                EXPECT_EQ(w.field(Field::u)[copy.at], w.field(Field::u)[copy.original]);
            }
        }
    }
    EXPECT_GT(moves, 20);
}

// A place in a fragment without room moves with the cell itself.
TEST(ElasticFragments, PlacesWithoutRoomMoveWithTheirCell)
{
    const ElasticBody body = brush();
    const Vec3 top(42e-3, 42e-3, 0.0), inward(0, 0, 1);
    ElasticOptions options;
    options.window = 9;
    Elastic elastic(body, options, Focus(top, inward, 0.0));
    const auto lacksRoom = [](const Window& w) { return !w.fragments.left().empty(); };
    ASSERT_TRUE(std::ranges::any_of(elastic.stack().windows(), lacksRoom));
    const ElasticTool tool{{top, top, 6e-3, 6e-3}, 3e-3 * inward};
    elastic.relax({std::span(&tool, 1), {}, Focus(top, inward, 0.0)}, 20, 1e-3);
    volume::forEachIndex(Index3(2), Index3(42, 42, 21), [&](Index3 cell) {
        EXPECT_LT(glm::length(elastic.displacementOf(cell)), 20e-3);
        EXPECT_LT(glm::length(elastic.displacement(cellSize * (Vec3(cell) - 1.5))), 20e-3);
    });
}

// The history is a force: what all of it together is does not change where the windows move, but for what nodes in the air
// held.
TEST(ElasticFragments, FollowingKeepsTheHistorysForce)
{
    const ElasticBody body = fingers(1, true, 64, true);
    WindowStack stack(body, 9, tests::focusUnder({26e-3, 0.0, 8e-3}));
    std::minstd_rand random(5);
    const auto sum = [&] {
        double all = 0.0;
        for (const Window& w : stack.windows()) {
            const float* h = w.field(WindowStack::history(0));
            for (std::size_t i = 0; i < w.layout.count; ++i) {
                all += static_cast<double>(h[i]);
            }
        }
        return all;
    };
    int moves = 0;
    for (double z = 8e-3; z < 0.1; z += 2e-3) {
        randomiseAll(stack, WindowStack::history(0), random);
        for (Window& w : stack.windows()) {
            for (std::size_t i = 0; i < w.layout.count; ++i) {
                w.field(WindowStack::history(0))[i] = w.dof[i] * (1.0F + w.field(WindowStack::history(0))[i]);
            }
        }
        const double before = sum();
        if (stack.follow(tests::focusUnder({26e-3, 0.0, z}), true)) {
            ++moves;
            EXPECT_NEAR(sum(), before, 0.02 * before) << z;
        }
    }
    EXPECT_GT(moves, 15);
}

}  // namespace
}  // namespace palpate::chainmail
