#include "elastic_bodies.h"

#include <chainmail/rod.h>

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace palpate::chainmail {
namespace {

constexpr double rodTissue = 3e3, rodPoisson = 0.49, shearModulus = rodTissue / (2.0 * (1.0 + rodPoisson));  // [Pa]
constexpr double side = 192e-3;                                                                              // of a box [m]
const Vec3 boxMiddle(0.5 * side);

// A box of tissue that is fixed all around.
const ElasticBody& box(int cells)
{
    static std::vector<std::pair<int, ElasticBody>> boxes;
    for (const auto& [count, body] : boxes) {
        if (count == cells) {
            return body;
        }
    }
    const auto shell = tests::shell(cells, 1, side / cells, rodTissue, rodPoisson, 4);
    return boxes.emplace_back(cells, tests::bodyOf(shell)).second;
}

struct Rod {
    Vec3 middle, axis;
    double radius = 1.05e-3, length = 30e-3;  // [m]
};

// Its pieces, all moved by `way`.
std::vector<Tie> piecesOf(const Rod& rod, Vec3 way, int count = 8)
{
    std::vector<Tie> ties;
    for (double i = 0.5; i < count; ++i) {
        const Vec3 at = rod.middle + (i / count - 0.5) * rod.length * rod.axis;
        ties.push_back({at, way, rod.axis, 0.0, 0.0, {rod.radius, rod.length / count, rod.length}, rod.axis});
    }
    return ties;
}

// Force over displacement, both along `way` [N/m].
double stiffness(const ElasticBody& body, const Rod& rod, Vec3 way, Vec3 focus, int window = 21)
{
    const auto ties = piecesOf(rod, 1e-4 * way);
    Elastic elastic(body, {.window = window}, tests::focusAt(focus));
    tests::settle(elastic, {{}, ties, tests::focusAt(focus)}, 1e-4);
    Vec3 sum(0.0);
    for (std::size_t i = 0; i < ties.size(); ++i) {
        sum += elastic.tieForce(i);
    }
    return -glm::dot(sum, way) / 1e-4;
}

// A rod in tissue that is hardly compressible moves as one in a viscous fluid: Tirado and Garcia de la Torre,
// "Translational friction coefficients of rigid, symmetric top macromolecules", J. Chem. Phys. 71, 1979, for cylinders of 2
// to 30 diameters p. What the box gives way less is that of a force in the middle of a fixed ball of its volume, 9 / 4 R
// (Happel and Brenner, "Low Reynolds number hydrodynamics", 7-4).
double cylinder(const Rod& rod, bool along)
{
    const double p = rod.length / (2.0 * rod.radius), l = std::log(p);
    const double slender =
        along ? (l - 0.207 + 0.980 / p - 0.133 / (p * p)) / 2.0 : (l + 0.839 + 0.185 / p + 0.233 / (p * p)) / 4.0;
    const double ball = std::cbrt(0.75 / std::numbers::pi) * side;
    return shearModulus / (slender / (std::numbers::pi * rod.length) - 9.0 / 4.0 / (6.0 * std::numbers::pi * ball));
}

const std::vector<Vec3> axes{{0, 1, 0}, glm::normalize(Vec3(1, 2, 0)), glm::normalize(Vec3(1, 1, 1))};

Vec3 across(Vec3 axis)
{
    return glm::normalize(glm::cross(axis, Vec3(0.3, 0.0, 1.0)));
}

// Whatever its radius is in cells, which way it goes through the grid, and which way it is pulled.
TEST(Rod, MovesAsACylinderDoes)
{
    for (const double radius : {0.35e-3, 1.05e-3, 3e-3}) {
        for (const Vec3 axis : axes) {
            const Rod rod{boxMiddle, axis, radius};
            for (const bool along : {true, false}) {
                const double found = stiffness(box(96), rod, along ? axis : across(axis), boxMiddle);
                EXPECT_NEAR(found / cylinder(rod, along), 1.0, 0.05)
                    << "radius " << radius << ", along " << along << ", axis " << axis.x << " " << axis.y;
            }
        }
    }
}

// A point on springs gave way by up to half more, by its place in a cell.
TEST(Rod, DoesNotDependOnWhereItLiesInTheGrid)
{
    std::minstd_rand random(5);
    std::uniform_real_distribution<double> inCell(0.0, 2e-3);
    for (const bool along : {true, false}) {
        std::vector<double> found;
        for (int i = 0; i < 6; ++i) {
            const Vec3 at = boxMiddle + Vec3(inCell(random), inCell(random), inCell(random));
            found.push_back(stiffness(box(96), {at, axes[0]}, along ? axes[0] : Vec3(1, 0, 0), boxMiddle));
        }
        const auto [least, most] = std::ranges::minmax(found);
        EXPECT_LT(most / least, 1.05) << along;
    }
}

// Cells of 1.5 to 4 mm, and windows of which only a coarser one holds the rod, or the finest a part of it.
TEST(Rod, IsHeldAsStifflyByCoarseCells)
{
    for (const bool along : {true, false}) {
        const Rod rod{boxMiddle, axes[1]};
        const Vec3 way = along ? rod.axis : across(rod.axis);
        const double fine = stiffness(box(96), rod, way, boxMiddle);
        EXPECT_NEAR(stiffness(box(128), rod, way, boxMiddle, 27) / fine, 1.0, 0.04) << along;
        EXPECT_NEAR(stiffness(box(48), rod, way, boxMiddle) / fine, 1.0, 0.04) << along;
        for (const double aside : {12e-3, 24e-3, 40e-3}) {
            EXPECT_NEAR(stiffness(box(96), rod, way, boxMiddle + Vec3(aside, 0.0, 0.0), 13) / fine, 1.0, 0.06)
                << along << ", " << aside;
        }
        EXPECT_NEAR(stiffness(box(96), rod, way, boxMiddle + 15e-3 * rod.axis, 13) / fine, 1.0, 0.06) << along;
    }
}

// Springs once took the tissue of a piece's middle for all of the piece: a rod of 5 mm whose last 2 mm lie in bone was
// 8000 times looser than one of 2 mm.
TEST(Rod, HoldsInEachTissueAsFirmlyAsThatSays)
{
    const double h = 2e-3;
    const auto layered = [h](double stiff, bool fixed) {
        tests::ElasticBlock block = tests::heldBlock({24, 24, 24}, h, rodTissue, 0.45);
        block.material = [=](Index3 c) {
            return tests::tissue(c.y < 14 ? rodTissue : stiff, 0.45, fixed ? c.y >= 14 : c.y == 23);
        };
        return tests::bodyOf(block);
    };
    const auto rodTo = [](double tip, double length) {
        return Rod{{24e-3, tip - 0.5 * length, 25e-3}, {0, 1, 0}, 1.05e-3, length};
    };
    const auto found = [](const ElasticBody& body, const Rod& rod, Vec3 way, int pieces, int window = 63) {
        const auto ties = piecesOf(rod, 1e-4 * way, pieces);
        Elastic elastic(body, {.window = window}, tests::focusAt(rod.middle));
        tests::settle(elastic, {{}, ties, tests::focusAt(rod.middle)}, 1e-4);
        Vec3 sum(0.0);
        for (std::size_t i = 0; i < ties.size(); ++i) {
            sum += elastic.tieForce(i);
        }
        return -glm::dot(sum, way);
    };
    const double boundary = 28e-3;
    const ElasticBody onBone = layered(1e9, true), onTumour = layered(10.0 * rodTissue, false);
    for (const Vec3 way : {Vec3(1, 0, 0), Vec3(0, 1, 0)}) {
        const double inBone = found(onBone, rodTo(boundary + 2e-3, 2e-3), way, 1);
        for (const double length : {3e-3, 4e-3, 5e-3, 6.5e-3, 9e-3, 13e-3, 23e-3}) {
            for (const int window : {63, 9}) {
                const auto pieces = static_cast<int>(piecesOfRod(length));
                const double all = found(onBone, rodTo(boundary + 2e-3, length), way, pieces, window);
                EXPECT_GT(all, 0.9 * inBone) << length << ", along " << way.y << ", window " << window;
                EXPECT_LT(all, 1.1 * inBone) << length << ", along " << way.y << ", window " << window;
            }
        }
        // However it is divided into pieces.
        const Rod through = rodTo(boundary + 5e-3, 13e-3);
        const double once = found(onTumour, through, way, 1);
        for (const int pieces : {2, 3, 4, 6}) {
            EXPECT_NEAR(found(onTumour, through, way, pieces) / once, 1.0, 0.03) << pieces << ", along " << way.y;
        }
    }
}

// What a ring lacks are logarithms and what the ends do: of two thin rods of one length the compliances differ by
// ln(a2 / a1) / (2 pi mu l), a long one's ring is short of its own by as much as its radius says.
TEST(Rod, SpringsAreWhatTheRingLacks)
{
    const double h = 2e-3, length = 4e-3;
    const auto ring = [&](double radius) { return ringOf({radius, length, 1.0}, shearModulus, h); };
    const RodRing thin = ring(0.5e-3), thick = ring(1e-3);
    EXPECT_EQ(thin.radius, thick.radius);
    const double line = 1.0 / (2.0 * std::numbers::pi * shearModulus * length);
    EXPECT_NEAR(1.0 / thin.along - 1.0 / thick.along, std::log(2.0) * line, 2e-3 * line);
    EXPECT_NEAR(1.0 / thick.along, std::log(std::hypot(thick.radius, 0.5 * h) / 1e-3) * line, 2e-3 * line);
    // Across with nu = 0.45.
    EXPECT_NEAR(thin.across / thin.along, 4.0 * 0.55 / 1.2, 5e-3);
    const RodRing wide = ring(10e-3);
    EXPECT_GT(wide.radius, 10e-3);
    EXPECT_GE(wide.points, 32.0);
    EXPECT_LE(2.0 * ringOf({1e-3, 1e-3, 1.0}, shearModulus, h).points, thick.points);
    // As short as thick: still held.
    const RodRing stub = ringOf({1e-3, 0.1e-3, 0.1e-3}, shearModulus, h);
    EXPECT_TRUE(std::isfinite(stub.along) && stub.along > 0.0 && std::isfinite(stub.across) && stub.across > 0.0);
}

// All points of a rod that has turned keep their distances, and its axis goes where it shall.
TEST(Rod, CarriesItsPointsAsARigidBody)
{
    std::minstd_rand random(3);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    const auto any = [&] { return Vec3(unit(random), unit(random), unit(random)); };
    for (int i = 0; i < 50; ++i) {
        const Tie tie{any(), any(), glm::normalize(any()), 0.0, 0.0, {1e-3, 4e-3, 4e-3}, glm::normalize(any())};
        const auto now = [&](Vec3 at) { return at + tie.pulled(at); };
        const Vec3 a = any(), b = any();
        EXPECT_NEAR(glm::distance(now(a), now(b)), glm::distance(a, b), 1e-9);
        EXPECT_LT(glm::distance(now(tie.rest), tie.rest + tie.u), 1e-12);
        EXPECT_LT(glm::distance(now(tie.rest + tie.restAxis), tie.rest + tie.u + tie.axis), 1e-9);
    }
    const Tie back{Vec3(0.0), Vec3(1.0), Vec3(0, 1, 0), 0.0, 0.0, {1e-3, 4e-3, 4e-3}, Vec3(0, -1, 0)};
    EXPECT_EQ(back.pulled(Vec3(1, 0, 0)), Vec3(1.0));
    const Tie point{Vec3(0.0), Vec3(1.0), Vec3(0, 1, 0), 1.0, 1.0};
    EXPECT_EQ(point.pulled(Vec3(3.0)), Vec3(1.0));
}

// The second call's increment is the first one's: where it leads the linear answer balances, the true one does not.
TEST(Rod, ASolutionIsOneAlsoWhereTheIncrementIsThatOfTheCallBefore)
{
    const ElasticBody block = tests::bodyOf(tests::heldBlock({24, 16, 24}, 2e-3, rodTissue, 0.45));
    const Rod rod{{24e-3, 8e-3, 24e-3}, {0, 1, 0}, 1e-3, 12e-3};
    const auto forceAt = [&](std::vector<double> ways) {
        Elastic elastic(block, {.window = 63, .law = volume::NeoHookean{}}, tests::focusAt(rod.middle));
        Vec3 sum(0.0);
        for (const double way : ways) {
            const auto ties = piecesOf(rod, Vec3(0.0, way, 0.0), 3);
            elastic.relax({{}, ties, tests::focusAt(rod.middle)}, 300, 1e-5);
            sum = elastic.tieForce(0) + elastic.tieForce(1) + elastic.tieForce(2);
        }
        return glm::length(sum);
    };
    const double once = forceAt({4e-3});
    EXPECT_NEAR(forceAt({2e-3, 4e-3}), once, 1e-3 * once);
}

}  // namespace
}  // namespace palpate::chainmail
