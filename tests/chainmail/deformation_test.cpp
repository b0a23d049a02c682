#include "blocks.h"

#include <chainmail/deformation.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

namespace palpate::chainmail {
namespace {

constexpr std::size_t maxSeeds = 4096;

// Load, move aside, unload: the body is back at rest, to the bit.
TEST(Deformation, UnloadedBodyIsExactlyAtRest)
{
    const auto lattice = tests::block(15, {}, [](Index3) { return 1; });
    Deformation body(lattice, 20000, maxSeeds);
    std::vector<Seed> seeds(maxSeeds);
    for (int step = 0; step < 20; ++step) {
        const Vec3 centre(5.0 + 0.2 * step, 7.0, -1.5 + 0.15 * step);
        const auto count = pressSeeds(lattice, {centre.x, centre.y, -2.5}, centre, 2.0, seeds);
        EXPECT_GT(count, 0U);
        body.deform(std::span(seeds).first(count));
        EXPECT_GT(body.moved().size(), count / 2);
    }
    body.deform({});
    for (const Vec3f u : body.u()) {
        ASSERT_EQ(u, Vec3f(0));
    }
    EXPECT_TRUE(body.moved().empty());
}

// Same pose, same shape, whichever way it was reached: a detour leaves no trace.
TEST(Deformation, ShapeDoesNotDependOnThePath)
{
    const auto lattice = tests::block(15, {}, [](Index3 at) { return at.x > 9 ? 2 : 1; });
    Deformation direct(lattice, 20000, maxSeeds), detour(lattice, 20000, maxSeeds);
    std::vector<Seed> seeds(maxSeeds);
    const auto press = [&](Deformation& d, Vec3 centre) {
        d.deform(std::span(seeds).first(pressSeeds(lattice, {centre.x, centre.y, -2.5}, centre, 2.0, seeds)),
                 Yield(0, 0, 1));
    };
    press(direct, {8, 7, 1});
    press(detour, {3, 3, 2});
    press(detour, {12, 9, 1.5});
    press(detour, {8, 7, 1});
    for (std::size_t n = 0; n < direct.u().size(); ++n) {
        ASSERT_EQ(direct.u()[n], detour.u()[n]);
    }
}

// However the ball lies and moves, its seeds fit what maxPressSeeds() sets aside.
TEST(PressSeeds, NeverMoreThanSetAside)
{
    const auto lattice = tests::block(40, {}, [](Index3) { return 1; });
    std::mt19937 random(2);
    std::uniform_real_distribution<double> place(-5.0, 45.0), size(0.2, 9.0);
    std::vector<Seed> seeds(60000);
    for (int i = 0; i < 300; ++i) {
        const auto pick = [&] { return Vec3(place(random), place(random), place(random)); };
        const double radius = size(random);
        EXPECT_LE(pressSeeds(lattice, pick(), pick(), radius, seeds), maxPressSeeds(lattice, radius));
    }
}

// After a press no node is inside the ball, and those under it lie on its far side.
TEST(Deformation, NoPressedNodeIsInsideTheBall)
{
    const auto lattice = tests::block(21, {}, [](Index3) { return 1; });
    Deformation body(lattice, 100000, maxSeeds);
    std::vector<Seed> seeds(maxSeeds);
    const Vec3 centre(10.2, 9.7, 0.5);
    const double radius = 3.3;
    const auto count = pressSeeds(lattice, {centre.x, centre.y, -radius}, centre, radius, seeds);
    const auto result = body.deform(std::span(seeds).first(count), Yield(0, 0, 1));
    EXPECT_EQ(result.residual, 0.0);
    for (Node n = 0; n < lattice.tissue.size(); ++n) {
        if (lattice.isNode(n)) {
            const Vec3 at = lattice.grid.position(lattice.grid.node(n)) + Vec3(body.u()[n]);
            ASSERT_GE(glm::distance(at, centre), radius - 1e-4);
        }
    }
}

// Only nodes that change their cell are rewritten: a press that stays where it is rewrites nothing.
TEST(Deformation, OccupancyFollowsOnlyWhatMoved)
{
    const auto lattice = tests::block(15, {}, [](Index3) { return 1; });
    Deformation body(lattice, 20000, maxSeeds);
    volume::DistanceField surface;
    std::vector<Seed> seeds(maxSeeds);
    const auto count = pressSeeds(lattice, {7, 7, -2.0}, {7, 7, 0.6}, 2.0, seeds);
    body.deform(std::span(seeds).first(count));
    const auto map = body.shape().body(surface);
    const auto once = map.map.rewrites();
    EXPECT_GT(once, 0U);
    EXPECT_LE(once, body.moved().size());
    body.deform(std::span(seeds).first(count));
    EXPECT_EQ(map.map.rewrites(), once);
    body.deform({});
    EXPECT_EQ(map.map.rewrites(), 2 * once);
}

}  // namespace
}  // namespace palpate::chainmail
