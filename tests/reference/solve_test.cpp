#include <reference/box_mesh.h>
#include <reference/solve.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::reference {
namespace {

using testing::HasSubstr;

constexpr double side = 20e-3;     // of the cube [m]
constexpr double modulus = 3.0e3;  // [Pa]

std::vector<double> even(double low, double high, int cells)
{
    std::vector<double> ends;
    for (int i = 0; i <= cells; ++i) {
        ends.push_back(low + (high - low) * i / cells);
    }
    return ends;
}

// An eighth of a cube about the origin, or all that is over its base when `held`.
TetMesh cube(int cells, bool held)
{
    const std::vector<double> ends = even(0.0, side, cells);
    BoxMeshOptions options;
    if (held) {
        options.held = [](Vec3 p) { return p.z < 1e-9; };
    }
    return boxMesh(ends, ends, ends, options);
}

// Half a block, finer under the sphere, y = 0 its plane of symmetry, top at z = 0.
TetMesh halfBlock(double fine)
{
    std::vector<double> right = gradedCells(0.0, 3e-3, 10e-3, fine, 1.7);
    std::vector<double> x;
    for (std::size_t i = right.size(); i-- > 1;) {
        x.push_back(-right[i]);
    }
    x.insert(x.end(), right.begin(), right.end());
    BoxMeshOptions options;
    options.held = [](Vec3 p) { return p.z < -10e-3 + 1e-9; };
    return boxMesh(x, right, gradedDown(-10e-3, -1.5e-3, 0.0, fine, 1.7), options);
}

SolveOptions halved(Law law, Elements elements = Elements::p2)
{
    SolveOptions options;
    options.law = law;
    options.elements = elements;
    options.mirrored = {false, true, false};
    return options;
}

Patch pulledTop(double by)
{
    Patch patch;
    patch.in = [](Vec3 p) { return p.z > side - 1e-9; };
    patch.u = [by](Vec3) { return Vec3(0.0, 0.0, by); };
    patch.components = {false, false, true};
    return patch;
}

struct Kind {
    Law law;
    Elements elements;
};

class EveryKind : public testing::TestWithParam<Kind> {};

INSTANTIATE_TEST_SUITE_P(Solve, EveryKind,
                         testing::Values(Kind{SmallStrain{}, Elements::p2}, Kind{SmallStrain{}, Elements::p2p1},
                                         Kind{NeoHookean{}, Elements::p2}, Kind{NeoHookean{}, Elements::p2p1}),
                         [](const auto& kind) {
                             return std::string(volume::isSmall(kind.param.law) ? "Linear" : "NeoHookean") +
                                    (kind.param.elements == Elements::p2 ? "P2" : "P2P1");
                         });

// F = A E eps at small strain, whatever the law and the elements.
TEST_P(EveryKind, ABarPulledALittleFollowsHooke)
{
    SolveOptions options;
    options.law = GetParam().law;
    options.elements = GetParam().elements;
    options.mirrored = {true, true, true};
    const std::vector<Material> tissue{{modulus, 0.45, 0.0}};
    Solver solver(cube(2, false), tissue, options);
    const double strain = 1e-5;
    solver.prescribe(pulledTop(strain * side));

    const double force = modulus * strain * side * side;
    EXPECT_NEAR(solver.force().z, -force, 5e-5 * force);
    EXPECT_NEAR(solver.energy(), 0.5 * force * strain * side, 5e-5 * force * strain * side);
    const Vec3 at(0.7 * side, 0.2 * side, 0.9 * side);
    const Vec3 u = solver.displacement(std::vector<Vec3>{at}).front();
    EXPECT_NEAR(u.x, -0.45 * strain * at.x, 5e-5 * strain * side);
    EXPECT_NEAR(u.z, strain * at.z, 5e-5 * strain * side);
    for (const auto& s : solver.stress()) {
        EXPECT_NEAR(s[2], modulus * strain, 5e-5 * modulus * strain);
        EXPECT_NEAR(s[0], 0.0, 5e-5 * modulus * strain);
        EXPECT_NEAR(s[4], 0.0, 5e-5 * modulus * strain);
    }
}

// With stretches a along and q across, J = a q^2 and I = J^(-2/3) (a^2 + 2 q^2) - 3, the energy density is
//     W = mu/2 I + mu/4 b I^2 + K/2 (J - 1)^2   or   mu/2b (exp(b I) - 1) + K/2 (J - 1)^2,
// q makes it least, and the force is A dW/da.
double density(double a, double q, const Material& m, const Law& law)
{
    const double mu = m.youngsModulus / (2.0 * (1.0 + m.poisson));
    const double bulk = m.youngsModulus / (3.0 * (1.0 - 2.0 * m.poisson));
    const double j = a * q * q;
    const double i = std::pow(j, -2.0 / 3.0) * (a * a + 2.0 * q * q) - 3.0;
    const double b = m.stiffening;
    const double shape =
        law == Law(Exponential{}) && b != 0.0 ? 0.5 * mu / b * std::expm1(b * i) : 0.5 * mu * i + 0.25 * mu * b * i * i;
    return shape + 0.5 * bulk * (j - 1.0) * (j - 1.0);
}

double minDensity(double a, const Material& m, const Law& law)
{
    double low = 0.5, high = 1.5;
    for (int i = 0; i < 200; ++i) {
        const double one = low + (high - low) / 3.0;
        const double two = high - (high - low) / 3.0;
        const bool isLow = density(a, one, m, law) < density(a, two, m, law);
        (isLow ? high : low) = isLow ? two : one;
    }
    return density(a, 0.5 * (low + high), m, law);
}

TEST(Solve, ABarPulledToOneAndAHalfFollowsItsEnergy)
{
    using Case = std::pair<Law, double>;
    for (const auto& [law, stiffening] :
         {Case(NeoHookean{}, 0.0), Case(NeoHookean{}, 2.0), Case(Exponential{}, 0.0), Case(Exponential{}, 3.0)}) {
        for (const Elements elements : {Elements::p2, Elements::p2p1}) {
            const std::vector<Material> tissue{{modulus, 0.48, stiffening}};
            SolveOptions options;
            options.law = law;
            options.elements = elements;
            options.mirrored = {true, true, true};
            Solver solver(cube(1, false), tissue, options);
            solver.prescribe(pulledTop(0.5 * side));
            const double h = 1e-4;
            const double stress = (minDensity(1.5 + h, tissue[0], law) - minDensity(1.5 - h, tissue[0], law)) / (2.0 * h);
            EXPECT_NEAR(solver.force().z, -stress * side * side, 1e-5 * stress * side * side);
            EXPECT_NEAR(solver.energy(), minDensity(1.5, tissue[0], law) * side * side * side, 1e-6 * solver.energy());
        }
    }
}

// Any linear field is a solution, with two tissues as with one when they are the same.
TEST(Solve, ALinearFieldOnAllFacesIsTakenExactly)
{
    SolveOptions options;
    options.mirrored = {true, true, true};
    Solver solver(cube(2, false), std::vector<Material>{{modulus, 0.3, 0.0}}, options);
    const auto field = [](Vec3 p) { return Vec3(0.01 * p.x, -0.02 * p.y, 0.015 * p.z); };
    solver.prescribe({[](Vec3) { return true; }, field, {true, true, true}});
    // The last one lies outside: what the nearest tetrahedron says goes on.
    const std::vector<Vec3> points{{3e-3, 4e-3, 5e-3}, {11e-3, 9e-3, 17e-3}, {20.5e-3, 7e-3, 21e-3}};
    const std::vector<Vec3> u = solver.displacement(points);
    for (std::size_t i = 0; i < points.size(); ++i) {
        EXPECT_LT(glm::distance(u[i], field(points[i])), 1e-11);
    }
}

// Without friction all of the tool's work goes into the tissue: F = dE/d(depth).
TEST_P(EveryKind, TheSpheresForceIsTheEnergysSlope)
{
    Solver solver(halfBlock(1.5e-3), std::vector<Material>{{modulus, 0.45, 0.0}},
                  halved(GetParam().law, GetParam().elements));
    const double radius = 5e-3;
    const auto energyAt = [&](double depth) {
        solver.press({{0.0, 0.0, radius - depth}, radius});
        return solver.energy();
    };
    const double step = 4e-5;
    const double low = energyAt(2e-3 - step);
    const double middle = energyAt(2e-3);
    const double force = solver.force().z;
    const double high = energyAt(2e-3 + step);
    EXPECT_GT(middle, 0.0);
    EXPECT_NEAR(force, (high - low) / (2.0 * step), 3e-3 * force);
}

// Take a displacement that is 0 under a layer of bricks and 1 mm up over it: its work says that the mean of the stress in
// that layer, times the area, is the force. So what the sphere pushes with is what the base holds.
TEST(Solve, TheSpheresForceGoesThroughTheLowestLayer)
{
    for (const Elements elements : {Elements::p2, Elements::p2p1}) {
        const TetMesh mesh = halfBlock(1.5e-3);
        Solver solver(mesh, std::vector<Material>{{modulus, 0.45, 0.0}}, halved(SmallStrain{}, elements));
        solver.press({{1e-3, 0.0, 5e-3 - 2e-3}, 5e-3});
        double top = 1.0;  // of the lowest layer
        for (const Vec3& p : mesh.points) {
            top = p.z > -10e-3 + 1e-9 ? std::min(top, p.z) : top;
        }
        Vec3 carried(0.0);
        const auto stress = solver.stress();
        for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
            const auto& tet = mesh.tets[t];
            const Vec3 a = mesh.points[tet[0]];
            const double volume =
                glm::dot(glm::cross(mesh.points[tet[1]] - a, mesh.points[tet[2]] - a), mesh.points[tet[3]] - a) / 6.0;
            if (std::all_of(tet.begin(), tet.end(), [&](auto p) { return mesh.points[p].z < top + 1e-9; })) {
                carried -= volume / (top + 10e-3) * Vec3(stress[t][4], 0.0, stress[t][2]);
            }
        }
        EXPECT_NEAR(solver.force().z, carried.z, 1e-5 * carried.z);
        EXPECT_NEAR(solver.force().x, carried.x, 1e-5 * carried.z);
    }
}

// In the mean; a parabola of an element's size cannot follow the sphere everywhere.
TEST(Solve, TheSurfaceLiesOnTheSphere)
{
    Solver solver(halfBlock(1e-3), std::vector<Material>{{modulus, 0.45, 0.0}}, halved(NeoHookean{}));
    const RigidTool sphere{{0.0, 0.0, 5e-3 - 2e-3}, 5e-3};
    solver.press(sphere);
    std::vector<Vec3> rest;
    for (int i = 0; i <= 40; ++i) {
        rest.emplace_back(0.06e-3 * i, 0.03e-3 * i, 0.0);
    }
    const std::vector<Vec3> u = solver.displacement(rest);
    double mean = 0.0;
    int inside = 0;
    for (std::size_t i = 0; i < rest.size(); ++i) {
        const double gap = glm::distance(rest[i] + u[i], sphere.centre) - sphere.radius;
        EXPECT_GT(gap, -5e-3 * 2e-3);
        if (glm::length(rest[i]) < 1.5e-3) {
            mean += gap;
            ++inside;
        }
    }
    EXPECT_LT(std::abs(mean / inside), 2e-4 * 2e-3);
}

// Pressed in two steps or in one, dragged there and back: elastic tissue without friction does not remember.
TEST(Solve, TheWayDoesNotMatter)
{
    const std::vector<Material> tissue{{modulus, 0.45, 0.0}};
    const double radius = 5e-3;
    Solver straight(halfBlock(1.5e-3), tissue, halved(NeoHookean{}));
    straight.press({{0.5e-3, 0.0, radius - 1.5e-3}, radius});
    Solver around(halfBlock(1.5e-3), tissue, halved(NeoHookean{}));
    around.press({{-1e-3, 0.0, radius - 1e-3}, radius});
    around.press({{1.5e-3, 0.0, radius - 2e-3}, radius});
    around.press({{0.5e-3, 0.0, radius - 1.5e-3}, radius});
    EXPECT_LT(glm::distance(straight.force(), around.force()), 1e-3 * glm::length(straight.force()));
    EXPECT_NEAR(straight.energy(), around.energy(), 1e-3 * straight.energy());
}

// A quarter of a block, x = 0 and y = 0 its planes of symmetry, top at z = 0, deep enough for a sphere of 5 mm.
TetMesh deepBlock()
{
    const std::vector<double> across = gradedCells(0.0, 5e-3, 18e-3, 2.5e-3, 1.8);
    BoxMeshOptions options;
    options.held = [](Vec3 p) { return p.z < -20e-3 + 1e-9; };
    return boxMesh(across, across, gradedDown(-20e-3, -4e-3, 0.0, 2.5e-3, 1.8), options);
}

Solver deepSolver()
{
    SolveOptions options;
    options.law = NeoHookean{};
    options.mirrored = {true, true, false};
    return {deepBlock(), std::vector<Material>{{modulus, 0.4, 0.0}}, options};
}

// Radius of 5 mm, its foremost point so many radii under the surface.
RigidTool sphereAt(double radii)
{
    return {{0.0, 0.0, 5e-3 * (1.0 - radii)}, 5e-3};
}

// Tissue in front of a sphere never pulls it in, however deep: the force grows all the way, on the way out is what it was
// on the way in, and a sphere that is asked for under the surface at once has come in through it.
TEST(Solve, ASphereTwoRadiiDeepIsPushedOutAllTheWay)
{
    Solver solver = deepSolver();
    std::vector<double> in{0.0};
    for (const double radii : {0.7, 1.4, 2.1}) {
        solver.press(sphereAt(radii));
        in.push_back(solver.force().z);
        EXPECT_GT(in.back(), 1.3 * in[in.size() - 2]) << radii << " radii";
    }
    solver.press(sphereAt(0.7));
    EXPECT_NEAR(solver.force().z, in[1], 2e-3 * in[1]);
    Solver atOnce = deepSolver();
    atOnce.press(sphereAt(2.1));
    EXPECT_NEAR(atOnce.force().z, in.back(), 2e-3 * in.back());
}

// What touches it is a hemisphere.
TEST(Solve, ACapsuleEndOnIsASphereAsDeepAsItsRadius)
{
    const RigidTool sphere = sphereAt(0.8);
    Solver one = deepSolver();
    one.press(sphere);
    Solver other = deepSolver();
    other.press({sphere.centre, sphere.radius, Vec3(0.0, 0.0, 20e-3)});
    EXPECT_NEAR(other.force().z, one.force().z, 1e-6 * one.force().z);
}

// The work of the tool goes into the tissue, along the shaft as at its ends; and a longer tool meets more of it.
TEST(Solve, ALyingCapsulesForceIsTheEnergysSlope)
{
    const double radius = 4e-3, depth = 2e-3, step = 4e-5;
    const std::vector<Material> tissue{{modulus, 0.45, 0.0}};
    Solver solver(halfBlock(1.5e-3), tissue, halved(NeoHookean{}));
    const auto energyAt = [&](double d) {
        solver.press({{-3e-3, 0.0, radius - d}, radius, Vec3(6e-3, 0.0, 0.0)});
        return solver.energy();
    };
    const double low = energyAt(depth - step);
    energyAt(depth);
    const double force = solver.force().z;
    EXPECT_NEAR(force, (energyAt(depth + step) - low) / (2.0 * step), 3e-3 * force);
    Solver sphere(halfBlock(1.5e-3), tissue, halved(NeoHookean{}));
    sphere.press({{0.0, 0.0, radius - depth}, radius});
    EXPECT_GT(force, 1.3 * sphere.force().z);
}

// A sphere that has left the tissue leaves nothing behind.
TEST(Solve, ASphereThatHasLeftPushesNothing)
{
    Solver solver(halfBlock(2e-3), std::vector<Material>{{modulus, 0.45, 0.0}}, halved(SmallStrain{}));
    solver.press({{0.0, 0.0, 4e-3}, 5e-3});
    EXPECT_GT(solver.force().z, 0.005);
    solver.press({{0.0, 0.0, 5.5e-3}, 5e-3});
    EXPECT_EQ(glm::length(solver.force()), 0.0);
    EXPECT_LT(solver.energy(), 1e-12);
}

// Half a body with a plane of symmetry carries half the force of all of it.
TEST(Solve, MirroringHalvesTheForce)
{
    const std::vector<double> half = even(0.0, 12e-3, 4);
    const std::vector<double> whole = even(-12e-3, 12e-3, 8);
    const std::vector<double> z = even(-12e-3, 0.0, 4);
    BoxMeshOptions held;
    held.held = [](Vec3 p) { return p.z < -12e-3 + 1e-9; };
    const std::vector<Material> tissue{{modulus, 0.45, 0.0}};
    Solver all(boxMesh(whole, whole, z, held), tissue, {});
    Solver mirrored(boxMesh(whole, half, z, held), tissue, halved(SmallStrain{}));
    const RigidTool sphere{{0.0, 0.0, 10e-3 - 2e-3}, 10e-3};
    all.press(sphere);
    mirrored.press(sphere);
    // Diagonals of bricks are not symmetric.
    EXPECT_NEAR(2.0 * mirrored.force().z, all.force().z, 0.02 * all.force().z);
}

std::string messageOf(const std::function<void()>& call)
{
    try {
        call();
    } catch (const std::runtime_error& error) {
        return error.what();
    }
    return {};
}

TEST(Solve, WhatCannotBeSolvedIsRefused)
{
    const std::vector<Material> tissue{{modulus, 0.45, 0.0}};
    EXPECT_THAT(messageOf([&] { Solver(cube(1, false), tissue, {}); }), HasSubstr("no face is held"));
    EXPECT_THAT(messageOf([&] { Solver(TetMesh{}, tissue, {}); }), HasSubstr("no tetrahedra"));
    EXPECT_THAT(messageOf([&] {
                    Solver(cube(1, true), std::vector<Material>{{modulus, 0.5, 0.0}}, {});
                }),
                HasSubstr("Poisson's ratio 0.5"));
    EXPECT_THAT(messageOf([&] { Solver(cube(1, true), {}, {}); }), HasSubstr("tissue row 0 of a table of 0"));
    TetMesh two = cube(1, true);
    const auto count = static_cast<std::uint32_t>(two.points.size());
    for (std::uint32_t p = 0; p < count; ++p) {
        two.points.push_back(two.points[p] + Vec3(1.0));
    }
    for (std::size_t t = 0; t < 6; ++t) {
        two.tissue.push_back(0);
        two.tets.push_back(two.tets[t]);
        for (std::uint32_t& p : two.tets.back()) {
            p += count;
        }
    }
    EXPECT_THAT(messageOf([&] { Solver(two, tissue, {}); }), HasSubstr("6 of 12 tetrahedra are not connected"));
}

// A solver that gave up is where it was, and goes on from there.
TEST(Solve, APressThatFailsSaysHowFarItCame)
{
    SolveOptions options = halved(NeoHookean{});
    options.maxSteps = 1;
    Solver solver(halfBlock(2e-3), std::vector<Material>{{modulus, 0.45, 0.0}}, options);
    const double radius = 5e-3;
    EXPECT_THAT(messageOf([&] {
                    solver.press({{0.0, 0.0, radius - 4e-3}, radius});
                }),
                HasSubstr("does not converge at 1.000 mm of 4.000 mm"));
    solver.press({{0.0, 0.0, radius - 1.5e-3}, radius});
    EXPECT_GT(solver.force().z, 0.005);
}

}  // namespace
}  // namespace palpate::reference
