#include "elastic_bodies.h"

#include <gtest/gtest.h>

#include <glm/trigonometric.hpp>

#include <cmath>
#include <numbers>

namespace palpate::chainmail {
namespace {

using tests::ElasticBlock;

// Bends a beam of `length` x `side` x `side` cells to the curvature K: both ends are held as in Saint-Venant's solution
//
//     u = K (x y, -(x^2 + nu (y^2 - z^2)) / 2, -nu y z),
//
// all else is free. Returns the energy over E I K^2 length / 2.
double bending(int length, int side, double nu)
{
    const double h = 1e-3;
    const double e = 1e4;
    const double curvature = 0.5;
    const auto material = [&](Index3 c) { return tests::tissue(e, nu, c.x == 0 || c.x == length - 1); };
    const ElasticBody body = tests::bodyOf(ElasticBlock{{length, side, side}, h, material, 1, Vec3(0.0)});
    WindowStack stack(body, 65, tests::focusAt(Vec3(0.0)));
    Multigrid multigrid(stack, 1);
    Window& beam = stack[0];
    tests::forEachNode(stack, [&](std::size_t l, Window& w, std::size_t node, Vec3 rest) {
        const Vec3 p = rest - 0.5 * h * Vec3(length, side, side);
        const bool held = l == 0 && w.open[node] == 0.0F;
        const Vec3 exact(p.x * p.y, -0.5 * (p.x * p.x + nu * (p.y * p.y - p.z * p.z)), -nu * p.y * p.z);
        tests::setAt(w, node, Field::u, held ? curvature * exact : Vec3(0.0));
    });
    stack.joinBorders(Field::u);
    stack.apply(Field::u, Field::r);
    EXPECT_LT(tests::solve(stack, multigrid, 1e-4, 1000), 1000) << "nu " << nu;

    const Kernels& k = stack.kernels();
    k.apply(beam.layout, beam.stiffness(), beam.field(Field::u), beam.field(Field::t), stack.scratch());
    double energy = 0.0;
    tests::forEachNode(stack, [&](std::size_t l, Window& w, std::size_t node, Vec3) {
        energy += l == 0 ? 0.5 * glm::dot(tests::valueAt(w, node, Field::u), tests::valueAt(w, node, Field::t)) : 0.0;
    });
    const double inertia = std::pow(side * h, 4) / 12.0;
    return energy / (0.5 * e * inertia * curvature * curvature * length * h);
}

// A brick integrated in full would be stiffer by a fraction of 1 / (1 - 2 nu), 500 times at nu 0.499. Ours bends as the
// beam with two cells across as with eight, whatever Poisson's ratio: what is left is rounding.
TEST(ElasticElement, BendsAsABeamUpToPoissonsRatioOfOneHalf)
{
    for (const double nu : {0.0, 0.3, 0.45, 0.49, 0.499}) {
        for (const int side : {2, 4, 8}) {
            EXPECT_NEAR(bending(4 * side, side, nu), 1.0, 1e-3) << "nu " << nu << ", " << side;
        }
    }
}

// A smooth field on the unit cube that vanishes on its faces, and the force density that holds it.
struct Manufactured {
    double mu;
    double lambda;

    static constexpr double pi = std::numbers::pi;
    static inline const Vec3 size{1.0, -0.7, 0.4};

    Vec3 displacement(Vec3 x) const { return size * std::sin(pi * x.x) * std::sin(pi * x.y) * std::sin(pi * x.z); }

    // f = -mu laplacian u - (lambda + mu) grad div u
    Vec3 force(Vec3 x) const
    {
        const Vec3 s = glm::sin(pi * x);
        const Vec3 c = glm::cos(pi * x);
        const double sss = s.x * s.y * s.z;
        const Vec3 gradient = -size * sss + Vec3(size.y * c.x * c.y * s.z + size.z * c.x * s.y * c.z,
                                                 size.x * c.x * c.y * s.z + size.z * s.x * c.y * c.z,
                                                 size.x * c.x * s.y * c.z + size.y * s.x * c.y * c.z);
        return pi * pi * (3.0 * mu * size * sss - (lambda + mu) * gradient);
    }
};

// Root mean square of the error over that of the field, with n cells along each side.
double manufacturedError(int n, double nu)
{
    const double e = 1e4;
    const double h = 1.0 / n;
    const Manufactured problem{e / (2.0 * (1.0 + nu)), e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))};
    ElasticBlock block = tests::shell(n + 2, 1, h, e, nu, 1);
    block.low = Vec3(-h);
    const ElasticBody body = tests::bodyOf(block);
    WindowStack stack(body, 65, tests::focusAt(Vec3(0.5)));
    Multigrid multigrid(stack, 1);
    tests::forEachNode(stack, [&](std::size_t, Window& w, std::size_t node, Vec3 rest) {
        tests::setAt(w, node, Field::r, static_cast<double>(w.dof[node]) * h * h * h * problem.force(rest));
    });
    EXPECT_LT(tests::solve(stack, multigrid, 1e-5, 100), 100);
    double error = 0.0;
    double norm = 0.0;
    tests::forEachNode(stack, [&](std::size_t, Window& w, std::size_t node, Vec3 rest) {
        if (w.dof[node] != 0.0F) {
            const Vec3 exact = problem.displacement(rest);
            const Vec3 off = tests::valueAt(w, node, Field::u) - exact;
            error += glm::dot(off, off);
            norm += glm::dot(exact, exact);
        }
    });
    return std::sqrt(error / norm);
}

// Order two in displacement, over three halvings, also where the divergence is held by one point per cell.
TEST(ElasticElement, SmoothFieldsConvergeWithOrderTwo)
{
    for (const double nu : {0.3, 0.45}) {
        const double coarse = manufacturedError(7, nu);
        const double middle = manufacturedError(14, nu);
        const double fine = manufacturedError(28, nu);
        EXPECT_NEAR(std::log2(coarse / middle), 2.0, 0.2) << "nu " << nu;
        EXPECT_NEAR(std::log2(middle / fine), 2.0, 0.2) << "nu " << nu;
        EXPECT_LT(fine, 0.01);
    }
}

}  // namespace
}  // namespace palpate::chainmail
