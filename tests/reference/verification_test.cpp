#include <reference/box_mesh.h>
#include <reference/verification.h>
#include <studies/accuracy/elastic_formulas.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>

namespace palpate::reference {
namespace {

double volumeOf(const TetMesh& mesh, int tissue)
{
    double sum = 0.0;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const auto& p = mesh.tets[t];
        const Vec3 a = mesh.points[p[0]];
        const double six = glm::dot(glm::cross(mesh.points[p[1]] - a, mesh.points[p[2]] - a), mesh.points[p[3]] - a);
        EXPECT_GT(six, 0.0);
        sum += mesh.tissue[t] == tissue ? six / 6.0 : 0.0;
    }
    return sum;
}

double heldArea(const TetMesh& mesh)
{
    double sum = 0.0;
    for (const auto& face : mesh.faces) {
        const auto& p = face.points;
        const Vec3 a = mesh.points[p[0]];
        sum += face.held ? 0.5 * glm::length(glm::cross(mesh.points[p[1]] - a, mesh.points[p[2]] - a)) : 0.0;
    }
    return sum;
}

// Faces turn outwards: by the divergence theorem their cones from the origin fill the body.
double volumeInFaces(const TetMesh& mesh)
{
    double sum = 0.0;
    for (const auto& face : mesh.faces) {
        const auto& p = face.points;
        sum += glm::dot(mesh.points[p[0]], glm::cross(mesh.points[p[1]], mesh.points[p[2]])) / 6.0;
    }
    return sum;
}

TEST(BoxMesh, BricksFillTheBoxAndHoldItsBase)
{
    BoxMeshOptions options;
    options.held = [](Vec3 p) { return p.z < 1e-9; };
    options.tissue = [](Vec3 p) { return static_cast<std::uint8_t>(p.x > 0.5 ? 1 : 0); };
    const TetMesh mesh = boxMesh({0.0, 0.5, 2.0}, {0.0, 1.0}, {0.0, 1.0, 3.0}, options);
    EXPECT_EQ(mesh.tets.size(), 24U);
    EXPECT_NEAR(volumeOf(mesh, 0), 1.5, 1e-12);
    EXPECT_NEAR(volumeOf(mesh, 1), 4.5, 1e-12);
    EXPECT_NEAR(volumeInFaces(mesh), 6.0, 1e-12);
    EXPECT_NEAR(heldArea(mesh), 2.0, 1e-12);
}

TEST(BoxMesh, ABallInABoxAndADiscInASlabConform)
{
    const TetMesh ball = ballInBox(1.0, 3.0, 4);
    EXPECT_NEAR(volumeOf(ball, 1), std::numbers::pi / 6.0, 0.02 * std::numbers::pi / 6.0);
    EXPECT_NEAR(volumeOf(ball, 0) + volumeOf(ball, 1), 27.0, 1e-9);
    EXPECT_NEAR(volumeInFaces(ball), 27.0, 1e-9);

    const TetMesh slab =
        discInSlab({.radius = 1.0, .side = 4.0, .thickness = 2.0, .fine = 0.2, .growth = 1.5, .fineTo = 0.2, .around = 3});
    EXPECT_NEAR(volumeOf(slab, 0), 32.0, 1e-9);
    EXPECT_NEAR(volumeInFaces(slab), 32.0, 1e-9);
    EXPECT_NEAR(heldArea(slab), 16.0, 1e-9);
    double disc = 0.0;
    for (const auto& face : slab.faces) {
        const auto& p = face.points;
        const bool in = std::all_of(p.begin(), p.end(), [&](auto i) {
            return slab.points[i].z > -1e-9 && std::hypot(slab.points[i].x, slab.points[i].y) < 1.02;
        });
        const Vec3 a = slab.points[p[0]];
        disc += in ? 0.5 * glm::length(glm::cross(slab.points[p[1]] - a, slab.points[p[2]] - a)) : 0.0;
    }
    EXPECT_NEAR(disc, std::numbers::pi / 4.0, 1e-9);
}

TEST(BoxMesh, GradedCellsGrowFromTheFineOnes)
{
    const std::vector<double> ends = gradedCells(0.0, 1.0, 10.0, 0.25, 1.5);
    EXPECT_EQ(ends.front(), 0.0);
    EXPECT_NEAR(ends[4], 1.0, 1e-12);
    EXPECT_NEAR(ends.back(), 10.0, 1e-12);
    for (std::size_t i = 6; i < ends.size(); ++i) {
        EXPECT_NEAR((ends[i] - ends[i - 1]) / (ends[i - 1] - ends[i - 2]), 1.5, 1e-9);
    }
    EXPECT_THROW(gradedCells(0.0, 2.0, 1.0, 0.1, 1.5), std::runtime_error);
}

// Displacement and tractions go on through the ball's surface: the stress of the formula is found by differences.
TEST(ElasticFormulas, TheInclusionsFieldIsContinuousAndInEquilibrium)
{
    const studies::Inclusion problem{1.0, 0.3, 4.0, 7.0, 0.01};
    const double mu = 1.0, lambda = 2.0 * mu * 0.3 / (1.0 - 0.6);
    const double bulk = lambda + 2.0 / 3.0 * mu;
    const auto traction = [&](Vec3 x, Vec3 n, double shear, double volume) {
        const double h = 1e-5;
        Mat3 g(0.0);  // column j: derivative along j
        for (int j = 0; j < 3; ++j) {
            Vec3 step(0.0);
            step[j] = h;
            g[j] = (studies::inclusionDisplacement(problem, x + step) - studies::inclusionDisplacement(problem, x - step)) /
                   (2.0 * h);
        }
        const double trace = g[0][0] + g[1][1] + g[2][2];
        Vec3 t = (volume - 2.0 / 3.0 * shear) * trace * n;
        for (int i = 0; i < 3; ++i) {
            for (int j = 0; j < 3; ++j) {
                t[i] += shear * (g[j][i] + g[i][j]) * n[j];
            }
        }
        return t;
    };
    for (const Vec3 n : {Vec3(0, 0, 1), glm::normalize(Vec3(1, 2, 3)), glm::normalize(Vec3(3, -1, 0.5))}) {
        const Vec3 in = studies::inclusionDisplacement(problem, (1.0 - 1e-9) * n);
        const Vec3 out = studies::inclusionDisplacement(problem, (1.0 + 1e-9) * n);
        EXPECT_LT(glm::distance(in, out), 1e-9);
        const Vec3 pulled = traction((1.0 - 1e-4) * n, n, 4.0 * mu, 7.0 * bulk);
        const Vec3 held = traction((1.0 + 1e-4) * n, n, mu, bulk);
        EXPECT_LT(glm::distance(pulled, held), 1e-3 * glm::length(held));
    }
}

// At small strain E times it; without change of volume mu (a - 1/a^2).
TEST(ElasticFormulas, TensionOfANeoHookeanBar)
{
    EXPECT_NEAR(studies::uniaxialTension(volume::NeoHookean{}, 3000.0, 0.4, 0.0, 1.0 + 1e-6), 3000.0 * 1e-6, 1e-7);
    EXPECT_NEAR(studies::uniaxialTension(volume::NeoHookean{}, 3000.0, 0.4999999, 0.0, 1.5), 1000.0 * (1.5 - 1.0 / 2.25),
                0.01);
    EXPECT_GT(studies::uniaxialTension(volume::NeoHookean{}, 3000.0, 0.45, 1.0, 1.5),
              studies::uniaxialTension(volume::NeoHookean{}, 3000.0, 0.45, 0.0, 1.5));
}

TEST(ElasticFormulas, OrderOfExactPowers)
{
    const std::array<double, 3> sizes{1.0, 0.5, 0.25};
    const std::array<double, 3> errors{8.0, 1.0, 0.125};
    EXPECT_NEAR(studies::convergenceOrder(sizes, errors), 3.0, 1e-12);
}

TEST(Verification, EveryClosedFormIsMetOnCoarseMeshes)
{
    std::vector<std::string> told;
    const auto rows = verifyReference(Fineness::quick, [&](const std::string& what) { told.push_back(what); });
    EXPECT_EQ(told.size(), 5U);
    std::set<std::string> problems;
    for (const VerificationRow& row : rows) {
        EXPECT_LE(row.errorPercent, row.bound)
            << row.problem << ", " << row.setting << ": " << row.ours << " for " << row.reference;
        EXPECT_FALSE(row.source.empty());
        EXPECT_FALSE(row.setting.empty());
        problems.insert(row.problem);
    }
    EXPECT_EQ(problems.size(), 9U);
}

}  // namespace
}  // namespace palpate::reference
