#include "elastic_cells.h"

#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/mat3x3.hpp>

#include <cmath>

namespace palpate::chainmail {
namespace {

using tests::Cells;

Cells randomCells(std::minstd_rand& random)
{
    Cells cells({11, 6, 7});
    cells.fillRandom(random);
    return cells;
}

// Any rotation, however large: forces under 1e-5 of what the linear operator takes for the same displacements, energy under
// the rounding of the cells' invariants.
TEST(ElasticFinite, RotationsCostNothing)
{
    std::minstd_rand random(1);
    Cells cells = randomCells(random);
    double moduli = 0.0;
    for (const float mu : cells.mu) {
        moduli += 32.0 * static_cast<double>(mu);
    }
    for (const double angle : {0.2, 1.0, 2.5, 3.1}) {
        cells.relief = angle > 1.0 ? 1.0F : 0.0F;
        const Mat3 turn(glm::rotate(glm::dmat4(1.0), angle, glm::normalize(Vec3(0.3, -0.8, 0.5))));
        cells.move([&](Index3 n) { return (turn - Mat3(1.0)) * (Vec3(n) - Vec3(5, 3, 3)); });
        const double energy = cells.applyFinite();
        const double force = cells.largestForce();
        cells.apply();
        EXPECT_LT(std::abs(energy), 5e-7 * moduli) << angle;
        EXPECT_LT(force, 1e-5 * cells.largestForce()) << angle;
    }
}

// A homogeneous stretch F = diag(a, b, c): energy per volume by hand, that of CalculiX and of the reference.
TEST(ElasticFinite, EnergyOfAStretchIsTheLaw)
{
    const double mu = 2.0;
    const double lambda = 30.0;
    const Vec3 stretch(1.3, 0.9, 0.8);
    Cells cells({12, 6, 5});
    cells.fill(mu, lambda);
    cells.move([&](Index3 n) { return (stretch - 1.0) * Vec3(n); });
    const double j = stretch.x * stretch.y * stretch.z - 1.0;
    const double i = std::pow(j + 1.0, -2.0 / 3.0) * glm::dot(stretch, stretch) - 3.0;
    const double density = 0.5 * mu * i + 0.5 * (lambda + 2.0 / 3.0 * mu) * j * j;
    EXPECT_NEAR(cells.applyFinite(), density * 11 * 5 * 4, 1e-5 * density * 220);

    const double b = 7.0;
    const double stiffer = density + 0.25 * mu * b * i * i;
    cells.stiffen(b);
    EXPECT_NEAR(cells.applyFinite(), stiffer * 220, 1e-4 * stiffer * 220);
}

// Pressure under a tool must not take stiffening away, nor give any.
TEST(ElasticFinite, AChangeOfVolumeAloneDoesNotStiffen)
{
    for (const double scale : {0.8, 0.97, 1.0, 1.03, 1.2}) {
        Cells cells({12, 6, 5});
        cells.fill(2.0, 30.0);
        cells.move([&](Index3 n) { return (scale - 1.0) * Vec3(n); });
        const double without = cells.applyFinite();
        cells.stiffen(100.0);
        EXPECT_NEAR(cells.applyFinite(), without, 1e-3 * without) << scale;
    }
}

// b < 0: the second term goes on along its tangent from I = 1: mu/4 b (2 I - 1).
TEST(ElasticFinite, SofteningEndsAtItsBound)
{
    const double mu = 2.0;
    const double b = -0.25;
    for (const Vec3 stretch : {Vec3(1.3, 0.9, 0.8), Vec3(2.0, 0.8, 0.7)}) {
        Cells cells({12, 6, 5});
        cells.fill(mu, 30.0);
        cells.move([&](Index3 n) { return (stretch - 1.0) * Vec3(n); });
        const double without = cells.applyFinite();
        const double j = stretch.x * stretch.y * stretch.z - 1.0;
        const double i = std::pow(j + 1.0, -2.0 / 3.0) * glm::dot(stretch, stretch) - 3.0;
        const double term = 0.25 * mu * b * (i > 1.0 ? 2.0 * i - 1.0 : std::max(i, 0.0) * i);
        cells.stiffen(b);
        EXPECT_NEAR(cells.applyFinite(), without + 220.0 * term, 1e-3 * without) << i;
    }
}

// And the force is the derivative of that energy, on both sides of the bound.
TEST(ElasticFinite, SofteningForceIsTheDerivativeOfEnergy)
{
    std::minstd_rand random(5);
    Cells cells({7, 6, 5});
    cells.fill(2.0, 10.0);
    cells.stiffen(-0.25);
    cells.moveRandom(0.3, random);
    Cells way = cells;
    way.moveRandom(1.0, random);
    const double slope = tests::energySlope(cells, way.u, 2e-3F);
    EXPECT_NEAR(dot(cells, cells.out, way.u), slope, 2e-3 * std::abs(slope));
}

// Tangent modulus of a stretch e without change of volume: E (1 + 9 b e^2), what the tissue table is fitted with.
TEST(ElasticFinite, StiffeningGivesTheTangentOfTheTissueTable)
{
    const double b = 4.0;
    const auto energy = [&](double e) {
        Cells cells({12, 6, 5});
        cells.fill(2.0, 0.0);
        cells.stiffen(b);
        const Vec3 stretch(1.0 + e, 1.0 / std::sqrt(1.0 + e), 1.0 / std::sqrt(1.0 + e));
        cells.move([&](Index3 n) { return (stretch - 1.0) * Vec3(n); });
        return cells.applyFinite() / 220.0;
    };
    const double step = 0.01;
    const auto tangent = [&](double e) { return (energy(e + step) - 2.0 * energy(e) + energy(e - step)) / (step * step); };
    const double start = tangent(0.0);
    EXPECT_NEAR(start, 3.0 * 2.0, 0.05 * start);
    for (const double e : {-0.1, 0.1}) {
        EXPECT_NEAR(0.5 * (tangent(e) + tangent(-e)) / start, 1.0 + 9.0 * b * e * e, 0.06) << e;
    }
}

// f(s u) = s A u + O(s^2): the difference falls by four when s is halved.
TEST(ElasticFinite, SmallStrainTendsToTheLinearOperator)
{
    std::minstd_rand random(2);
    Cells cells = randomCells(random);
    cells.moveRandom(1.0, random);
    const Floats u = cells.u;
    const auto difference = [&](float s) {
        for (std::size_t i = 0; i < u.size(); ++i) {
            cells.u[i] = s * u[i];
        }
        cells.apply();
        const Floats linear = cells.out;
        cells.applyFinite();
        for (std::size_t i = 0; i < u.size(); ++i) {
            cells.out[i] -= linear[i];
        }
        return std::sqrt(dot(cells, cells.out, cells.out));
    };
    const double coarse = difference(0.02F);
    const double middle = difference(0.01F);
    const double fine = difference(0.005F);
    EXPECT_NEAR(std::log2(coarse / middle), 2.0, 0.1);
    EXPECT_NEAR(std::log2(middle / fine), 2.0, 0.1);
}

// And the energy to half of u.A u: a strain of 1e-4 must not drown in rounding.
TEST(ElasticFinite, EnergyOfSmallStrainIsHalfOfForceTimesWay)
{
    Cells cells({12, 6, 5});
    cells.fill(2.0, 30.0);
    for (const double strain : {1e-2, 1e-3, 1e-4}) {
        cells.move([&](Index3 n) { return strain * Vec3(n.y, 0.3 * n.z, -0.2 * n.z); });
        const double energy = cells.applyFinite();
        cells.apply();
        const double linear = 0.5 * dot(cells, cells.u, cells.out);
        EXPECT_NEAR(energy, linear, (0.01 + 2.0 * strain) * linear) << strain;
    }
}

// dE/dt along v is v.f, by central differences: error of second order in t, here under 1e-3.
TEST(ElasticFinite, ForceIsTheDerivativeOfTheEnergy)
{
    std::minstd_rand random(3);
    Cells cells = randomCells(random);
    cells.stiffen(3.0);
    Cells direction = cells;
    for (int i = 0; i < 10; ++i) {
        cells.relief = 0.5F * static_cast<float>(i % 3);
        cells.moveRandom(i < 5 ? 0.3 : 0.6, random);
        direction.moveRandom(1.0, random);
        const double slope = tests::energySlope(cells, direction.u, 4e-3F);
        const double scale = std::sqrt(dot(cells, cells.out, cells.out) * dot(cells, direction.u, direction.u));
        EXPECT_NEAR(slope, dot(cells, direction.u, cells.out), 1e-3 * scale);
    }
}

// A cell that is stretched to `a` along x and bent by u_x = c (x - 1/2) (z - 1/2): 4/3 mu (c / 4)^2, times the square of
// the stretch and of the factor of CellStiffness::relief. That is 1 at rest and in compression, and 2/3 where a^2 = 2.7.
TEST(ElasticFinite, AStretchedCellBendsByTheFactorThatIsSaid)
{
    constexpr double mu = 2.0, c = 0.4, q = 1.7;
    Cells cells({2, 2, 2});
    cells.fill(mu, 0.0);
    const auto energy = [&](double a, double bent) {
        cells.move([&](Index3 n) {
            const Vec3 x = Vec3(n) - 0.5;
            return Vec3((a - 1.0) * x.x + bent * x.x * x.z, 0.0, 0.0);
        });
        return cells.applyFinite();
    };
    for (const double a : {0.6, 1.0, 1.2, std::sqrt(2.7), 2.5, 6.0}) {
        const double y = std::max(a * a - 1.0, 0.0);
        for (const double relief : {0.0, 0.5, 1.0}) {
            cells.relief = static_cast<float>(relief);
            const double factor = a * (1.0 - 4.0 / 3.0 * relief * std::pow(q * y / (q * q + y * y), 2));
            const double bending = 4.0 / 3.0 * mu * c * c / 16.0 * factor * factor;
            EXPECT_NEAR(energy(a, c) - energy(a, 0.0), bending, 1e-5 * (bending + energy(a, 0.0))) << a << ' ' << relief;
        }
    }
}

// Cells turned inside out, flattened and blown up: finite forces, and an energy that is finite and not negative.
TEST(ElasticFinite, EnergyIsFiniteForInvertedCells)
{
    std::minstd_rand random(4);
    Cells cells({11, 6, 7});
    cells.fill(2.0, 30.0);
    for (const double size : {0.0, 0.5, 3.0, 50.0}) {
        cells.moveRandom(size, random);
        EXPECT_GE(cells.applyFinite(), 0.0);
        EXPECT_TRUE(std::isfinite(cells.largestForce()));
    }
    cells.move([](Index3 n) { return -2.0 * Vec3(n); });
    EXPECT_GT(cells.applyFinite(), 0.0);
    cells.move([](Index3 n) { return -1.0 * Vec3(n); });
    EXPECT_GE(cells.applyFinite(), 0.0);
}

}  // namespace
}  // namespace palpate::chainmail
