#include <studies/kernel/baselines/baseline.h>
#include <studies/kernel/baselines/factored.h>
#include <studies/kernel/baselines/xpbd.h>
#include <studies/kernel/kernel_rivals.h>

#include <tests/studies/small_block.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <stdexcept>

namespace palpate::studies {
namespace {

constexpr double tetSpeed = 20e-3;

// The block, and the 5 mm sphere's way into it.
struct TetPressed {
    haptics::SessionModel model = smallBlock();
    TrialPlace place = trialPlace(*model.tissue, model.surface, model.approach.entry, model.approach.aim);
    TrialPath path = trialPath(*model.tissue, model.surface, place, trialTools()[0], 2e-3);

    TetBody mesh(double spacing, double poissonCap) const
    {
        return latticeTets(*model.tissue, model.surface, spacing, poissonCap);
    }
    Vec3 centre(TrialPose pose) const { return path.at(pose); }
    Vec3 centreAt(double depth) const { return centre({path.gap + depth, 0.0}); }
    double radius() const { return path.tool.radius; }
};

const TetPressed& tetPressed()
{
    static const TetPressed p;
    return p;
}

volume::TissueTable fatTable()
{
    volume::TissueTable table = tetPressed().model.tissue->table();
    return table;
}

// A ball of fat in air that nothing holds.
volume::Tissue ballOfFat(double radius)
{
    constexpr double voxel = 1e-3;
    const int side = 2 * static_cast<int>(radius / voxel) + 5;
    volume::LabelImage image;
    image.size = Index3(side);
    image.affine.linear = Mat3(voxel);
    image.affine.origin = Vec3(-0.5 * (side - 1) * voxel);
    volume::forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        const bool inside = glm::length(image.affine.toPatient(Vec3(n))) < radius;
        image.values.push_back(inside ? 1 : 0);
    });
    const std::array names{volume::LabelName{1, "fat", "fat"}};
    return volume::Tissue::fromLabels(image, fatTable(), names, {});
}

double volumeOf(const TetBody& mesh)
{
    double sum = 0.0;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        sum += shapeOf(mesh, t).volume;
    }
    return sum;
}

// How often each triangle occurs.
std::map<std::array<std::uint32_t, 3>, int> trianglesOf(const TetBody& mesh)
{
    std::map<std::array<std::uint32_t, 3>, int> count;
    for (const auto& tet : mesh.tets) {
        for (std::size_t out = 0; out < 4; ++out) {
            std::array<std::uint32_t, 3> face{};
            for (std::size_t i = 0; i < 3; ++i) {
                face[i] = tet[(out + 1 + i) % 4];
            }
            std::ranges::sort(face);
            ++count[face];
        }
    }
    return count;
}

// A triangle inside belongs to two tetrahedra, one on the outside to one, and its points are points of the surface.
TEST(TetBody, FillTheBlockAndMeetFaceToFace)
{
    const auto& p = tetPressed();
    for (const double spacing : {2e-3, 3e-3}) {
        const TetBody mesh = p.mesh(spacing, 0.49);
        const Vec3 side = p.model.tissue->box().high - p.model.tissue->box().low;
        EXPECT_NEAR(volumeOf(mesh) / (side.x * side.y * side.z), 1.0, 0.08) << 1e3 * spacing << " mm";
        for (const auto& [face, count] : trianglesOf(mesh)) {
            EXPECT_LE(count, 2);
            const bool outside = mesh.outer[face[0]] != 0 && mesh.outer[face[1]] != 0 && mesh.outer[face[2]] != 0;
            EXPECT_TRUE(count == 2 || outside);
        }
    }
}

// The volume of a ball is 4/3 pi r^3. On a staircase of 4 mm its surface would be up to 2 mm off.
TEST(TetBody, TheSurfaceOfABallIsRound)
{
    constexpr double radius = 16e-3;
    constexpr double spacing = 4e-3;
    const volume::Tissue tissue = ballOfFat(radius);
    const auto surface = tissue.distanceToBody(volume::coveringGrid(tissue.box(), 1e-3, 6e-3));
    const TetBody mesh = latticeTets(tissue, surface, spacing, 0.49);
    EXPECT_NEAR(volumeOf(mesh) / (4.0 / 3.0 * std::numbers::pi * std::pow(radius, 3)), 1.0, 0.06);
    double square = 0.0;
    std::size_t free = 0, held = 0;
    for (std::size_t i = 0; i < mesh.points.size(); ++i) {
        held += mesh.held[i] != 0 ? 1 : 0;
        if (mesh.outer[i] != 0 && mesh.held[i] == 0) {
            const double off = glm::length(mesh.points[i]) - radius;
            square += off * off;
            ++free;
        }
    }
    EXPECT_LT(std::sqrt(square / static_cast<double>(free)), 0.2 * spacing);
    EXPECT_GT(held, 0U);  // it lies on its back
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        EXPECT_GT(shapeOf(mesh, t).volume, 0.1 * std::pow(spacing, 3) / 6.0);
    }
}

TEST(TetBody, APlaceIsWhereTheBarycentricSumSays)
{
    const TetBody mesh = tetPressed().mesh(3e-3, 0.49);
    for (const Vec3 rest : {Vec3(1.1e-3, 5.2e-3, -7.3e-3), Vec3(-9.7e-3, 0.4e-3, 3.9e-3), mesh.points[40]}) {
        const Vec3 found = valueAt(placeOf(mesh, rest), [&](std::uint32_t i) { return mesh.points[i]; });
        EXPECT_LT(glm::distance(found, rest), 1e-12);
    }
    const Vec3 above = valueAt(placeOf(mesh, {0.0, -0.7e-3, 0.0}), [&](std::uint32_t i) { return mesh.points[i]; });
    EXPECT_LT(glm::distance(above, Vec3(0.0)), 1e-3);
}

TEST(TetBody, TooManyPointsAreRefused)
{
    const auto& p = tetPressed();
    EXPECT_THROW(latticeTets(*p.model.tissue, p.model.surface, 1e-3, 0.49, 1000), std::runtime_error);
}

// The mesh with its inner points moved about, and all of its surface held.
TetBody shaken(TetBody mesh)
{
    for (std::size_t i = 0; i < mesh.points.size(); ++i) {
        const double n = static_cast<double>(i);
        mesh.held[i] = mesh.outer[i];
        if (mesh.outer[i] == 0) {
            mesh.points[i] += 0.1 * mesh.corners.spacing * Vec3(std::sin(7.0 * n), std::sin(11.0 * n), std::sin(13.0 * n));
        }
    }
    std::ranges::fill(mesh.mu, mesh.mu.back());
    std::ranges::fill(mesh.lambda, mesh.lambda.back());
    return mesh;
}

// Which unknown each point is.
std::vector<std::uint32_t> unknownsOf(const TetBody& mesh, std::size_t& count)
{
    std::vector<std::uint32_t> unknown;
    for (std::size_t i = 0; i < mesh.points.size(); ++i) {
        unknown.push_back(mesh.held[i] != 0 ? TetFactor::held : static_cast<std::uint32_t>(count));
        count += mesh.held[i] == 0 ? 1 : 0;
    }
    return unknown;
}

// Forces on the free points when the held ones go to G x.
std::vector<double> loadsBy(const Mat3& gradient, const TetBody& mesh, const std::vector<std::uint32_t>& unknown,
                            std::size_t rows)
{
    std::vector<double> loads(rows, 0.0);
    const auto add = [&](std::uint32_t to, std::uint32_t of, const Mat3& stiffness) {
        if (mesh.held[to] == 0 && mesh.held[of] != 0) {
            const Vec3 f = -(stiffness * (gradient * mesh.points[of]));
            for (int c = 0; c < 3; ++c) {
                loads[3 * unknown[to] + static_cast<std::size_t>(c)] += f[c];
            }
        }
    };
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const auto stiffness = stiffnessOf(mesh, t);
        for (std::size_t ab = 0; ab < 16; ++ab) {
            add(mesh.tets[t][ab / 4], mesh.tets[t][ab % 4], stiffness[ab / 4][ab % 4]);
        }
    }
    return loads;
}

// A linear field on the surface of one material goes on linearly inside, whatever the tetrahedra: the patch test. It needs
// the gradients, the stiffness and the solver to be right, for several right sides at once.
TEST(TetFactor, PassesThePatchTest)
{
    const TetBody mesh = shaken(tetPressed().mesh(2e-3, 0.45));
    const std::array<Mat3, 2> gradients{Mat3(1e-3, 2e-3, -3e-3, 4e-3, 5e-3, 6e-3, -7e-3, 8e-3, 9e-3), Mat3(0.01)};
    std::size_t count = 0;
    const std::vector<std::uint32_t> unknown = unknownsOf(mesh, count);
    const std::size_t rows = 3 * count;
    ASSERT_GT(rows, 1000U);
    std::vector<double> u = loadsBy(gradients[0], mesh, unknown, rows);
    const std::vector<double> second = loadsBy(gradients[1], mesh, unknown, rows);
    u.insert(u.end(), second.begin(), second.end());
    TetFactor(mesh, unknown, count).solve(u);
    for (std::size_t i = 0; i < mesh.points.size(); ++i) {
        for (std::size_t k = 0; unknown[i] != TetFactor::held && k < 2; ++k) {
            const double* at = &u[k * rows + 3 * unknown[i]];
            EXPECT_LT(glm::distance(Vec3(at[0], at[1], at[2]), gradients[k] * mesh.points[i]), 1e-14);
        }
    }
}

TEST(TetFactor, WhatNothingHoldsIsRefused)
{
    TetBody mesh = tetPressed().mesh(3e-3, 0.45);
    std::ranges::fill(mesh.held, std::uint8_t{0});
    EXPECT_THROW(FactoredTets(std::move(mesh), tetPressed().path), std::runtime_error);
}

TEST(FactoredTets, NoPointIsInsideTheSphereAndNoneIsPulled)
{
    const auto& p = tetPressed();
    FactoredTets tets(p.mesh(2e-3, 0.45), p.path);
    std::size_t most = 0;
    for (const TrialTick& tick : schedule(p.path, tetSpeed)) {
        const Vec3 centre = p.centre(tick.pose);
        const auto result = tets.press(centre, p.radius());
        most = std::max(most, tets.touched());
        EXPECT_EQ(result.contacts, tets.touched());
        for (const auto& c : tets.contacts()) {
            const Vec3 out = tets.mesh().points[c.point] + c.u - centre;
            const double gap = glm::length(out) - p.radius();
            EXPECT_GT(gap, -1e-9);
            EXPECT_GE(glm::dot(c.force, out), 0.0);
            EXPECT_TRUE(c.force == Vec3(0.0) || std::abs(gap) < 1e-9);
            EXPECT_LT(glm::length(glm::cross(c.force, glm::normalize(out))), 1e-3 * glm::length(c.force) + 1e-12);
        }
    }
    EXPECT_GT(most, 5U);
    tets.press(p.centreAt(-1e-3), p.radius());
    EXPECT_EQ(tets.touched(), 0U);
    EXPECT_EQ(glm::length(tets.displacement({0.0, 2e-3, 0.0})), 0.0);
}

// What the contact points do is what the tetrahedra do.
TEST(FactoredTets, TheColumnsGiveTheContactsTheirDisplacement)
{
    const auto& p = tetPressed();
    FactoredTets tets(p.mesh(2e-3, 0.45), p.path);
    tets.press(p.centreAt(3e-3), p.radius());
    for (const auto& c : tets.contacts()) {
        EXPECT_LT(glm::distance(tets.displacement(tets.mesh().points[c.point]), c.u), 1e-8);
    }
}

// Without friction all work goes into the tissue: dE = F dz.
TEST(FactoredTets, TheForceIsTheDerivativeOfTheEnergy)
{
    const auto& p = tetPressed();
    FactoredTets tets(p.mesh(2e-3, 0.45), p.path);
    constexpr double step = 5e-6;
    const double low = tets.press(p.centreAt(2e-3 - step), p.radius()).energy;
    tets.press(p.centreAt(2e-3), p.radius());
    const double force = -glm::dot(tets.force(), p.path.inward);
    const double high = tets.press(p.centreAt(2e-3 + step), p.radius()).energy;
    EXPECT_GT(force, 0.0);
    EXPECT_NEAR((high - low) / (2.0 * step) / force, 1.0, 1e-3);
}

// Linear elements come nearer to the converged solution on cells of 1 mm with every finer mesh.
TEST(FactoredTets, ConvergeTowardsTheConvergedLattice)
{
    const auto& p = tetPressed();
    const TrialBody fine = trialBody(*p.model.tissue, p.model.surface, 1e-3, 0.45, 1U << 20);
    const std::array speeds{tetSpeed};
    const Reference reference = solveReference(fine.body, p.path, speeds, {.maxPoints = 5000});
    std::vector<double> near, force;
    for (const double spacing : {4e-3, 2e-3, 1.3e-3}) {
        const TrialResult result = runTrial(factoredModel(p.mesh(spacing, 0.45), p.path), p.path, tetSpeed, reference);
        near.push_back(spreadOf(result.looks, &TrialErrors::near).median);
        force.push_back(spreadOf(result.looks, &TrialErrors::force).median);
    }
    EXPECT_LT(near[1], 0.7 * near[0]);
    EXPECT_LT(near[2], 0.8 * near[1]);
    EXPECT_LT(near[2], 1.5);
    EXPECT_LT(force[2], 12.0);
}

TEST(Xpbd, ABodyAtRestStaysThere)
{
    const auto& p = tetPressed();
    Xpbd tets(p.mesh(3e-3, 0.49), {.substeps = 10});
    for (int i = 0; i < 50; ++i) {
        tets.step(p.centreAt(-5e-3), p.radius());
    }
    for (const Vec3f& u : tets.displacements()) {
        EXPECT_LT(glm::length(u), 1e-9F);
    }
    EXPECT_LT(std::abs(tets.energy()), 1e-12);
    EXPECT_EQ(tets.touched(), 0U);
}

// What tetrahedra do to each other cancels: a free body that is not damped keeps its momentum while it quivers.
TEST(Xpbd, TetrahedraKeepTheMomentum)
{
    TetBody mesh = tetPressed().mesh(3e-3, 0.45);
    std::ranges::fill(mesh.held, std::uint8_t{0});
    Xpbd tets(std::move(mesh), {.substeps = 10, .damping = 0.0});
    for (std::size_t i = 0; i < tets.velocities().size(); ++i) {
        tets.velocities()[i] = Vec3f(0.1F, 0.0F, i % 3 == 0 ? 0.1F : 0.0F);
    }
    const Vec3 before = tets.momentum();
    double most = 0.0;
    for (int i = 0; i < 20; ++i) {
        tets.step(Vec3(0.0), 0.0);
        most = std::max(most, tets.energy());
    }
    EXPECT_GT(most, 1e-7);  // it does quiver
    EXPECT_LT(glm::distance(tets.momentum(), before), 5e-4 * glm::length(before));
}

// Presses slowly, then waits until nothing moves any more.
Xpbd settled(const TetBody& mesh, double depth, int substeps)
{
    const auto& p = tetPressed();
    Xpbd tets(mesh, {.substeps = substeps, .damping = 200.0});
    constexpr int way = 60;
    for (int i = 1; i <= way; ++i) {
        tets.step(p.centreAt(depth * i / way), p.radius());
    }
    for (int i = 0; i < 200; ++i) {
        tets.step(p.centreAt(depth), p.radius());
    }
    return tets;
}

// Elastic force on each point: minus the sum of V P g, P = mu F + l (J - 1 - mu / l) cof F.
std::vector<Vec3> elasticForces(const TetBody& mesh, std::span<const Vec3f> u)
{
    std::vector<Vec3> force(mesh.points.size(), Vec3(0.0));
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const TetShape shape = shapeOf(mesh, t);
        Mat3 f(1.0);
        for (std::size_t i = 0; i < 4; ++i) {
            f += glm::outerProduct(Vec3(u[mesh.tets[t][i]]), shape.gradient[i]);
        }
        const double mu = mesh.mu[t], l = mesh.lambda[t] + mu;
        const double j = glm::determinant(f);
        const Mat3 stress = mu * f + l * (j - 1.0 - mu / l) * j * glm::transpose(glm::inverse(f));
        for (std::size_t i = 0; i < 4; ++i) {
            force[mesh.tets[t][i]] -= shape.volume * (stress * shape.gradient[i]);
        }
    }
    return force;
}

// Settled, the forces of the neo-Hookean energy balance at every free point that the sphere does not touch, and those at
// the points that it does are what XPBD's impulses say. More substeps come nearer.
TEST(Xpbd, SettlesAtTheEquilibriumOfTheEnergy)
{
    const auto& p = tetPressed();
    const TetBody mesh = p.mesh(3e-3, 0.45);
    std::vector<double> off;
    for (const int substeps : {5, 20}) {
        const Xpbd tets = settled(mesh, 3e-3, substeps);
        Vec3 onTool(0.0);
        double unbalanced = 0.0;
        const auto forces = elasticForces(mesh, tets.displacements());
        for (std::size_t i = 0; i < forces.size(); ++i) {
            const double away = glm::distance(mesh.points[i] + Vec3(tets.displacements()[i]), p.centreAt(3e-3));
            if (mesh.held[i] == 0 && mesh.outer[i] != 0 && away < p.radius() + 1e-5) {
                onTool += forces[i];
            } else if (mesh.held[i] == 0) {
                unbalanced += glm::dot(forces[i], forces[i]);
            }
        }
        EXPECT_NEAR(glm::length(tets.force()) / glm::length(onTool), 1.0, substeps == 5 ? 0.2 : 0.03);
        off.push_back(std::sqrt(unbalanced) / glm::length(onTool));
    }
    EXPECT_LT(off[1], 0.03);
    EXPECT_LT(off[1], 0.5 * off[0]);
}

// At a small depth finite strain is small strain: lambda and mu mean the same to both.
TEST(Xpbd, IsLinearElasticityWhereStrainsAreSmall)
{
    const auto& p = tetPressed();
    const TetBody mesh = p.mesh(3e-3, 0.45);
    constexpr double depth = 0.15e-3;
    const Xpbd tets = settled(mesh, depth, 20);
    FactoredTets linear(mesh, p.path);
    linear.press(p.centreAt(depth), p.radius());
    EXPECT_GT(glm::length(linear.force()), 0.0);
    EXPECT_NEAR(glm::length(tets.force()) / glm::length(linear.force()), 1.0, 0.03);
    const Vec3 under = p.place.entry + 1e-3 * p.path.inward;
    EXPECT_NEAR(glm::length(tets.displacement(under)) / glm::length(linear.displacement(under)), 1.0, 0.03);
}

TEST(TetBaselines, EveryOneIsBetterThanNothing)
{
    const auto& p = tetPressed();
    const TrialBody body = trialBody(*p.model.tissue, p.model.surface, 2e-3, 0.49, 1U << 20);
    const std::array speeds{tetSpeed};
    const Reference reference = solveReference(body.body, p.path, speeds, {.law = volume::NeoHookean{}});
    const double nothing = spreadOf(runTrial(nothingModel(), p.path, tetSpeed, reference).looks, &TrialErrors::near).median;
    std::map<std::string, int> methods;
    for (const Baseline& b : tetBaselines({*p.model.tissue, p.model.surface, p.path})) {
        ++methods[b.method];
        if (b.setting.starts_with("6 mm")) {
            continue;  // a sphere of 5 mm falls between the points
        }
        const TrialResult result = runTrial(b.build(), p.path, tetSpeed, reference);
        EXPECT_LT(spreadOf(result.looks, &TrialErrors::near).median, 0.5 * nothing) << b.method << " " << b.setting;
        EXPECT_GT(result.meanTouched, 0.5) << b.method << " " << b.setting;
    }
    EXPECT_GE(methods["tets_prefactored"], 3);
    EXPECT_GE(methods["xpbd"], 4);
}

TEST(TetBaselines, ANeedleIsNoSphere)
{
    const auto& p = tetPressed();
    const TrialPath needle = trialPath(*p.model.tissue, p.model.surface, p.place, trialTools()[2], 2e-3);
    EXPECT_THROW(factoredModel(p.mesh(3e-3, 0.45), needle), std::runtime_error);
}

}  // namespace
}  // namespace palpate::studies
