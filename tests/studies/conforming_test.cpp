#include <studies/accuracy/conforming.h>
#include <studies/kernel/baselines/factored.h>

#include <tests/error_of.h>
#include <tests/studies/small_block.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <string>

namespace palpate::studies {
namespace {

const std::filesystem::path mesher = std::string(PALPATE_BIN_DIR) + "/palpate-mesh";
constexpr std::size_t plenty = 1U << 20;

struct Meshed {
    haptics::SessionModel model = smallBlock();
    TetBody body = conformingTets(mesher, *model.tissue, 5e-3, 0.45, plenty);
};

const Meshed& meshed()
{
    static const Meshed m;
    return m;
}

// Tissues are told apart by their moduli; volumes are those of the voxels, within a percent.
TEST(ConformingTets, EveryTissueHasItsVolumeAndItsStiffness)
{
    const auto& m = meshed();
    std::map<double, double> volumes;  // by mu [m^3]
    for (std::size_t t = 0; t < m.body.tets.size(); ++t) {
        const double volume = shapeOf(m.body, t).volume;
        ASSERT_GT(volume, 0.0) << t;
        volumes[m.body.mu[t]] += volume;
    }
    std::map<double, double> voxels;
    const volume::Tissue& tissue = *m.model.tissue;
    const double voxel = 1e-3;
    const volume::Tissue::Reader reader(tissue);
    const volume::Box box = tissue.box();
    const Index3 size(glm::round((box.high - box.low) / voxel));
    volume::forEachIndex(Index3(0), size - 1, [&](Index3 n) {
        const auto& row = tissue.table().rows[reader.tissue(box.low + (Vec3(n) + 0.5) * voxel)];
        if (row.role != volume::Role::air) {
            const double nu = std::min(row.poissonRatio, 0.45);
            voxels[row.youngsModulus / (2.0 * (1.0 + nu))] += voxel * voxel * voxel;
        }
    });
    ASSERT_EQ(volumes.size(), voxels.size());
    for (const auto& [mu, volume] : voxels) {
        EXPECT_NEAR(volumes[mu], volume, 0.01 * volume) << mu;
    }
}

TEST(ConformingTets, EveryPlaceIsFoundInItsTetrahedron)
{
    const TetBody& body = meshed().body;
    for (std::size_t t = 0; t < body.tets.size(); t += 7) {
        const auto& tet = body.tets[t];
        const Vec3 middle = 0.25 * (body.points[tet[0]] + body.points[tet[1]] + body.points[tet[2]] + body.points[tet[3]]);
        const TetPlace place = placeOf(body, middle);
        EXPECT_EQ(place.points, tet) << t;
        EXPECT_LT(glm::distance(valueAt(place, [&](std::uint32_t p) { return body.points[p]; }), middle), 1e-9);
    }
}

// Two meshes of one body, one law: where strains are small their forces differ by what a mesh costs.
TEST(ConformingTets, TheirForceIsThatOfTheLattice)
{
    const auto& m = meshed();
    const TrialPlace place = trialPlace(*m.model.tissue, m.model.surface, m.model.approach.entry, m.model.approach.aim);
    const TrialPath path = trialPath(*m.model.tissue, m.model.surface, place, trialTools()[1], 2e-3);
    FactoredTets lattice(latticeTets(*m.model.tissue, m.model.surface, 3e-3, 0.45), path);
    FactoredTets conforming(conformingTets(mesher, *m.model.tissue, 3e-3, 0.45, plenty), path);
    const Vec3 centre = path.at({path.gap + 3e-3, 0.0});
    lattice.press(centre, path.tool.radius);
    conforming.press(centre, path.tool.radius);
    EXPECT_GT(glm::length(conforming.force()), 0.0);
    EXPECT_NEAR(glm::length(conforming.force()) / glm::length(lattice.force()), 1.0, 0.08);
}

TEST(ConformingTets, WhatCannotBeMeshedIsSaidOnOneLine)
{
    const auto& tissue = *meshed().model.tissue;
    const auto said = [&](const std::filesystem::path& program, double size, std::size_t points) {
        return tests::errorOf([&] { conformingTets(program, tissue, size, 0.45, points); });
    };
    for (const std::string& text :
         {said(mesher, 5e-3, 10), said("/nowhere/palpate-mesh", 5e-3, plenty), said(mesher, -1.0, plenty)}) {
        EXPECT_GT(text.size(), 20U);
        EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    }
}

}  // namespace
}  // namespace palpate::studies
