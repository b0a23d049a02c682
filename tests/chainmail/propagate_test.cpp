#include "../allocations.h"
#include "blocks.h"

#include <chainmail/propagate.h>

#include <gtest/gtest.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::chainmail {
namespace {

using tests::block;
using tests::nodeAt;
using tests::TwoMaterials;

constexpr std::uint32_t plenty = 200000;
// Links are counted as legal within 1e-5 of their length; a chain of them adds up.
constexpr double rounding = 2e-5;

struct State {
    explicit State(const Lattice& l, std::uint32_t moves = plenty) : u(l.tissue.size(), Vec3f(0)), scratch(l, moves, 8) {}
    std::vector<Vec3f> u;
    PropagateScratch scratch;
};

// Largest violation of any link [m].
double worstViolation(const Lattice& lattice, std::span<const Vec3f> u) noexcept
{
    float worst = 0.0F;
    for (Node a = 0; a < lattice.tissue.size(); ++a) {
        if (lattice.tissue[a] == 0) {
            continue;
        }
        for (int side = 1; side < 6; side += 2) {
            const Node b = lattice.beside(a, side);
            if (lattice.isNode(b)) {
                worst = std::max(worst, glm::length(correction(u[b] - u[a], side, lattice.between(a, b))));
            }
        }
    }
    return static_cast<double>(worst);
}

// One node of a half-space at rest, pushed by d along the axis into it: with axial slack a and shear slack g,
//     u(i, j, k) = max(0, d - a |k| - g (|i| + |j|))
TEST(Propagate, OneNodePushedIntoAHalfSpaceFollowsTheClosedForm)
{
    const TwoMaterials m{.softCompress = 0.7, .softStretch = 1.4, .softShear = 0.45};
    const auto lattice = block(21, m, [](Index3) { return 1; });
    State s(lattice);
    const Index3 top(10, 10, 0);
    const double d = 3.3;
    const Seed seed{nodeAt(lattice, top), Vec3f(0, 0, static_cast<float>(d))};
    const auto result = propagate(lattice, s.u, s.scratch, {&seed, 1});

    EXPECT_EQ(result.residual, 0.0);
    std::size_t moved = 0;
    for (Node n = 0; n < lattice.tissue.size(); ++n) {
        if (!lattice.isNode(n)) {
            continue;
        }
        const Index3 r = glm::abs(lattice.grid.node(n) - Index3(1) - top);
        const double expected = std::max(0.0, d - 0.3 * r.z - 0.45 * (r.x + r.y));
        EXPECT_NEAR(s.u[n].z, expected, rounding) << r.x << ' ' << r.y << ' ' << r.z;
        EXPECT_EQ(s.u[n].x, 0.0F);
        moved += expected > rounding ? 1 : 0;
    }
    EXPECT_EQ(s.scratch.moved.size(), moved);
    // Every node is moved once: in one material the order is already right.
    EXPECT_EQ(result.moves + 1, moved);
}

// A pulled node's links are as long as they may be: u = max(0, d - b |k| - g (|i| + |j|)) with b the slack in stretch.
TEST(Propagate, OneNodePulledOutFollowsTheClosedForm)
{
    const TwoMaterials m{.softCompress = 0.7, .softStretch = 1.25, .softShear = 0.5};
    const auto lattice = block(17, m, [](Index3) { return 1; });
    State s(lattice);
    const Index3 top(8, 8, 0);
    const Seed seed{nodeAt(lattice, top), Vec3f(0, 0, -2.0F)};
    propagate(lattice, s.u, s.scratch, {&seed, 1});
    for (int k = 0; k < 17; ++k) {
        for (int i = 0; i < 17; ++i) {
            const double expected = -std::max(0.0, 2.0 - 0.25 * k - 0.5 * std::abs(i - 8));
            EXPECT_NEAR(s.u[nodeAt(lattice, {i, 8, k})].z, expected, rounding);
        }
    }
}

// The limits of a link are the means of both ends': behind the boundary soft | stiff one link has slack (a + b) / 2.
TEST(Propagate, LinksBetweenTissuesTakeTheMeanOfBothLimits)
{
    const TwoMaterials m{.softCompress = 0.6, .softShear = 10, .stiffCompress = 0.9, .stiffShear = 10};
    const auto lattice = block(9, m, [](Index3 at) { return at.z < 4 ? 1 : 2; });
    State s(lattice);
    const Seed seed{nodeAt(lattice, {4, 4, 0}), Vec3f(0, 0, 3.0F)};
    propagate(lattice, s.u, s.scratch, {&seed, 1});
    double expected = 3.0;
    for (int k = 0; k < 9; ++k) {
        EXPECT_NEAR(s.u[nodeAt(lattice, {4, 4, k})].z, expected, rounding) << k;
        expected -= k < 3 ? 0.4 : k == 3 ? 0.25 : 0.1;
    }
}

// Pushing the mirrored or rotated block by the mirrored or rotated push gives the mirrored or rotated answer.
TEST(Propagate, MirroredAndRotatedPushesGiveMirroredAndRotatedAnswers)
{
    constexpr int n = 11;
    const auto material = [](Index3 at) { return glm::length(glm::dvec3(at) - glm::dvec3(6.0, 4.5, 5.5)) < 2.6 ? 2 : 1; };
    const auto mirror = [](Index3 at) { return Index3(n - 1 - at.x, at.y, at.z); };
    const auto rotate = [](Index3 at) { return Index3(at.y, at.z, at.x); };  // a cyclic turn: its inverse is (z, x, y)
    const auto unrotate = [](Index3 at) { return Index3(at.z, at.x, at.y); };
    const TwoMaterials m;
    const auto plain = block(n, m, material);
    const auto mirrored = block(n, m, [&](Index3 at) { return material(mirror(at)); });
    const auto rotated = block(n, m, [&](Index3 at) { return material(unrotate(at)); });

    const Index3 at(3, 4, 5);
    const Vec3f push(2.1F, 0.7F, -0.4F);
    State a(plain), b(mirrored), c(rotated);
    const Seed sa{nodeAt(plain, at), push};
    const Seed sb{nodeAt(mirrored, mirror(at)), {-push.x, push.y, push.z}};
    const Seed sc{nodeAt(rotated, rotate(at)), {push.y, push.z, push.x}};
    propagate(plain, a.u, a.scratch, {&sa, 1});
    propagate(mirrored, b.u, b.scratch, {&sb, 1});
    propagate(rotated, c.u, c.scratch, {&sc, 1});
    for (int k = 0; k < n; ++k) {
        for (int j = 0; j < n; ++j) {
            for (int i = 0; i < n; ++i) {
                const Index3 p(i, j, k);
                const Vec3f u = a.u[nodeAt(plain, p)];
                const Vec3f v = b.u[nodeAt(mirrored, mirror(p))];
                const Vec3f w = c.u[nodeAt(rotated, rotate(p))];
                EXPECT_LT(glm::length(v - Vec3f(-u.x, u.y, u.z)), rounding);
                EXPECT_LT(glm::length(w - Vec3f(u.y, u.z, u.x)), rounding);
            }
        }
    }
}

// 10,000 drags of random nodes, one upon the other, in 100 random blocks of two materials: never a violated link.
TEST(Propagate, NoLinkIsViolatedAfterAnyOfTenThousandRandomDrags)
{
    std::mt19937 random(7);
    const auto uniform = [&](double low, double high) { return std::uniform_real_distribution(low, high)(random); };
    double worst = 0.0;
    for (int blockNumber = 0; blockNumber < 100; ++blockNumber) {
        const TwoMaterials m{uniform(0.3, 0.8),  uniform(1.1, 1.8), uniform(0.1, 0.8),
                             uniform(0.85, 1.0), uniform(1.0, 1.1), uniform(0.0, 0.1)};
        const int n = 7;
        std::vector<int> pattern(n * n * n);
        std::generate(pattern.begin(), pattern.end(), [&] { return uniform(0, 1) < 0.3 ? 2 : 1; });
        const auto lattice =
            block(n, m, [&](Index3 at) { return pattern[static_cast<std::size_t>((at.z * n + at.y) * n + at.x)]; });
        State s(lattice);
        for (int drag = 0; drag < 100; ++drag) {
            const auto pick = [&] { return static_cast<int>(uniform(0, n)) % n; };
            const Node node = nodeAt(lattice, {pick(), pick(), pick()});
            const Seed seed{node, s.u[node] + Vec3f(uniform(-4, 4), uniform(-4, 4), uniform(-4, 4))};
            const auto result = propagate(lattice, s.u, s.scratch, {&seed, 1});
            ASSERT_EQ(result.residual, 0.0) << "block " << blockNumber << " drag " << drag << " moves " << result.moves;
            ASSERT_EQ(s.u[node], seed.u);
            worst = std::max(worst, worstViolation(lattice, s.u));
        }
    }
    EXPECT_LT(worst, rounding);
}

// Inside the inclusion no link is stretched, shortened or sheared by more than its limits, and the inclusion as a whole
// follows a push of 4 spacings through soft tissue: the case where plain FIFO order leaves violated links.
TEST(Propagate, StiffInclusionStaysRigidWithinItsLimits)
{
    const TwoMaterials m{.stiffCompress = 0.98, .stiffStretch = 1.02, .stiffShear = 0.02};
    const auto inside = [](Index3 at) {
        return std::max({std::abs(at.x - 9), std::abs(at.y - 9), std::abs(at.z - 7)}) <= 3;
    };
    const auto lattice = block(19, m, [&](Index3 at) { return inside(at) ? 2 : 1; });
    State s(lattice);
    const Seed seed{nodeAt(lattice, {8, 10, 1}), Vec3f(0, 0, 4.0F)};
    const auto result = propagate(lattice, s.u, s.scratch, {&seed, 1});
    EXPECT_EQ(result.residual, 0.0);
    EXPECT_LT(worstViolation(lattice, s.u), rounding);
    const float top = s.u[nodeAt(lattice, {9, 9, 4})].z;
    EXPECT_GT(top, 1.0F);
    for (int k = 4; k <= 10; ++k) {
        for (int i = 6; i <= 12; ++i) {
            const int links = std::abs(i - 9) + (k - 4);
            EXPECT_NEAR(s.u[nodeAt(lattice, {i, 9, k})].z, top, 0.02 * links + rounding);
        }
    }
}

TEST(Propagate, FixedTissueStaysAndTheOtherEndYields)
{
    const TwoMaterials m{.softCompress = 0.5, .softStretch = 1.5, .softShear = 0.5};
    const auto lattice = block(9, m, [](Index3 at) { return at.z == 8 ? 3 : 1; });
    State s(lattice);
    const Seed seed{nodeAt(lattice, {4, 4, 0}), Vec3f(0, 0, 3.0F)};
    const auto result = propagate(lattice, s.u, s.scratch, {&seed, 1});
    EXPECT_EQ(result.residual, 0.0);
    EXPECT_LT(worstViolation(lattice, s.u), rounding);
    for (int i = 0; i < 9; ++i) {
        EXPECT_EQ(s.u[nodeAt(lattice, {i, 4, 8})], Vec3f(0));
    }
}

// Over-pulled between an anchor and a hand: no legal shape exists. The work stops at its cap and says what is left.
TEST(Propagate, InfeasiblePullEndsAtTheCapAndReportsTheResidual)
{
    const TwoMaterials m{.softStretch = 1.1};
    const auto lattice = block(5, m, [](Index3 at) { return at.z == 4 ? 3 : 1; });
    State s(lattice, 5000);
    const Seed seed{nodeAt(lattice, {2, 2, 0}), Vec3f(0, 0, -6.0F)};
    const auto result = propagate(lattice, s.u, s.scratch, {&seed, 1});
    EXPECT_LE(result.moves, 5000U);
    EXPECT_GT(result.residual, 0.1);
    EXPECT_NEAR(result.residual, worstViolation(lattice, s.u), 1.0);
}

TEST(Propagate, SeveralSeedsLeaveNoViolatedLink)
{
    const auto lattice = block(15, {}, [](Index3 at) { return (at.x + at.y + at.z) % 5 == 0 ? 2 : 1; });
    State s(lattice);
    const std::array seeds{Seed{nodeAt(lattice, {4, 7, 0}), Vec3f(0, 0, 2.0F)},
                           Seed{nodeAt(lattice, {10, 7, 0}), Vec3f(0, 0, 2.5F)},
                           Seed{nodeAt(lattice, {7, 3, 14}), Vec3f(0, 0, -1.5F)}};
    const auto result = propagate(lattice, s.u, s.scratch, seeds);
    EXPECT_EQ(result.residual, 0.0);
    EXPECT_LT(worstViolation(lattice, s.u), rounding);
}

TEST(Propagate, AllocatesNothing)
{
    const auto lattice = block(15, {}, [](Index3 at) { return at.x > 7 ? 2 : 1; });
    State s(lattice, 3000);
    const auto count = tests::allocationsIn([&] {
        for (int i = 0; i < 50; ++i) {
            const Seed seed{nodeAt(lattice, {i % 15, 7, 0}), Vec3f(0, 0, 0.1F * static_cast<float>(i))};
            propagate(lattice, s.u, s.scratch, {&seed, 1});
        }
    });
    EXPECT_EQ(count, 0U);
}

}  // namespace
}  // namespace palpate::chainmail
