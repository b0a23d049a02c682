#include "blocks.h"
#include "elastic_bodies.h"

#include <tests/allocations.h>

#include <chainmail/level.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <random>
#include <vector>

namespace palpate::chainmail {
namespace {

constexpr double levelSpacing = 2e-3;
constexpr double levelRadius = 5e-3;  // of the ball that presses
const Vec3 size = levelSpacing * Vec3(26, 15, 22);
const Vec3 levelTop(0.5 * size.x, 0.0, 0.5 * size.z);

// A homogeneous block of tissue, its far side held, as a session has it: lattice, elastic body and surface on one grid. A
// cut is half a cell wide.
struct Bench {
    explicit Bench(bool isCut = false)
        : grid{Index3(30, 19, 26), Vec3(-1.5 * levelSpacing), levelSpacing},
          surface(tests::distanceOn(grid, [](Vec3 p) { return tests::boxDistance(p, Vec3(0.0), size); })),
          body(bodyOn(grid, surface, isCut)),
          lattice(grid, rows(grid), tests::tableOf({})),
          shape(lattice)
    {
    }

    static constexpr std::uint8_t lowHalf = 0x55;  // of a cell's octants, along x

    static bool inside(Vec3 p) { return tests::boxDistance(p, Vec3(0.0), size) < 0.0; }
    static bool held(Vec3 p) { return p.y > size.y - levelSpacing; }
    static std::vector<std::uint8_t> rows(const volume::NodeGrid& grid)
    {
        std::vector<std::uint8_t> rows(grid.count(), 0);
        for (std::size_t i = 0; i < rows.size(); ++i) {
            const Vec3 p = grid.position(grid.node(i));
            rows[i] = !inside(p) ? 0 : held(p) ? 3 : 1;
        }
        return rows;
    }
    static ElasticBody bodyOn(const volume::NodeGrid& grid, const volume::DistanceField& surface, bool isCut)
    {
        std::vector<volume::CellMaterial> materials(grid.count());
        for (std::size_t i = 0; i < materials.size(); ++i) {
            const Vec3 p = grid.position(grid.node(i));
            materials[i] = inside(p) ? tests::tissue(5e3, 0.45, held(p)) : volume::CellMaterial{};
            const bool isBesideCut = isCut && grid.node(i).x == 8 && !held(p);
            materials[i].octants = isBesideCut ? lowHalf : std::uint8_t{0xFF};
        }
        return elasticBody(grid, std::move(materials), surface, 0.49);
    }

    volume::NodeGrid grid;
    volume::DistanceField surface;
    ElasticBody body;
    Lattice lattice;
    DisplacedLattice shape;
};

ElasticOptions smallWindows()
{
    ElasticOptions options;
    options.window = 9;
    return options;
}

Grip away()
{
    Grip grip;
    grip.proxy = grip.position = levelTop - Vec3(0.0, 50e-3, 0.0);
    return grip;
}

// A ball that would touch the surface with its centre at `proxy`, at `position`.
Grip pressed(Vec3 proxy, Vec3 position)
{
    Grip grip = away();
    grip.kind = Grip::Kind::press;
    grip.shape = {position, position, levelRadius, levelRadius};
    grip.proxy = proxy;
    grip.position = position;
    grip.radius = levelRadius;
    return grip;
}

Grip pressedBy(double depth, Vec3 aside = Vec3(0.0))
{
    const Vec3 proxy = levelTop + aside - Vec3(0.0, levelRadius, 0.0);
    return pressed(proxy, proxy + Vec3(0.0, depth, 0.0));
}

Grip held(Vec3 rest, Vec3 pushed, bool inside)
{
    Grip grip = away();
    grip.kind = Grip::Kind::point;
    grip.proxy = rest;
    grip.position = rest + pushed;
    grip.radius = 1e-3;
    grip.inside = inside;
    grip.entry = Vec3(rest.x, 0.0, rest.z);
    return grip;
}

// Smallest of the eight corners' determinants of the cell above node n, in volumes at rest; 1 for a cell with a corner
// that is no node.
double worstCorner(const DisplacedLattice& shape, Node n)
{
    const Lattice& lattice = shape.lattice();
    std::array<Vec3, 8> at{};
    for (std::size_t c = 0; c < 8; ++c) {
        Node corner = n;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            corner = (c >> axis & 1) != 0 ? lattice.beside(corner, static_cast<int>(2 * axis + 1)) : corner;
        }
        if (!lattice.isNode(corner)) {
            return 1.0;
        }
        at[c] = Vec3(c & 1, c >> 1 & 1, c >> 2) + Vec3(shape.u()[corner]) / lattice.grid.spacing;
    }
    double worst = 1.0;
    for (std::size_t c = 0; c < 8; ++c) {
        std::array<Vec3, 3> edge;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const std::size_t low = c & ~(std::size_t{1} << axis);
            edge[axis] = at[low | std::size_t{1} << axis] - at[low];
        }
        worst = std::min(worst, glm::dot(edge[0], glm::cross(edge[1], edge[2])));
    }
    return worst;
}

// The same over the whole lattice; nothing when a displacement is not finite.
std::optional<double> worstCorner(const DisplacedLattice& shape)
{
    double worst = 1.0;
    for (Node n = 0; n < shape.u().size(); ++n) {
        const Vec3f u = shape.u()[n];
        if (!std::isfinite(u.x + u.y + u.z)) {
            return std::nullopt;
        }
        worst = shape.lattice().isNode(n) ? std::min(worst, worstCorner(shape, n)) : worst;
    }
    return worst;
}

// A hand that wants to turn tissue inside out: it jumps, pushes 30 mm deep, drags aside, takes hold of points inside and
// at the surface, and lets go.
class WildHand {
public:
    Grip next()
    {
        const Vec3 jump = 2.0 * Vec3(unit(), unit(), unit()) - 1.0;
        switch (random_() % 8) {
            case 0:
                grip_ = away();
                break;
            case 1:  // somewhere else, deep at once
                grip_ = pressed(onTop(), Vec3(0.0));
                grip_.position = grip_.proxy + Vec3(3e-3 * jump.x, 30e-3 * unit(), 3e-3 * jump.z);
                break;
            case 2:
                grip_ = held(0.98 * size * Vec3(unit(), unit(), unit()) + 0.01 * size, 30e-3 * jump, true);
                break;
            case 3:
                grip_ = held(onTop() + Vec3(0.0, levelRadius, 0.0), 15e-3 * jump + Vec3(0.0, 15e-3, 0.0), false);
                break;
            case 4:  // a jump
                grip_.position += 20e-3 * jump;
                break;
            case 5:  // aside
                grip_.position += 4e-3 * Vec3(jump.x, 0.0, jump.z);
                break;
            default:
                grip_.position += 1e-3 * jump;
        }
        grip_.shape = {grip_.position, grip_.position, levelRadius, levelRadius};
        return grip_;
    }
    int calls() { return 1 + static_cast<int>(random_() % 4); }

private:
    double unit() { return value_(random_); }
    Vec3 onTop() { return {size.x * unit(), -levelRadius, size.z * unit()}; }

    Grip grip_ = away();
    std::minstd_rand random_{17};
    std::uniform_real_distribution<double> value_{0.0, 1.0};
};

// Whatever the hand does, what collision and viewer see is tissue: finite, and no cell turned over at any corner.
TEST(ElasticLevel, NoCellOfTheLatticeEverTurnsOver)
{
    Bench bench;
    ElasticLevel level(bench.shape, bench.body, bench.surface, smallWindows(), levelTop);
    WildHand hand;
    double furthest = 0.0;
    for (int i = 0; i < 2000; ++i) {
        const Grip grip = hand.next();
        for (int call = hand.calls(); call > 0; --call) {
            level.deform(grip);
            const auto worst = worstCorner(bench.shape);
            ASSERT_TRUE(worst) << "grip " << i;
            ASSERT_GT(*worst, 0.0) << "grip " << i << ", " << call << " calls before the next";
        }
        for (const Node n : bench.shape.moved()) {
            furthest = std::max(furthest, static_cast<double>(glm::length(bench.shape.u()[n])));
        }
    }
    // Hostile it was: tissue went further than a cell is wide.
    EXPECT_GT(furthest, 2.0 * levelSpacing);
}

// Calls after a release until every node is at rest: what it takes to look at every node once, 512 per call, is half of
// what is allowed; beyond, gives that limit + 1.
int callsToRest(Bench& bench, ElasticLevel& level)
{
    const int most = 2 * static_cast<int>(bench.shape.u().size() / 512);
    int calls = 0;
    while (!bench.shape.moved().empty() && calls <= most) {
        EXPECT_FALSE(level.deform(away()).force);
        ++calls;
    }
    EXPECT_LE(calls, most) << bench.shape.moved().size() << " nodes are not at rest";
    return calls;
}

bool allAtRest(const DisplacedLattice& shape)
{
    return std::ranges::all_of(shape.u(), [](Vec3f u) { return u == Vec3f(0.0F); });
}

TEST(ElasticLevel, EveryNodeIsAtRestSoonAfterRelease)
{
    Bench bench;
    ElasticLevel level(bench.shape, bench.body, bench.surface, smallWindows(), levelTop);
    for (const double aside : {0.0, 8e-3, -15e-3}) {
        for (int i = 1; i <= 60; ++i) {
            level.deform(pressedBy(std::min(4e-3, 0.2e-3 * i), Vec3(aside * i / 60.0, 0.0, 0.0)));
        }
        EXPECT_GT(bench.shape.moved().size(), 500U);
        EXPECT_GT(callsToRest(bench, level), 1);
        EXPECT_TRUE(allAtRest(bench.shape));
    }
}

// Nodes that only go back one by one can stand in each other's way for good.
TEST(ElasticLevel, EveryNodeIsAtRestSoonAfterWhateverTheHandDid)
{
    Bench bench;
    ElasticLevel level(bench.shape, bench.body, bench.surface, smallWindows(), levelTop);
    WildHand hand;
    int releases = 0;
    for (int i = 0; i < 600 && !HasFailure(); ++i) {
        const Grip grip = hand.next();
        for (int call = hand.calls(); call > 0; --call) {
            level.deform(grip);
        }
        if (i % 10 == 0) {
            releases += callsToRest(bench, level) > 0 ? 1 : 0;
            ASSERT_TRUE(allAtRest(bench.shape)) << "grip " << i;
        }
    }
    EXPECT_GT(releases, 30);
}

// A tool that stands still: the lattice comes to the windows' displacement at the middles of its cells, but for what is
// under the 20 um that are cut. Of the finest three windows, which are those that the lattice shows.
class LatticeAndWindows : public testing::TestWithParam<bool> {};
TEST_P(LatticeAndWindows, LatticeComesToTheShapeOfTheWindows)
{
    Bench bench(GetParam());
    ElasticLevel level(bench.shape, bench.body, bench.surface, smallWindows(), levelTop);
    for (int i = 0; i < 20; ++i) {
        level.deform(pressedBy(0.2e-3 * i, Vec3(-1e-3 * i, 0.0, 0.0)));
    }
    const Grip last = pressedBy(4e-3, Vec3(-18e-3, 0.0, 0.0));
    for (int i = 0; i < 400; ++i) {
        level.deform(last);
    }
    std::array<int, 3> seen{};
    for (Node n = 0; n < bench.shape.u().size(); ++n) {
        if (!bench.lattice.isNode(n)) {
            continue;
        }
        const Vec3 rest = bench.grid.position(bench.grid.node(n));
        ContactSite site;
        locate(bench.body, level.elastic().stack().windows(), rest, site);
        if (site.level >= seen.size()) {
            continue;
        }
        const Vec3 shown(bench.shape.u()[n]);
        ASSERT_LT(glm::distance(shown, level.elastic().displacement(rest)), 21e-6)
            << "at " << rest.x << " " << rest.y << " " << rest.z << " m, window " << site.level;
        seen[site.level] += glm::length(shown) > 100e-6 ? 1 : 0;
    }
    EXPECT_GT(seen[0], 100);
    EXPECT_GT(seen[1], 20);
}
INSTANTIATE_TEST_SUITE_P(WholeAndCut, LatticeAndWindows, testing::Bool());

// Only a tool that presses has its force from the tissue's energy; away from the tissue there is none, at once.
TEST(ElasticLevel, ForceIsThereForAToolThatPressesAndGoneWithIt)
{
    Bench bench;
    ElasticLevel level(bench.shape, bench.body, bench.surface, smallWindows(), levelTop);
    Vec3 force(0.0);
    for (int i = 1; i <= 30; ++i) {
        const auto reaction = level.deform(pressedBy(0.1e-3 * i));
        ASSERT_TRUE(reaction.force);
        EXPECT_LE(reaction.force->y, force.y + 1e-9) << i;
        force = *reaction.force;
    }
    EXPECT_LT(force.y, -0.02);
    EXPECT_EQ(level.deform(pressedBy(-1e-3)).force, Vec3(0.0));
    EXPECT_TRUE(level.elastic().atRest());
    EXPECT_FALSE(level.deform(held(levelTop + Vec3(0.0, 2e-3, 0.0), Vec3(0.0, 2e-3, 0.0), true)).force);
    EXPECT_FALSE(level.deform(away()).force);
}

// A held point takes the tissue along, the same way as it goes: most of the way, as the tissue is softer than the hold.
TEST(ElasticLevel, PointThatIsHeldTakesTheTissueAlong)
{
    const Vec3 pushed(1e-3, 2e-3, -0.5e-3);
    for (const double deep : {0.0, 7e-3}) {
        Bench bench;
        ElasticLevel level(bench.shape, bench.body, bench.surface, smallWindows(), levelTop);
        // A node of the lattice at 7 mm; at the surface the hold is on the node just under it.
        const Vec3 rest(27e-3, deep, 23e-3);
        for (int i = 1; i <= 60; ++i) {
            level.deform(held(rest, std::min(1.0, i / 20.0) * pushed, deep > 0.0));
        }
        const Index3 node(glm::round((glm::max(rest, Vec3(1e-3)) - bench.grid.origin) / levelSpacing));
        const Vec3 u(bench.shape.u()[bench.grid.offset(node)]);
        const double fraction = glm::dot(u, pushed) / glm::dot(pushed, pushed);
        EXPECT_GT(fraction, 0.6) << deep;
        EXPECT_LT(fraction, 1.0) << deep;
        EXPECT_LT(glm::distance(u, fraction * pushed), 0.15 * glm::length(pushed)) << deep;
    }
}

// A tip that holds the tissue is followed every third call: the shape is that of a pose at most three calls old.
TEST(ElasticLevel, HeldPointIsFollowedByTurns)
{
    constexpr double step = 20e-6;  // of the tip in a call [m]
    const Vec3 rest(27e-3, 7e-3, 23e-3);
    Bench bench, inTurns;
    ElasticOptions always = smallWindows();
    always.heldPeriod = 1;
    ElasticLevel level(bench.shape, bench.body, bench.surface, always, levelTop);
    ElasticLevel byTurns(inTurns.shape, inTurns.body, inTurns.surface, smallWindows(), levelTop);
    const std::size_t node = bench.grid.offset(Index3(glm::round((rest - bench.grid.origin) / levelSpacing)));
    for (int i = 1; i <= 120; ++i) {
        const Grip grip = held(rest, Vec3(0.0, step * std::min(i, 90), 0.0), true);
        level.deform(grip);
        byTurns.deform(grip);
        EXPECT_LT(glm::distance(bench.shape.u()[node], inTurns.shape.u()[node]), 3.0 * step + 0.1 * step) << i;
    }
    EXPECT_LT(glm::distance(bench.shape.u()[node], inTurns.shape.u()[node]), 0.5 * step);
    // A tip that moves on once is seen in the next turn. After 31, 32 and 33 calls from one on, that is in 2, 1 and 3
    // calls.
    std::vector<int> waited;
    for (int move = 0; move <= 3; ++move) {
        for (int still = 0; still < 30 + move; ++still) {
            byTurns.deform(held(rest, Vec3(0.0, (90 + 10 * move - 10) * step, 0.0), true));
        }
        const Vec3 before = byTurns.elastic().displacement(rest);
        int calls = 0;
        while (calls < 3 && byTurns.elastic().displacement(rest) == before) {
            byTurns.deform(held(rest, Vec3(0.0, (90 + 10 * move) * step, 0.0), true));
            ++calls;
        }
        EXPECT_NE(byTurns.elastic().displacement(rest), before) << move;
        waited.push_back(calls);
    }
    EXPECT_EQ(std::vector(waited.begin() + 1, waited.end()), (std::vector{2, 1, 3}));
}

// A tip that is in tissue at rest takes over from another level, in a step down: the tissue is there after one call, and
// not at rest until the next turn.
TEST(ElasticLevel, TipThatTakesOverHasItsTissueAtOnce)
{
    const Vec3 rest(27e-3, 7e-3, 23e-3), pushed(0.5e-3, 2e-3, 0.0);
    Bench bench;
    ElasticLevel level(bench.shape, bench.body, bench.surface, smallWindows(), rest + Vec3(12e-3, 0.0, 0.0));
    level.deform(held(rest, pushed, true));
    const std::size_t node = bench.grid.offset(Index3(glm::round((rest - bench.grid.origin) / levelSpacing)));
    const Vec3 first(bench.shape.u()[node]);
    for (int i = 0; i < 60; ++i) {
        level.deform(held(rest, pushed, true));
    }
    EXPECT_LT(glm::distance(first, Vec3(bench.shape.u()[node])), 0.1 * glm::length(pushed));
    EXPECT_GT(glm::length(first), 0.5 * glm::length(pushed));
}

TEST(ElasticLevel, DeformTouchesNoHeap)
{
    Bench bench;
    ElasticLevel level(bench.shape, bench.body, bench.surface, smallWindows(), levelTop);
    WildHand hand;
    const auto calls = tests::heapCallsIn([&] {
        for (int i = 0; i < 300; ++i) {
            level.deform(hand.next());
        }
    });
    EXPECT_EQ(calls, 0U);
}

}  // namespace
}  // namespace palpate::chainmail
