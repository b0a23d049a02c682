#include <chainmail/loaded_body.h>
#include <reference/box_mesh.h>
#include <reference/equilibrium.h>
#include <tests/chainmail/elastic_bodies.h>

#include <gtest/gtest.h>
#include <glm/common.hpp>

#include <array>
#include <cmath>
#include <vector>

namespace palpate::reference {
namespace {

constexpr double columnSide = 0.016, length = 0.06, massDensity = 1000.0, poisson = 0.45;  // [m], [kg/m^3]

// A bar along y, held at its end y = 60 mm: where the middle of its free end goes, by quadratic tetrahedra.
Vec3 tipByTheReference(double youngsModulus, double nu, Vec3 acceleration, Law law)
{
    const auto even = [](double high, int cells) {
        std::vector<double> ends;
        for (int i = 0; i <= cells; ++i) {
            ends.push_back(high * i / cells);
        }
        return ends;
    };
    BoxMeshOptions box;
    box.held = [](Vec3 p) { return p.y > length - 1e-6; };
    const TetMesh mesh = boxMesh(even(columnSide, 4), even(length, 12), even(columnSide, 4), box);
    SolveOptions options;
    options.law = law;
    const std::array<Material, 1> materials{{{youngsModulus, nu, 0.0}}};
    Equilibrium body(mesh, materials, options);
    const std::array<double, 1> densities{massDensity};
    for (const double fraction : {0.25, 0.5, 0.75, 1.0}) {
        body.weigh(mesh, densities, fraction * acceleration);
        EXPECT_TRUE(body.find(1e-6)) << fraction;
    }
    const std::array<Vec3, 1> tip{1e3 * Vec3(0.5 * columnSide, 0.0, 0.5 * columnSide)};
    return 1e-3 * body.fem.displacementAt(body.state, tip)[0];
}

// The same by the kernel's cells.
Vec3 tipByTheKernel(double youngsModulus, Vec3 acceleration, int cells)
{
    const double h = columnSide / cells;
    const Index3 size(cells, static_cast<int>(std::lround(length / h)) + 1, cells);
    const chainmail::ElasticBody body = tests::bodyOf(tests::heldBlock(size, h, youngsModulus, poisson));
    const auto& nodes = body.levels[0].nodes;
    chainmail::LoadedBody loaded(body);
    const Index3 first(glm::round(-nodes.origin / h));
    volume::forEachIndex(first, first + Index3(cells - 1, size.y - 2, cells - 1), [&](Index3 c) {
        volume::forEachIndex(c, c + 1, [&](Index3 n) { loaded.load(n, 0.125 * massDensity * h * h * h * acceleration); });
    });
    EXPECT_TRUE(loaded.solve(1e-7, 400).balanced);
    return loaded.displacement(first + Index3(cells / 2, 0, cells / 2));
}

// Without lateral contraction it is longer by rho g L^2 / 2 E.
TEST(Weight, AHangingBarOfTheReferenceStretchesByTheFormula)
{
    constexpr double e = 60e3;
    const double formula = massDensity * 9.81 * length * length / (2.0 * e);
    EXPECT_NEAR(tipByTheReference(e, 0.0, {0, -9.81, 0}, volume::SmallStrain{}).y, -formula, 1e-3 * formula);
}

// A bar that bends by a fifth of its length, and one that hangs.
TEST(Weight, TheKernelAgreesWithTheReference)
{
    const Vec3 hanging = tipByTheReference(10e3, poisson, {0, -9.81, 0}, volume::NeoHookean{});
    EXPECT_NEAR(tipByTheKernel(10e3, {0, -9.81, 0}, 4).y, hanging.y, 0.015 * std::abs(hanging.y));
    const Vec3 bent = tipByTheReference(60e3, poisson, {0, 0, -9.81}, volume::NeoHookean{});
    EXPECT_LT(bent.z, -0.15 * length);
    EXPECT_NEAR(tipByTheKernel(60e3, {0, 0, -9.81}, 4).z, bent.z, 0.015 * std::abs(bent.z));
}

}  // namespace
}  // namespace palpate::reference
