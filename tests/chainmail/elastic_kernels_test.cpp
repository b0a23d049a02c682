#include "elastic_cells.h"

#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include <array>
#include <cmath>
#include <cstring>

namespace palpate::chainmail {
namespace {

using tests::Cells;
using Matrix24 = std::array<std::array<double, 24>, 24>;

constexpr double kernelRounding = 1e-6;  // of single precision, over the operations of a cell

Mat3 strainOf(const Mat3& gradient)
{
    return 0.5 * (gradient + glm::transpose(gradient));
}

Mat3 stressOf(const Mat3& gradient, double mu, double lambda)
{
    const Mat3 e = strainOf(gradient);
    return 2.0 * mu * e + lambda * (e[0][0] + e[1][1] + e[2][2]) * Mat3(1.0);
}

// Gradients of the eight shape functions of the unit cell at s in [0, 1]^3.
std::array<Vec3, 8> shapeGradients(Vec3 s)
{
    std::array<Vec3, 8> g;
    for (int n = 0; n < 8; ++n) {
        const Vec3 up(n & 1, (n >> 1) & 1, n >> 2);
        const Vec3 v = glm::mix(1.0 - s, s, up);
        const Vec3 d = 2.0 * up - 1.0;
        g[static_cast<std::size_t>(n)] = {d.x * v.y * v.z, v.x * d.y * v.z, v.x * v.y * d.z};
    }
    return g;
}

// Adds weight (2 mu e:e + lambda div div) at one point; freedoms node by node.
void addPoint(Matrix24& k, Vec3 s, double weight, double mu, double lambda)
{
    const auto g = shapeGradients(s);
    for (std::size_t a = 0; a < 24; ++a) {
        for (std::size_t b = 0; b < 24; ++b) {
            const int i = static_cast<int>(a % 3);
            const int j = static_cast<int>(b % 3);
            const double same = i == j ? glm::dot(g[a / 3], g[b / 3]) : 0.0;
            k[a][b] += weight * (mu * (same + g[a / 3][j] * g[b / 3][i]) + lambda * g[a / 3][i] * g[b / 3][j]);
        }
    }
}

// Strain at s in [-1/2, 1/2]^3, xx yy zz xy yz zx (shear as angles), of freedom i of node n, by assumed strain: a normal
// strain that grows along an axis brings the one along that axis with it that leaves no stress there, and no shear.
std::array<double, 6> assumedStrain(int n, int i, Vec3 s, double fraction)
{
    const Vec3 d = 2.0 * Vec3(n & 1, (n >> 1) & 1, n >> 2) - 1.0;
    const int j = (i + 1) % 3;
    const int k = (i + 2) % 3;
    const double all = d.x * d.y * d.z;
    std::array<double, 6> e{};
    const auto at = [&](int c) -> double& { return e[static_cast<std::size_t>(c)]; };
    // Index of the angle between axes a and b.
    const auto angle = [](int a, int b) { return 3 + (a + b == 1 ? 0 : a + b == 3 ? 1 : 2); };
    at(i) = 0.25 * d[i] + 0.5 * d[i] * (d[j] * s[j] + d[k] * s[k]) + all * s[j] * s[k];
    at(j) -= fraction * 0.5 * d[i] * d[j] * s[j];
    at(k) -= fraction * 0.5 * d[i] * d[k] * s[k];
    at(angle(i, j)) = 0.25 * d[j] + 0.5 * d[j] * d[k] * s[k] + all * s[i] * s[k];
    at(angle(i, k)) = 0.25 * d[k] + 0.5 * d[k] * d[j] * s[j] + all * s[i] * s[j];
    return e;
}

// The part of its divergence that grows along an axis.
double linearDivergence(int n, int i, Vec3 s, double fraction)
{
    const Vec3 d = 2.0 * Vec3(n & 1, (n >> 1) & 1, n >> 2) - 1.0;
    const int j = (i + 1) % 3;
    const int k = (i + 2) % 3;
    return (1.0 - fraction) * 0.5 * d[i] * (d[j] * s[j] + d[k] * s[k]);
}

// Adds weight (2 mu e:e + lambda of the linear divergence) at one point of [-1/2, 1/2]^3.
void addAssumed(Matrix24& k, Vec3 s, double weight, double mu, double lambda)
{
    const double fraction = lambda / (lambda + 2.0 * mu);
    for (std::size_t a = 0; a < 24; ++a) {
        const auto ea = assumedStrain(static_cast<int>(a / 3), static_cast<int>(a % 3), s, fraction);
        const double da = linearDivergence(static_cast<int>(a / 3), static_cast<int>(a % 3), s, fraction);
        for (std::size_t b = 0; b < 24; ++b) {
            const auto eb = assumedStrain(static_cast<int>(b / 3), static_cast<int>(b % 3), s, fraction);
            double sum = lambda * da * linearDivergence(static_cast<int>(b / 3), static_cast<int>(b % 3), s, fraction);
            for (std::size_t c = 0; c < 6; ++c) {
                sum += (c < 3 ? 2.0 : 1.0) * mu * ea[c] * eb[c];
            }
            k[a][b] += weight * sum;
        }
    }
}

// The brick of edge 1 m with assumed strain, by 2 x 2 x 2 Gauss points; of the divergence the mean, and what grows along
// one axis.
Matrix24 byQuadrature(double mu, double lambda)
{
    Matrix24 k{};
    const double off = 0.5 / std::sqrt(3.0);
    for (int g = 0; g < 8; ++g) {
        addAssumed(k, off * (2.0 * Vec3(g & 1, (g >> 1) & 1, g >> 2) - 1.0), 0.125, mu, lambda);
    }
    addPoint(k, Vec3(0.5), 1.0, 0.0, lambda);
    return k;
}

Index3 cornerOf(std::size_t n)
{
    return Index3(static_cast<int>(n) & 1, (static_cast<int>(n) >> 1) & 1, static_cast<int>(n) >> 2);
}

// Column by column: the forces of one cell when one of its freedoms moves by 1 m.
Matrix24 byKernel(double mu, double lambda)
{
    Cells cell(Index3(2));
    cell.fill(mu, lambda);
    Matrix24 k{};
    for (std::size_t a = 0; a < 24; ++a) {
        cell.move([](Index3) { return Vec3(0.0); });
        cell.u[cell.index(cornerOf(a / 3), static_cast<int>(a % 3))] = 1.0F;
        cell.apply();
        for (std::size_t b = 0; b < 24; ++b) {
            k[b][a] = cell.force(cornerOf(b / 3))[static_cast<int>(b % 3)];
        }
    }
    return k;
}

// Turns rows and columns p and q of a symmetric matrix so that entry (p, q) becomes zero.
void rotate(Matrix24& a, std::size_t p, std::size_t q)
{
    if (std::abs(a[p][q]) < 1e-300) {
        return;
    }
    const double theta = 0.5 * std::atan2(2.0 * a[p][q], a[q][q] - a[p][p]);
    const double c = std::cos(theta);
    const double s = std::sin(theta);
    for (auto& row : a) {
        const double x = row[p];
        row[p] = c * x - s * row[q];
        row[q] = s * x + c * row[q];
    }
    for (std::size_t i = 0; i < 24; ++i) {
        const double x = a[p][i];
        a[p][i] = c * x - s * a[q][i];
        a[q][i] = s * x + c * a[q][i];
    }
}

// By Jacobi's rotations, in rising order.
std::array<double, 24> eigenvalues(Matrix24 a)
{
    for (int sweep = 0; sweep < 12; ++sweep) {
        for (std::size_t p = 0; p < 24; ++p) {
            for (std::size_t q = p + 1; q < 24; ++q) {
                rotate(a, p, q);
            }
        }
    }
    std::array<double, 24> values{};
    for (std::size_t i = 0; i < 24; ++i) {
        values[i] = a[i][i];
    }
    std::sort(values.begin(), values.end());
    return values;
}

// The modal form is the brick with assumed strain, entry by entry.
TEST(ElasticKernels, CellIsTheBrickAssembledByQuadrature)
{
    for (const double lambda : {0.0, 1.5, 500.0}) {
        const Matrix24 ours = byKernel(1.0, lambda);
        const Matrix24 theirs = byQuadrature(1.0, lambda);
        for (std::size_t a = 0; a < 24; ++a) {
            for (std::size_t b = 0; b < 24; ++b) {
                EXPECT_NEAR(ours[a][b], theirs[a][b], kernelRounding * (1.0 + lambda)) << a << " " << b;
            }
        }
    }
}

// Six rigid motions cost nothing; no other motion of one cell does.
TEST(ElasticKernels, ExactlySixMotionsOfACellCostNothing)
{
    for (const double lambda : {0.0, 1.5, 500.0}) {
        const auto values = eigenvalues(byKernel(1.0, lambda));
        for (std::size_t i = 0; i < 6; ++i) {
            EXPECT_NEAR(values[i], 0.0, kernelRounding * (1.0 + lambda));
        }
        EXPECT_GT(values[6], 0.05) << "lambda " << lambda;
    }
}

// Differences of equal numbers are zero: no rounding at all.
TEST(ElasticKernels, TranslationsGiveNoForceToTheBit)
{
    std::minstd_rand random(1);
    Cells cells({23, 7, 9});
    cells.fillRandom(random);
    cells.move([](Index3) { return Vec3(0.3, -7.1, 0.01); });
    cells.apply();
    EXPECT_EQ(cells.largestForce(), 0.0);
    cells.moveRandom(1.0, random);
    cells.apply();
    EXPECT_GT(cells.largestForce(), 10.0);
}

// To the rounding of the displacements themselves: 1e-6 of stiffness times displacement.
TEST(ElasticKernels, RotationsGiveNoForce)
{
    std::minstd_rand random(2);
    Cells cells({23, 7, 9});
    cells.fillRandom(random);
    for (const Vec3 axis : {Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1), Vec3(0.4, -0.7, 0.3)}) {
        const auto turn = [&](Index3 n) { return glm::cross(axis, Vec3(n) - Vec3(11, 3, 4)); };
        cells.move(turn);
        cells.apply();
        EXPECT_LT(cells.largestForce(), kernelRounding * 100.0 * 12.0);
    }
}

// u = G x: nothing at inner nodes, sigma n at the outer ones, each face's force its stress times its area.
TEST(ElasticKernels, AffineFieldsPassThePatchTest)
{
    const double mu = 3.0;
    const double lambda = 70.0;
    const Mat3 gradient(0.02, -0.01, 0.03, 0.015, -0.04, 0.01, 0.005, 0.02, 0.03);
    Cells cells({12, 9, 7});
    cells.fill(mu, lambda);
    cells.move([&](Index3 n) { return gradient * Vec3(n); });
    cells.apply();
    const Mat3 stress = stressOf(gradient, mu, lambda);
    const Index3 last = cells.nodes() - 1;
    volume::forEachIndex(Index3(0), last, [&](Index3 n) {
        // Of each face's stress a node takes a quarter of every square next to it.
        Vec3 expected(0.0);
        for (int axis = 0; axis < 3; ++axis) {
            const int side = n[axis] == 0 ? -1 : n[axis] == last[axis] ? 1 : 0;
            double squares = 1.0;
            for (const int across : {(axis + 1) % 3, (axis + 2) % 3}) {
                squares *= n[across] == 0 || n[across] == last[across] ? 0.5 : 1.0;
            }
            expected += side * squares * stress[axis];
        }
        EXPECT_LT(glm::distance(cells.force(n), expected), kernelRounding * (2.0 * mu + lambda));
    });
}

// A bar under uniaxial stress, free to contract: F = E A eps, and nothing on its sides, at any Poisson's ratio.
TEST(ElasticKernels, UniaxialBarCarriesEAEps)
{
    const double e = 10.0;
    const double strain = 0.01;
    for (const double nu : {0.0, 0.3, 0.45, 0.499}) {
        Cells bar({21, 5, 4});
        bar.fill(e / (2.0 * (1.0 + nu)), e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)));
        bar.move([&](Index3 n) { return strain * Vec3(n.x, -nu * n.y, -nu * n.z); });
        bar.apply();
        double force = 0.0;
        double sides = 0.0;
        volume::forEachIndex(Index3(0), bar.nodes() - 1, [&](Index3 n) {
            force += n.x == 20 ? bar.force(n).x : 0.0;
            sides = std::max({sides, std::abs(bar.force(n).y), std::abs(bar.force(n).z)});
        });
        const double expected = e * 12.0 * strain;
        const double bulk = 1.0 + nu / (1.0 - 2.0 * nu);
        EXPECT_NEAR(force, expected, 3e-6 * bulk * expected) << "nu " << nu;
        EXPECT_LT(sides, 3e-6 * bulk * expected) << "nu " << nu;
    }
}

// E(u + t v) - E(u - t v) = 2 t v.A u without error, E being a parabola: in double from the forces alone.
TEST(ElasticKernels, ForceIsTheDerivativeOfEnergy)
{
    std::minstd_rand random(3);
    Cells cells({9, 6, 7});
    cells.fillRandom(random);
    Cells shifted = cells;
    for (int i = 0; i < 5; ++i) {
        cells.moveRandom(1.0, random);
        cells.apply();
        Cells direction = cells;
        direction.moveRandom(1.0, random);
        const auto energy = [&](float t) {
            for (std::size_t n = 0; n < shifted.u.size(); ++n) {
                shifted.u[n] = cells.u[n] + t * direction.u[n];
            }
            shifted.apply();
            return 0.5 * dot(shifted, shifted.u, shifted.out);
        };
        const double slope = (energy(0.25F) - energy(-0.25F)) / 0.5;
        EXPECT_NEAR(slope, dot(cells, direction.u, cells.out), 1e-5 * energy(0.0F));
        EXPECT_GT(energy(0.0F), 0.0);
    }
}

TEST(ElasticKernels, OperatorIsSymmetric)
{
    std::minstd_rand random(4);
    for (const Index3 size : {Index3(2, 2, 2), Index3(5, 9, 4), Index3(33, 6, 5)}) {
        Cells a(size);
        a.fillRandom(random);
        Cells b = a;
        a.moveRandom(1.0, random);
        b.moveRandom(1.0, random);
        a.apply();
        b.apply();
        const double scale = std::sqrt(dot(a, a.u, a.out) * dot(b, b.u, b.out));
        EXPECT_NEAR(dot(a, a.u, b.out), dot(b, b.u, a.out), kernelRounding * scale);
    }
}

}  // namespace
}  // namespace palpate::chainmail
