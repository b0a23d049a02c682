#include <datasets/phantom.h>
#include <datasets/tables.h>
#include <reference/mesh_parts.h>
#include <reference/mesher.h>
#include <tests/error_of.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

namespace palpate::reference {
namespace {

using Numbers = std::map<std::string, double>;

volume::Tissue phantom(const std::string& name, const Numbers& numbers)
{
    datasets::PhantomSpec spec;
    spec.name = name;
    spec.numbers = numbers;
    return datasets::makePhantom(spec, datasets::defaultTissues());
}

MeshOptions coarse()
{
    MeshOptions options;
    options.radius = 5e-3;
    options.size = 2e-3;
    options.largest = 8e-3;
    return options;
}

constexpr double width = 40e-3, thickness = 30e-3;  // of the block [m]
constexpr double radius = 6e-3;                     // of the ball in it [m]
const Vec3 centre(0.0, 14e-3, 0.0);                 // [m]

const volume::Tissue& block()
{
    static const volume::Tissue tissue = phantom("block", {{"width_mm", 1e3 * width},
                                                           {"thickness_mm", 1e3 * thickness},
                                                           {"tumour_diameter_mm", 2e3 * radius},
                                                           {"tumour_centre_mm", 1e3 * centre.y}});
    return tissue;
}

const BodyMesh& blockMesh()
{
    static const BodyMesh body = meshBody(block(), coarse());
    return body;
}

const volume::Tissue& layers()
{
    static const volume::Tissue tissue = phantom("layered", {{"width_mm", 30},
                                                             {"skin_mm", 2},
                                                             {"fat_mm", 6},
                                                             {"gland_mm", 8},
                                                             {"muscle_mm", 0},
                                                             {"bone_mm", 3},
                                                             {"tumours", 0}});
    return tissue;
}

const BodyMesh& layersMesh()
{
    static const BodyMesh body = meshBody(layers(), coarse());
    return body;
}

double areaOf(const TetMesh& mesh, const TetMesh::Face& face)
{
    const Vec3 a = mesh.points[face.points[0]];
    return 0.5 * glm::length(glm::cross(mesh.points[face.points[1]] - a, mesh.points[face.points[2]] - a));
}

// Points that tetrahedra of both tissues have.
std::set<std::uint32_t> sharedPoints(const TetMesh& mesh, std::uint8_t a, std::uint8_t b)
{
    std::set<std::uint32_t> ofA, shared;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        if (mesh.tissue[t] == a) {
            ofA.insert(mesh.tets[t].begin(), mesh.tets[t].end());
        }
    }
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        if (mesh.tissue[t] == b) {
            std::ranges::copy_if(mesh.tets[t], std::inserter(shared, shared.end()),
                                 [&](std::uint32_t p) { return ofA.contains(p); });
        }
    }
    return shared;
}

std::uint8_t rowOf(const volume::Tissue& tissue, const std::string& name)
{
    return tissue.table().find(name).value();
}

TEST(SmoothLabels, KeepTheVolumesOfTheVoxels)
{
    const SmoothLabels labels = smoothLabels(block());
    std::vector<double> volume(labels.rows.size(), 0.0);
    constexpr double step = 0.2e-3;
    volume::forEachIndex(Index3(-100, 0, -100), Index3(99, 149, 99), [&](Index3 n) {
        const int region = regionAt(labels, step * (Vec3(n) + 0.5));
        ASSERT_GE(region, 0);
        volume[static_cast<std::size_t>(region)] += step * step * step;
    });
    for (std::size_t r = 0; r < volume.size(); ++r) {
        EXPECT_NEAR(volume[r] / labels.volume[r], 1.0, 5e-3);
    }
}

// A body of 40 x 30 x 40 voxels ends half a voxel beyond the last centre, on all sides.
TEST(SmoothLabels, EndExactlyAtTheFacesOfTheVoxels)
{
    const SmoothLabels labels = smoothLabels(block());
    constexpr double little = 1e-9;
    for (const Vec3 side : {Vec3(width / 2, 15e-3, 3e-3), Vec3(-width / 2, 15e-3, 3e-3), Vec3(3e-3, 15e-3, width / 2)}) {
        const Vec3 outwards = glm::normalize(side * Vec3(1, 0, 1)) * little;
        const Vec3 across = Vec3(std::abs(side.x) > 0.01, 0, std::abs(side.z) > 0.01) * outwards;
        EXPECT_GE(regionAt(labels, side - across), 0);
        EXPECT_EQ(regionAt(labels, side + across), -1);
    }
    EXPECT_GE(regionAt(labels, Vec3(0, little, 0)), 0);
    EXPECT_EQ(regionAt(labels, Vec3(0, -little, 0)), -1);
    EXPECT_GE(regionAt(labels, Vec3(0, thickness - little, 0)), 0);
    EXPECT_EQ(regionAt(labels, Vec3(0, thickness + little, 0)), -1);
}

TEST(Mesher, KeepsTheVolumeOfEveryTissue)
{
    for (const BodyMesh* body : {&blockMesh(), &layersMesh()}) {
        ASSERT_GE(body->rows.size(), 2U);
        for (std::size_t r = 0; r < body->rows.size(); ++r) {
            EXPECT_NEAR(body->volume[r] / body->voxels[r], 1.0, 0.01);
        }
        EXPECT_EQ(body->dropped, 0.0);
    }
}

TEST(Mesher, TurnsAllTetrahedraTheRightWayAndMakesNoSlivers)
{
    for (const BodyMesh* body : {&blockMesh(), &layersMesh()}) {
        ASSERT_GT(body->mesh.tets.size(), 1000U);
        for (std::size_t t = 0; t < body->mesh.tets.size(); ++t) {
            ASSERT_GT(sixVolumes(body->mesh, t), 0.0);
        }
        EXPECT_GT(body->sharpest, 5.0);
    }
}

// A staircase of voxels is off by up to 0.87 of their edge (1 mm). The voxels' volume is not quite the ball's.
TEST(Mesher, MakesABallOfVoxelsRound)
{
    const BodyMesh& body = blockMesh();
    const TetMesh& mesh = body.mesh;
    const auto shared = sharedPoints(mesh, rowOf(block(), "fat"), rowOf(block(), "idc_high_grade"));
    ASSERT_GT(shared.size(), 50U);
    const auto ball =
        static_cast<std::size_t>(std::ranges::find(body.rows, rowOf(block(), "idc_high_grade")) - body.rows.begin());
    const double same = std::cbrt(body.voxels[ball] * 3.0 / (4.0 * std::numbers::pi));
    double worst = 0.0, square = 0.0;
    for (const std::uint32_t p : shared) {
        const double off = glm::distance(mesh.points[p], centre) - same;
        worst = std::max(worst, std::abs(off));
        square += off * off;
    }
    EXPECT_LT(worst, 0.35e-3);
    EXPECT_LT(std::sqrt(square / static_cast<double>(shared.size())), 0.15e-3);
}

// Six flat faces and sharp edges between them: the area is that of the box, and no point lies elsewhere.
TEST(Mesher, KeepsFlatFacesFlatAndEdgesSharp)
{
    const TetMesh& mesh = blockMesh().mesh;
    double area = 0.0;
    for (const auto& face : mesh.faces) {
        area += areaOf(mesh, face);
        for (const std::uint32_t i : face.points) {
            const Vec3 p = mesh.points[i];
            const double off = std::min({std::abs(std::abs(p.x) - width / 2), std::abs(std::abs(p.z) - width / 2),
                                         std::abs(p.y), std::abs(p.y - thickness)});
            ASSERT_LT(off, 1e-9);
        }
    }
    EXPECT_NEAR(area, 2 * width * width + 4 * width * thickness, 1e-9);
}

TEST(Mesher, ClosesTheSurface)
{
    for (const BodyMesh* body : {&blockMesh(), &layersMesh()}) {
        std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
        for (const auto& face : body->mesh.faces) {
            for (std::size_t i = 0; i < 3; ++i) {
                ++edges[{face.points[i], face.points[(i + 1) % 3]}];
            }
        }
        // Once each way: closed, and all faces turned alike.
        for (const auto& [edge, count] : edges) {
            ASSERT_EQ(count, 1);
            ASSERT_EQ((edges.count({edge.second, edge.first})), 1U);
        }
    }
}

TEST(Mesher, TurnsFacesOutwards)
{
    const TetMesh& mesh = blockMesh().mesh;
    double sixfold = 0.0;
    for (const auto& face : mesh.faces) {
        sixfold +=
            glm::dot(mesh.points[face.points[0]], glm::cross(mesh.points[face.points[1]], mesh.points[face.points[2]]));
    }
    EXPECT_NEAR(sixfold / 6.0, width * width * thickness, 1e-9);
}

TEST(Mesher, HoldsWhatLooksAtBoneAndNothingElse)
{
    const TetMesh& mesh = blockMesh().mesh;
    double area = 0.0;
    for (const auto& face : mesh.faces) {
        const bool base = std::ranges::all_of(face.points, [&](auto p) { return mesh.points[p].y > thickness - 1e-9; });
        EXPECT_EQ(face.held, base);
        area += face.held ? areaOf(mesh, face) : 0.0;
    }
    EXPECT_NEAR(area, width * width, 1e-9);
}

TEST(Mesher, KeepsBordersBetweenLayersFlat)
{
    const TetMesh& mesh = layersMesh().mesh;
    const auto check = [&](const char* front, const char* back, double y) {
        const auto shared = sharedPoints(mesh, rowOf(layers(), front), rowOf(layers(), back));
        ASSERT_GT(shared.size(), 100U);
        for (const std::uint32_t p : shared) {
            ASSERT_NEAR(mesh.points[p].y, y, 0.03e-3) << front << " on " << back;
        }
    };
    check("skin", "fat", 2e-3);
    check("fat", "gland", 8e-3);
}

// Skin of 2 mm: all of the front is skin, and none of the rest of the body comes nearer to it than that.
TEST(Mesher, KeepsThinLayersWhole)
{
    const TetMesh& mesh = layersMesh().mesh;
    double front = 0.0;
    for (const auto& face : mesh.faces) {
        if (std::ranges::all_of(face.points, [&](auto p) { return mesh.points[p].y < 1e-9; })) {
            EXPECT_EQ(mesh.tissue[face.tet], rowOf(layers(), "skin"));
            front += areaOf(mesh, face);
        }
    }
    EXPECT_NEAR(front, 30e-3 * 30e-3, 1e-9);
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        if (mesh.tissue[t] != rowOf(layers(), "skin")) {
            ASSERT_TRUE(std::ranges::all_of(mesh.tets[t], [&](auto p) { return mesh.points[p].y > 1.9e-3; }));
        }
    }
}

TEST(Mesher, IsFineAtTheContactAndCoarseFarAway)
{
    const TetMesh& mesh = blockMesh().mesh;
    const MeshOptions options = coarse();
    double sum = 0.0, longest = 0.0;
    std::size_t count = 0;
    for (const auto& tet : mesh.tets) {
        for (std::size_t i = 1; i < 4; ++i) {
            const Vec3 a = mesh.points[tet[0]], b = mesh.points[tet[i]];
            longest = std::max(longest, glm::distance(a, b));
            if (edgeLength(options, 0.5 * (a + b)) < 1.01 * options.size) {
                sum += glm::distance(a, b);
                ++count;
            }
        }
    }
    EXPECT_NEAR(sum / static_cast<double>(count), options.size, 0.15 * options.size);
    EXPECT_GT(longest, 3 * options.size);
}

// With few tetrahedra allowed, skin far from the contact is mixed with the fat behind it: between both, and no tissue lost.
TEST(Mesher, MixesThinTissuesFarAwayWhenThereAreTooMany)
{
    MeshOptions options = coarse();
    options.radius = 1e-3;
    options.from = options.to = Vec3(-15e-3, 0, -15e-3);
    options.most = 1;
    const BodyMesh body = meshBody(layers(), options);
    const auto& rows = layers().table().rows;
    ASSERT_GT(body.mixtures.size(), 0U);
    for (const Material& m : body.mixtures) {
        EXPECT_GT(m.youngsModulus, rows[rowOf(layers(), "gland")].youngsModulus);
        EXPECT_LT(m.youngsModulus, rows[rowOf(layers(), "skin")].youngsModulus);
        EXPECT_GE(m.poisson, 0.48 - 1e-12);
        EXPECT_LE(m.poisson, 0.49 + 1e-12);
    }
    const auto last = *std::ranges::max_element(body.mesh.tissue);
    EXPECT_EQ(last, rows.size() + body.mixtures.size() - 1);
    for (std::size_t r = 0; r < body.rows.size(); ++r) {
        EXPECT_NEAR(body.volume[r] / body.voxels[r], 1.0, 0.06);
    }
}

// Mixtures are numbered on from the table's rows, in a byte: a full table leaves no number for them.
TEST(Mesher, RefusesMoreMaterialsThanItCanNumber)
{
    volume::TissueTable table = datasets::defaultTissues();
    while (table.rows.size() < 256) {
        table.rows.push_back(table.rows.back());
        table.rows.back().name = "spare" + std::to_string(table.rows.size());
    }
    datasets::PhantomSpec spec;
    spec.name = "layered";
    spec.numbers = {{"width_mm", 30}, {"skin_mm", 2}, {"fat_mm", 6}, {"gland_mm", 8}, {"bone_mm", 3}, {"tumours", 0}};
    MeshOptions options = coarse();
    options.radius = 1e-3;
    options.from = options.to = Vec3(-15e-3, 0, -15e-3);
    options.most = 1;
    const auto error = tests::errorOf([&] { meshBody(datasets::makePhantom(spec, table), options); });
    EXPECT_NE(error.find("256 rows of the tissue table and "), std::string::npos) << error;
    EXPECT_NE(error.find("more than 256 materials"), std::string::npos) << error;
}

TEST(Mesher, GivesTheSameBitsAgain)
{
    MeshOptions options = coarse();
    options.volumePasses = 0;
    const BodyMesh a = meshBody(layers(), options), b = meshBody(layers(), options);
    EXPECT_EQ(a.mesh.points, b.mesh.points);
    EXPECT_EQ(a.mesh.tets, b.mesh.tets);
    EXPECT_EQ(a.mesh.tissue, b.mesh.tissue);
}

// Without its base the block ends at 95 % of its depth, and is held there.
TEST(Mesher, LaysABodyThatNothingHoldsOnItsBack)
{
    volume::TissueTable table = datasets::defaultTissues();
    table.rows[table.find("bone").value()].role = volume::Role::air;
    table.rows[table.find("bone").value()].fixed = false;
    datasets::PhantomSpec spec;
    spec.name = "block";
    spec.numbers = {{"width_mm", 20}, {"thickness_mm", 20}, {"tumours", 0}};
    const BodyMesh body = meshBody(datasets::makePhantom(spec, table), coarse());
    double held = 0.0;
    for (const auto& face : body.mesh.faces) {
        if (face.held) {
            held += areaOf(body.mesh, face);
            EXPECT_NEAR(body.mesh.points[face.points[0]].y, 19e-3, 1e-6);
        }
    }
    EXPECT_NEAR(held, 20e-3 * 20e-3, 1e-6);
}

// Its rear layer is held: with one layer only there would be nothing left that moves.
TEST(SmoothLabels, RefuseABodyOfOneLayerThatNothingHolds)
{
    for (const double towardsTheBack : {1.0, -1.0}) {
        volume::LabelImage image;
        image.size = {8, 1, 6};
        image.affine.linear = Mat3(Vec3(1e-3, 0, 0), Vec3(0, towardsTheBack * 1e-3, 0), Vec3(0, 0, 1e-3));
        image.values.assign(48, 1);
        const std::vector<volume::LabelName> names{{1, "fat", "fat"}};
        const auto tissue = volume::Tissue::fromLabels(image, datasets::defaultTissues(), names, {});
        const auto error = tests::errorOf([&] { smoothLabels(tissue); });
        EXPECT_NE(error.find("one voxel thick from front to back"), std::string::npos) << error;
        EXPECT_NO_THROW(smoothLabels(tissue, Keep::all));
    }
}

TEST(Mesher, SaysWhatIsMissingWhereThereIsNothingToMesh)
{
    volume::TissueTable table = datasets::defaultTissues();
    table.rows[table.find("fat").value()].fixed = true;
    datasets::PhantomSpec spec;
    spec.name = "block";
    spec.numbers = {{"width_mm", 20}, {"thickness_mm", 10}, {"tumours", 0}};
    EXPECT_THROW(meshBody(datasets::makePhantom(spec, table), coarse()), std::runtime_error);
}

}  // namespace
}  // namespace palpate::reference
