#include "../allocations.h"

#include <occupancy/query.h>

#include <gtest/gtest.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <set>

namespace palpate::occupancy {
namespace {

/// A body on an n^3 grid, 1 m apart, whose surface is given by a signed distance.
struct Solid {
    Solid(int n, const std::function<double(Vec3)>& sd)
        : grid{Index3(n), Vec3(0.0), 1.0},
          solid(grid.count()),
          u(grid.count(), Vec3f(0)),
          surface{{grid, std::vector<float>(grid.count())}}
    {
        for (std::size_t i = 0; i < grid.count(); ++i) {
            const double d = sd(grid.position(grid.node(i)));
            solid[i] = d < 0.0 ? 1 : 0;
            surface.values[i] = static_cast<float>(d);
        }
        map = std::make_unique<OccupancyMap>(grid, solid);
    }
    void displace(const std::function<Vec3(Vec3)>& field)
    {
        for (Element e = 0; e < grid.count(); ++e) {
            if (solid[e] != 0) {
                u[e] = Vec3f(field(grid.position(grid.node(e))));
                map->displace(e, u[e]);
            }
        }
    }
    Body body() const { return {grid, solid, u, *map, surface}; }

    volume::NodeGrid grid;
    std::vector<std::uint8_t> solid;
    std::vector<Vec3f> u;
    volume::DistanceField surface;
    std::unique_ptr<OccupancyMap> map;
};

double slab(Vec3 p)
{
    return 8.3 - p.z;  // tissue above z = 8.3
}

std::set<Element> elementsWithin(const Solid& s, const Capsule& tool, double reach)
{
    std::set<Element> found;
    for (Element e = 0; e < s.grid.count(); ++e) {
        if (s.solid[e] == 0) {
            continue;
        }
        const Vec3 p = s.body().position(e);
        const Vec3 along = tool.b - tool.a;
        const double t = glm::clamp(glm::dot(p - tool.a, along) / std::max(1e-300, glm::dot(along, along)), 0.0, 1.0);
        if (glm::distance(p, tool.a + t * along) < reach) {
            found.insert(e);
        }
    }
    return found;
}

// However the elements are displaced, a query finds those that a look at all of them finds: scattered ones, and those under
// a smooth dent; a tool 3 elements across, a needle, and tools of any size, some beyond the map.
TEST(OccupancyMap, FindsWhatExhaustiveSearchFindsAfterRandomDisplacements)
{
    Solid s(20, slab);
    std::mt19937 random(3);
    std::uniform_real_distribution<double> shift(-3.5, 3.5), place(-2.0, 22.0), radius(0.3, 4.0);
    const auto anywhere = [&] { return Vec3(place(random), place(random), place(random)); };
    auto contacts = std::make_unique<ContactSet>();
    std::size_t touched = 0;
    for (int round = 0; round < 300; ++round) {
        const Vec3 middle = anywhere();
        const Vec3 push(shift(random), shift(random), shift(random));
        s.displace([&](Vec3 p) {
            const double square = glm::dot(p - middle, p - middle);
            return round % 3 == 0 ? Vec3(shift(random), shift(random), shift(random)) : std::exp(-square / 20.0) * push;
        });
        const Vec3 a = round % 2 == 0 ? middle : anywhere();
        const std::array<Capsule, 3> tools{
            {{a, a, 1.5}, {a, a + 3.0 * glm::normalize(push), 0.5}, {a, a + Vec3(push.y, push.z, 1.0), radius(random)}}};
        for (const Capsule& tool : tools) {
            touch(s.body(), tool, *contacts);
            const std::set<Element> found(contacts->elements.begin(), contacts->elements.begin() + contacts->count);
            ASSERT_EQ(found.size(), contacts->count);
            ASSERT_EQ(found, elementsWithin(s, tool, tool.radius + 0.5)) << round;
            touched += found.size();
        }
    }
    EXPECT_GT(touched, 10000U);
}

TEST(OccupancyMap, RewritesOnlyElementsThatChangeTheirCell)
{
    Solid s(12, slab);
    s.displace([](Vec3) { return Vec3(0.2, -0.3, 0.4); });
    EXPECT_EQ(s.map->rewrites(), 0U);
    s.displace([](Vec3 p) { return p.x == 5.0 ? Vec3(0.7, 0, 0) : Vec3(0.0); });
    const auto column =
        static_cast<std::uint64_t>(std::count_if(s.solid.begin(), s.solid.end(), [](auto v) { return v != 0; }) / 12);
    EXPECT_EQ(s.map->rewrites(), column);
}

// The elements visited by a query are those near the tool: their number does not grow with the grid.
TEST(OccupancyMap, QueryVisitsTheSameElementsInAnyGrid)
{
    const auto visited = [](int n) {
        const Solid s(n, slab);
        std::size_t count = 0;
        s.map->visit({6.5, 6.5, 7.0}, {12.5, 12.5, 12.0}, [&](Element) { ++count; });
        return count;
    };
    const auto small = visited(20);
    EXPECT_GT(small, 0U);
    EXPECT_EQ(visited(64), small);
}

// X + u(X) = p has the closed-form solution X = (I + G)^-1 (p - c) for u = G X + c.
TEST(RestPoint, InvertsAnAffineDisplacement)
{
    Solid s(24, [](Vec3 p) { return glm::distance(p, Vec3(11.5)) - 9.0; });
    const Mat3 g(0.2, 0.1, 0.0, -0.15, 0.1, 0.05, 0.1, 0.0, -0.3);
    const Vec3 c(2.5, -1.0, 3.0);
    s.displace([&](Vec3 x) { return g * x + c - g * Vec3(11.5); });
    std::mt19937 random(5);
    std::uniform_real_distribution<double> place(-4.0, 4.0);
    for (int i = 0; i < 200; ++i) {
        const Vec3 x = Vec3(11.5) + Vec3(place(random), place(random), place(random));
        const Vec3 p = x + g * (x - Vec3(11.5)) + c;
        ASSERT_LT(glm::distance(restPoint(s.body(), p), x), 0.03);
    }
}

// Of random places in the tissue: how far their answers are off, and from where they are seen [elements].
struct LookUp {
    double servo = 0, exact = 0, residual = 0;
};

LookUp lookUp(const std::function<Vec3(Vec3)>& field)
{
    const Vec3 middle(23.5, 23.5, 18.5);
    Solid s(48, [&](Vec3 p) {
        const Vec3 out = glm::abs(p - middle) - Vec3(20, 20, 15);
        return std::max({out.x, out.y, out.z});
    });
    s.displace(field);
    std::mt19937 random(5);
    std::uniform_real_distribution<double> across(5, 42), up(5, 33);
    LookUp most;
    for (int i = 0; i < 20000; ++i) {
        const double a = across(random), b = across(random), c = up(random);
        const Vec3 x(a, b, c), p = x + displacementAt(s.body(), x), exact = exactRestPoint(s.body(), p);
        most.servo = std::max(most.servo, glm::distance(restPoint(s.body(), p), x));
        most.exact = std::max(most.exact, glm::distance(exact, x));
        most.residual = std::max(most.residual, glm::distance(exact + displacementAt(s.body(), exact), p));
    }
    return most;
}

// The skin pressed in by `depth` over a width of `wide` [elements].
std::function<Vec3(Vec3)> dimple(double depth, double wide)
{
    return [=](Vec3 p) {
        const double r = std::hypot(p.x - 23.3, p.y - 23.7) / wide;
        return Vec3(0, 0, -depth * std::exp(-r * r) * std::exp((p.z - 33) / (1.5 * wide)));
    };
}

// Six steps find a place to a quarter of an element, half a voxel of slices, in dimples as deep as wide; exports go on
// until the place is exact, in dimples twice as steep too.
TEST(RestPoint, OfADimpleIsWhatWasThere)
{
    for (const auto& [depth, wide] : {std::pair(2.0, 6.0), std::pair(4.0, 6.0), std::pair(6.0, 6.0)}) {
        const LookUp most = lookUp(dimple(depth, wide));
        EXPECT_LT(most.servo, 0.25) << depth << " " << wide;
        EXPECT_LT(most.exact, 0.005) << depth << " " << wide;
    }
    EXPECT_LT(lookUp(dimple(4, 3)).exact, 0.005);
    EXPECT_LT(lookUp(dimple(6, 3)).residual, 0.05);
}

// A needle that takes the elements at its shaft with it, by more than they are apart.
TEST(RestPoint, AroundADraggedNeedleIsSeenWhereItIs)
{
    for (const double drag : {1.0, 2.0, 4.0}) {
        const LookUp most = lookUp([&](Vec3 p) {
            const double r = std::hypot(p.x - 23.3, p.y - 23.7);
            return r < 3 && p.z > 12 ? Vec3(0, 0, -drag * (1 - r / 3)) : Vec3(0);
        });
        EXPECT_LT(most.residual, 0.05) << drag;
    }
}

// The elements of a row share a division: whatever the order, the positions are those of the grid, to the bit.
TEST(RestPositions, AreThoseOfTheGridInAnyOrder)
{
    const volume::NodeGrid grid{{7, 5, 9}, {0.1, -0.2, 0.3}, 0.7};
    const Solid s(2, slab);
    const Body body{grid, s.solid, s.u, *s.map, s.surface};
    RestPositions restPosition(grid);
    std::mt19937 random(9);
    for (int i = 0; i < 2000; ++i) {
        const auto e = static_cast<Element>(i < 400 ? i : random()) % static_cast<Element>(grid.count());
        ASSERT_EQ(restPosition(e), body.restPosition(e)) << e;
    }
}

TEST(DistanceDifference, IsThatOfSixDistancesToTheBit)
{
    Solid s(20, [](Vec3 p) { return glm::distance(p, Vec3(9.5)) - 7.0; });
    s.displace([](Vec3 p) { return 2.0 * std::exp(-glm::dot(p - 6.0, p - 6.0) / 30.0) * Vec3(0.3, 0.5, -1.0); });
    std::mt19937 random(6);
    std::uniform_real_distribution<double> place(0.0, 19.0), step(0.2, 2.0);
    for (int i = 0; i < 500; ++i) {
        const Vec3 p(place(random), place(random), place(random));
        const double h = step(random);
        const Vec3 d = distanceDifference(s.body(), p, h);
        for (int axis = 0; axis < 3; ++axis) {
            Vec3 e(0.0);
            e[axis] = h;
            ASSERT_EQ(d[axis], distance(s.body(), p + e) - distance(s.body(), p - e)) << i;
        }
    }
}

TEST(Touch, SphereOnAFlatSurfaceHasTheDepthOfThePlane)
{
    const Solid s(20, slab);
    auto contacts = std::make_unique<ContactSet>();
    for (const double depth : {-0.5, 0.1, 0.7, 1.9}) {
        const Vec3 centre(9.3, 10.6, 8.3 - 2.0 + depth);
        touch(s.body(), {centre, centre, 2.0}, *contacts);
        EXPECT_NEAR(contacts->depth, depth, 1e-5);
    }
}

// The surface that was pushed away by 3 elements is found where it is now, not where it was.
TEST(Touch, FollowsTheDeformedSurface)
{
    Solid s(24, slab);
    s.displace([](Vec3) { return Vec3(0, 0, 3.0); });
    auto contacts = std::make_unique<ContactSet>();
    const Vec3 before(11.2, 11.9, 9.0), after(11.2, 11.9, 12.0);
    touch(s.body(), {before, before, 1.0}, *contacts);
    EXPECT_EQ(contacts->count, 0U);
    touch(s.body(), {after, after, 1.0}, *contacts);
    EXPECT_NEAR(contacts->depth, 1.7, 0.1);
}

// A rotation of the body keeps distances: the depth under the turned plane is that of the plane, once the tool has come
// within half an element of displaced ones.
TEST(Touch, DepthUnderARotatedSurfaceIsThatOfThePlane)
{
    constexpr double angle = 0.2, radius = 1.5;
    Solid s(24, slab);
    const Vec3 middle(11.5, 11.5, 8.3);
    const Mat3 turn(std::cos(angle), 0, -std::sin(angle), 0, 1, 0, std::sin(angle), 0, std::cos(angle));
    s.displace([&](Vec3 p) { return turn * (p - middle) - (p - middle); });
    auto contacts = std::make_unique<ContactSet>();
    for (const double depth : {0.5, 0.9, 1.3, 1.9}) {
        const Vec3 centre = middle + turn * Vec3(1.2, -0.7, depth - radius);
        touch(s.body(), {centre, centre, radius}, *contacts);
        EXPECT_NEAR(contacts->depth, depth, 0.03) << depth;
    }
}

TEST(Touch, CapsuleTouchesWithItsLowestPoint)
{
    const Solid s(20, slab);
    auto contacts = std::make_unique<ContactSet>();
    const Capsule tool{{5, 5, 3.0}, {12, 9, 8.0}, 0.9};
    touch(s.body(), tool, *contacts);
    EXPECT_NEAR(contacts->depth, 0.6, 1e-5);
}

// A stab through a plate of one element stops at it at any speed, up to a thousand times the plate's thickness per tick.
TEST(Sweep, CannotTunnelThroughAPlateOfOneElement)
{
    const auto plate = [](Vec3 p) { return std::abs(p.z - 12.0) - 0.5; };
    const Solid s(25, plate);
    for (const double speed : {0.3, 1.0, 7.7, 23.0, 100.0}) {
        for (double start = 0.0; start < 1.0; start += 0.13) {
            const Vec3 from(12.2, 11.8, 10.0 + start - 0.05), to = from + Vec3(0, 0, speed);
            const auto result = sweep(s.body(), {from, from, 0.1}, {to, to, 0.1});
            const double reach = from.z + speed + 0.1;
            EXPECT_EQ(result.hit, reach >= 11.5) << speed << ' ' << start;
            if (result.hit) {
                EXPECT_LT(from.z + result.fraction * speed, 12.2);
            }
        }
    }
}

// Another tool has pressed the skin in: a needle that comes down into the dent, in steps of a fiftieth of an element,
// touches it where it is now, and not in the air where it was. So it does on its slopes, and beside it where the skin
// bulges.
TEST(Sweep, MeetsTheSkinOfADentWhereItIsNow)
{
    for (const double deep : {0.7, 1.5, 3.0, 6.0}) {
        Solid s(40, [](Vec3 p) { return p.z - 30.3; });
        const auto field = [&](Vec3 p) {
            const double r = std::hypot(p.x - 19.5, p.y - 19.5) / 8.0;
            return Vec3(
                0, 0,
                deep * (0.3 * std::exp(-(r - 1.8) * (r - 1.8) * 4.0) - std::exp(-r * r)) * std::exp((p.z - 30.3) / 12.0));
        };
        s.displace(field);
        for (const double beside : {0.0, 2.2, 4.4, 7.1, 14.6}) {
            const double x = 19.5 + beside, y = 19.8;
            const double skin = 30.3 + field({x, y, 30.3}).z;
            Vec3 last(x, y, 35.0);
            double touched = 0.0;
            for (double z = 35.0; z > 15.0 && touched == 0.0; z -= 0.02) {
                const Vec3 now(x, y, z);
                touched = sweep(s.body(), {last, last, 0.0}, {now, now, 0.0}).hit ? z : 0.0;
                last = now;
            }
            EXPECT_NEAR(touched, skin, 0.25) << deep << " elements deep, " << beside << " beside its middle";
        }
    }
}

// A jump too long for the work allowed ends short of its goal instead of passing through what lies behind.
TEST(Sweep, EndsWhereItsWorkEnds)
{
    // Everywhere so near to tissue that only the shortest step is safe, a quarter of an element.
    const Solid s(140, [](Vec3) { return 0.01; });
    const Vec3 from(8, 8, 1), to(8, 8, 138);
    const auto result = sweep(s.body(), {from, from, 0.0}, {to, to, 0.0});
    EXPECT_TRUE(result.hit);
    EXPECT_NEAR(result.fraction * 137.0, 0.25 * (sweepSteps - 1), 1e-9);
}

TEST(Queries, AllocateNothing)
{
    Solid s(20, slab);
    s.displace([](Vec3 p) { return Vec3(0.1 * p.x, 0, 1.0); });
    auto contacts = std::make_unique<ContactSet>();
    const Capsule from{{9, 9, 5}, {9, 9, 6}, 1.0}, to{{9, 9, 9}, {9, 9, 10}, 1.0};
    const auto count = tests::allocationsIn([&] {
        touch(s.body(), to, *contacts);
        sweep(s.body(), from, to);
    });
    EXPECT_EQ(count, 0U);
    EXPECT_GT(contacts->count, 0U);
}

}  // namespace
}  // namespace palpate::occupancy
