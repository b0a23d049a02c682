#include <base/inputs.h>
#include <datasets/tables.h>
#include <reference/box_mesh.h>
#include <reference/ccx.h>
#include <reference/mesh_files.h>
#include <reference/mesh_improve.h>
#include <reference/mesh_parts.h>
#include <reference/mesh_quality.h>
#include <reference/mesh_swap.h>
#include <reference/surfaces.h>
#include <reference/tetgen_mesh.h>
#include <tests/folder.h>

#include <gtest/gtest.h>
#include <vtkCell.h>
#include <vtkCellData.h>
#include <vtkDataArray.h>
#include <vtkNew.h>
#include <vtkUnstructuredGrid.h>
#include <vtkUnstructuredGridReader.h>
#include <vtkXMLUnstructuredGridReader.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <random>
#include <set>

namespace palpate::reference {
namespace {

const char* const mesher = PALPATE_BIN_DIR "/palpate-mesh";

TetGenOptions tetgen()
{
    TetGenOptions options;
    options.program = mesher;
    return options;
}

// A cube of 30 mm of tissue 1 with a cube of 10 mm in its middle.
TetMesh cubeInCube(std::uint8_t inner)
{
    std::vector<double> ends;
    for (int i = 0; i <= 6; ++i) {
        ends.push_back(5e-3 * i);
    }
    BoxMeshOptions box;
    box.tissue = [inner](Vec3 p) {
        const Vec3 off = glm::abs(p - Vec3(15e-3));
        return std::max({off.x, off.y, off.z}) < 5e-3 ? inner : std::uint8_t{1};
    };
    return boxMesh(ends, ends, ends, box);
}

// As cubeInCube(), with nothing in the middle.
TetMesh hollowCube()
{
    const TetMesh whole = cubeInCube(2);
    TetMesh mesh;
    mesh.points = whole.points;
    for (std::size_t t = 0; t < whole.tets.size(); ++t) {
        if (whole.tissue[t] == 1) {
            mesh.tets.push_back(whole.tets[t]);
            mesh.tissue.push_back(1);
        }
    }
    return mesh;
}

using Corners = std::array<Vec3, 3>;

std::set<std::array<std::array<double, 3>, 3>> facetPlaces(const Surfaces& s)
{
    std::set<std::array<std::array<double, 3>, 3>> out;
    for (const auto& f : s.facets) {
        std::array<std::array<double, 3>, 3> at{};
        std::ranges::transform(f.points, at.begin(), [&](auto p) {
            return std::array<double, 3>{s.points[p].x, s.points[p].y, s.points[p].z};
        });
        std::ranges::sort(at);
        out.insert(at);
    }
    return out;
}

// Each facet once: a cube of 6 x 6 squares a side, and one of 2 x 2 in it.
TEST(Surfaces, HoldEachFacetOnceAndEncloseTheVolumes)
{
    const Surfaces s = surfacesOf(cubeInCube(2));
    EXPECT_EQ(s.facets.size(), 2U * 6 * (36 + 4));
    EXPECT_EQ(facetPlaces(s).size(), s.facets.size());
    const auto volume = enclosedVolumes(s);
    EXPECT_NEAR(volume[1], 26e-6, 1e-15);
    EXPECT_NEAR(volume[2], 1e-6, 1e-15);
    EXPECT_EQ(volume[Surfaces::outside], 0.0);
}

TEST(Surfaces, HaveASeedInEveryPiece)
{
    // The diagonal through the cube's corners is left to tissue 1 by a plane of tissue 3 that cuts it in two.
    TetMesh mesh = cubeInCube(2);
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        double x = 0.0;
        for (const auto p : mesh.tets[t]) {
            x += 0.25 * mesh.points[p].x;
        }
        if (x > 20e-3 && x < 25e-3) {
            mesh.tissue[t] = 3;
        }
    }
    std::map<std::uint8_t, int> seeds;
    for (const auto& seed : surfacesOf(mesh).seeds) {
        ++seeds[seed.tissue];
    }
    EXPECT_EQ(seeds, (std::map<std::uint8_t, int>{{1, 2}, {2, 1}, {3, 1}}));
}

TEST(TetGen, KeepsFacetsVolumesAndTissues)
{
    const Surfaces s = surfacesOf(cubeInCube(2));
    TetGenOptions options = tetgen();
    options.largest = 6e-3;
    const TetMesh mesh = fillSurfaces(s, options);
    EXPECT_GT(mesh.tets.size(), 500U);
    EXPECT_EQ(facetPlaces(surfacesOf(mesh)), facetPlaces(s));
    const std::array<std::uint8_t, 2> rows{1, 2};
    const auto volume = volumesOf(mesh, rows);
    EXPECT_NEAR(volume[0], 26e-6, 1e-14);
    EXPECT_NEAR(volume[1], 1e-6, 1e-14);
}

// TetGen fills the convex hull, hollows too: those have no seed and are left out.
TEST(TetGen, LeavesHollowsEmpty)
{
    const Surfaces s = surfacesOf(hollowCube());
    const TetMesh mesh = fillSurfaces(s, tetgen());
    EXPECT_EQ(facetPlaces(surfacesOf(mesh)), facetPlaces(s));
    EXPECT_NEAR(volumesOf(mesh, std::array<std::uint8_t, 1>{1})[0], 26e-6, 1e-14);
}

// Points of the surfaces that no facet has are points of the mesh: what grades it.
TEST(TetGen, TakesPointsInside)
{
    const TetMesh from = cubeInCube(2);
    const Surfaces s = surfacesOf(from, AllPoints::yes);
    ASSERT_EQ(s.points.size(), 343U);
    ASSERT_LT(surfacesOf(from).points.size(), 300U);
    const TetMesh mesh = fillSurfaces(s, tetgen());
    std::set<std::array<double, 3>> places;
    for (const Vec3 p : mesh.points) {
        places.insert({p.x, p.y, p.z});
    }
    for (const Vec3 p : from.points) {
        ASSERT_TRUE(places.contains({p.x, p.y, p.z}));
    }
}

// Two cubes that stick in each other are no complex: one line says so, and `-d` names the facets.
TEST(TetGen, RefusesSurfacesThatCross)
{
    Surfaces s = surfacesOf(cubeInCube(1));
    Surfaces other = s;
    for (Vec3& p : other.points) {
        p += Vec3(11.3e-3, 7.1e-3, 3.7e-3);
    }
    const auto shift = static_cast<std::uint32_t>(s.points.size());
    s.points.insert(s.points.end(), other.points.begin(), other.points.end());
    for (auto f : other.facets) {
        std::ranges::transform(f.points, f.points.begin(), [&](auto p) { return p + shift; });
        s.facets.push_back(f);
    }
    s.seeds.push_back(other.seeds.front());
    try {
        fillSurfaces(s, tetgen());
        ADD_FAILURE() << "no refusal";
    } catch (const std::runtime_error& e) {
        EXPECT_NE(std::string(e.what()).find("facets cross others"), std::string::npos) << e.what();
        EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    }
    const auto crossing = crossingFacets(s, tetgen());
    EXPECT_GT(crossing.size(), 20U);
    EXPECT_LT(crossing.size(), s.facets.size() / 2);
    EXPECT_TRUE(crossingFacets(surfacesOf(cubeInCube(2)), tetgen()).empty());
}

// A process that dies, or never ends, is a line of text.
TEST(TetGen, BreakdownOfItsProcessIsAnError)
{
    const tests::Folder folder;
    const auto run = [&](const char* script, double seconds) {
        const auto file = folder.path() / "program";
        std::ofstream(file) << "#!/bin/sh\n" << script << "\n";
        std::filesystem::permissions(file, std::filesystem::perms::owner_all);
        TetGenOptions options;
        options.program = file;
        options.seconds = seconds;
        try {
            fillSurfaces(surfacesOf(cubeInCube(2)), options);
        } catch (const std::runtime_error& e) {
            return std::string(e.what());
        }
        return std::string("no error");
    };
    EXPECT_NE(run("kill -SEGV $$", 60).find("crashed"), std::string::npos);
    EXPECT_NE(run("exec sleep 60", 0.2).find("took over 0.2 s"), std::string::npos);
    EXPECT_NE(run("exit 0", 60).find("no whole job"), std::string::npos);
}

// The dihedral angle of a regular tetrahedron is acos(1/3); a corner of a cube has 90 degrees and acos(1/sqrt 3).
TEST(MeshQuality, HasTheAnglesOfKnownTetrahedra)
{
    TetMesh mesh;
    mesh.points = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}, {10, 0, 0}, {11, 0, 0}, {10, 1, 0}, {10, 0, 1}};
    mesh.tets = {{0, 1, 2, 3}, {4, 5, 6, 7}};
    mesh.tissue = {1, 1};
    if (sixVolumes(mesh, 0) < 0.0) {
        std::swap(mesh.tets[0][0], mesh.tets[0][1]);
    }
    const double degrees = 180.0 / std::numbers::pi;
    EXPECT_NEAR(dihedralsOf(mesh, 0).first, std::acos(1.0 / 3.0) * degrees, 1e-9);
    EXPECT_NEAR(dihedralsOf(mesh, 0).second, std::acos(1.0 / 3.0) * degrees, 1e-9);
    const MeshQuality q = qualityOf(mesh, {{1, 3.0, 0.0, 5.0}}, 1.0);
    EXPECT_NEAR(q.minDihedral, std::acos(1.0 / std::sqrt(3.0)) * degrees, 1e-9);
    EXPECT_NEAR(q.largestDihedral, 90.0, 1e-9);
    EXPECT_EQ(q.worst, 1U);
    EXPECT_NEAR(q.worstRadii, 3.0 * (1.0 / (3.0 + std::sqrt(3.0))) / (0.5 * std::sqrt(3.0)), 1e-9);
    EXPECT_EQ(q.outside, 8U);
    EXPECT_NEAR(q.tissues[0].percent(), 100.0 * ((8.0 / 3.0 + 1.0 / 6.0) / 3.0 - 1.0), 1e-9);
    EXPECT_FALSE(q.tissues[0].thin);
    EXPECT_EQ(q.flipped + q.overShared, 0U);
}

TEST(MeshQuality, CountsWhatIsFlippedAndSharedByThree)
{
    TetMesh mesh;
    mesh.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 2}, {0, 0, -1}};
    mesh.tets = {{0, 1, 2, 3}, {0, 1, 2, 4}, {0, 1, 2, 5}};
    mesh.tissue = {1, 1, 2};
    const MeshQuality q = qualityOf(mesh, {}, 1.0);
    EXPECT_EQ(q.flipped, 1U);
    EXPECT_EQ(q.overShared, 1U);
}

// Six tetrahedra a cell, points inside moved at random so that none turns over.
TetMesh jittered(std::uint8_t inner, double most, std::uint32_t seed)
{
    TetMesh mesh = cubeInCube(inner);
    std::set<std::uint32_t> fixed;
    for (const auto& f : surfacesOf(mesh, AllPoints::yes).facets) {
        fixed.insert(f.points.begin(), f.points.end());
    }
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> by(-most, most);
    for (std::uint32_t p = 0; p < mesh.points.size(); ++p) {
        const Vec3 from = mesh.points[p];
        mesh.points[p] += fixed.contains(p) ? Vec3(0.0) : Vec3(by(random), by(random), by(random));
        if (qualityOf(mesh, {}, 1.0).flipped > 0) {
            mesh.points[p] = from;
        }
    }
    return mesh;
}

// Whatever is swapped, moved or contracted: the same place is filled, once, and no angle is worse than the worst before.
TEST(MeshImprove, KeepsTheBodyAndRaisesTheWorstAngle)
{
    for (std::uint32_t seed = 1; seed <= 4; ++seed) {
        TetMesh mesh = jittered(2, 4e-3, seed);
        const MeshQuality before = qualityOf(mesh, {}, 1.0);
        ASSERT_LT(before.minDihedral, 5.0);
        improveAngles(mesh, 20.0, Moving::surfaces);
        const MeshQuality after = qualityOf(mesh, {}, 1.0);
        EXPECT_GT(after.minDihedral, 12.0) << seed;
        EXPECT_LT(after.largestDihedral, 168.0) << seed;
        EXPECT_EQ(after.flipped + after.overShared, 0U);
        const auto volume = volumesOf(mesh, std::array<std::uint8_t, 2>{1, 2});
        EXPECT_NEAR(volume[0] + volume[1], 27e-6, 1e-15);
        EXPECT_NEAR(volume[1], 1e-6, 2e-8);
    }
}

// Two points of a surface in one place, as surface nets may have them: facets there have no normal, and no end was found.
TEST(MeshImprove, FacetsWithoutAreaHoldTheirPoints)
{
    TetMesh mesh = jittered(2, 4e-3, 1);
    const auto facet = surfacesOf(mesh, AllPoints::yes).facets[20].points;
    mesh.points[facet[1]] = mesh.points[facet[0]];
    const Vec3 place = mesh.points[facet[0]];
    improveAngles(mesh, 20.0, Moving::surfaces);
    EXPECT_TRUE(std::ranges::any_of(mesh.points, [&](Vec3 p) { return p == place; }));
    for (const Vec3 p : mesh.points) {
        EXPECT_TRUE(std::isfinite(p.x + p.y + p.z));
    }
}

// Without moves, and surfaces as they are, as long as no tetrahedron goes over to another tissue.
TEST(MeshImprove, SwapsAloneLeaveSurfacesAndVolumes)
{
    TetMesh mesh = jittered(1, 4e-3, 9);
    const auto facets = facetPlaces(surfacesOf(mesh));
    const double before = qualityOf(mesh, {}, 1.0).minDihedral;
    EXPECT_GT(swapBad(mesh, 15.0), 10U);
    const MeshQuality after = qualityOf(mesh, {}, 1.0);
    EXPECT_GT(after.minDihedral, before);
    EXPECT_EQ(after.flipped + after.overShared, 0U);
    EXPECT_EQ(facetPlaces(surfacesOf(mesh)), facets);
    EXPECT_NEAR(volumesOf(mesh, std::array<std::uint8_t, 1>{1})[0], 27e-6, 1e-15);
}

// Two slivers in a plane of a cube, each a piece of its own tissue: one goes over to what it lies in, the last one stays.
TEST(MeshImprove, SliversOfTheirOwnGoToTheirNeighbour)
{
    TetMesh mesh = cubeInCube(1);
    std::size_t made = 0;
    for (std::size_t t = 200; t < mesh.tets.size() && made < 2; t += 700, ++made) {
        // The middle of an edge's opposite, nearly in the edge: a thin one, with three more around it.
        const auto tet = mesh.tets[t];
        Vec3 middle(0.0);
        for (const auto p : tet) {
            middle += 0.25 * mesh.points[p];
        }
        const Vec3 face = (mesh.points[tet[1]] + mesh.points[tet[2]] + mesh.points[tet[3]]) / 3.0;
        mesh.points.push_back(face + 0.02 * (middle - face));
        const auto fresh = static_cast<std::uint32_t>(mesh.points.size() - 1);
        for (std::size_t i = 0; i < 4; ++i) {
            auto part = tet;
            part[i] = fresh;
            (i == 0 ? mesh.tets[t] : mesh.tets.emplace_back()) = part;
            if (i > 0) {
                mesh.tissue.push_back(mesh.tissue[t]);
            }
        }
        mesh.tissue[t] = 7;
    }
    ASSERT_EQ(made, 2U);
    ASSERT_EQ(std::ranges::count(mesh.tissue, 7), 2);
    swapBad(mesh, 4.0);
    EXPECT_EQ(std::ranges::count(mesh.tissue, 7), 1);
    const MeshQuality q = qualityOf(mesh, {}, 1.0);
    EXPECT_EQ(q.flipped + q.overShared, 0U);
}

// A small mesh of two tissues, as every kind of file.
class MeshFiles : public testing::Test {
protected:
    MeshFiles() : mesh_(cubeInCube(2))
    {
        table_ = datasets::defaultTissues();
        rows_ = {table_.rows[1].name, table_.rows[2].name};
    }
    std::filesystem::path written(const char* name) const
    {
        const auto file = folder_.path() / name;
        std::ofstream(file, std::ios::binary) << meshText(mesh_, table_, file);
        return file;
    }
    // Volume of each tissue, by VTK.
    static std::map<int, double> volumesIn(vtkUnstructuredGrid& grid)
    {
        std::map<int, double> volume;
        auto* tissue = grid.GetCellData()->GetArray("tissue");
        for (vtkIdType c = 0; tissue != nullptr && c < grid.GetNumberOfCells(); ++c) {
            std::array<Vec3, 4> p;
            for (int i = 0; i < 4; ++i) {
                grid.GetPoint(grid.GetCell(c)->GetPointId(i), &p[static_cast<std::size_t>(i)].x);
            }
            volume[static_cast<int>(tissue->GetComponent(c, 0))] +=
                glm::dot(p[1] - p[0], glm::cross(p[2] - p[0], p[3] - p[0])) / 6.0;
        }
        return volume;
    }
    static void expectBoth(vtkUnstructuredGrid& grid)
    {
        const auto volume = volumesIn(grid);
        ASSERT_EQ(volume.size(), 2U);
        EXPECT_NEAR(volume.at(1), 26e-6, 1e-12);
        EXPECT_NEAR(volume.at(2), 1e-6, 1e-12);
    }

    tests::Folder folder_;
    TetMesh mesh_;
    volume::TissueTable table_;
    std::array<std::string, 2> rows_;
};

TEST_F(MeshFiles, VtkReadsBothOfItsKinds)
{
    vtkNew<vtkXMLUnstructuredGridReader> xml;
    xml->SetFileName(written("m.vtu").c_str());
    xml->Update();
    expectBoth(*xml->GetOutput());
    vtkNew<vtkUnstructuredGridReader> legacy;
    legacy->SetFileName(written("m.vtk").c_str());
    legacy->Update();
    expectBoth(*legacy->GetOutput());
}

// gmsh finds the mesh right, and tells of every physical group.
TEST_F(MeshFiles, GmshReadsItsKind)
{
    const auto log = folder_.path() / "log";
    const std::string command = "gmsh " + written("m.msh").string() + " -check > " + log.string() + " 2>&1";
    ASSERT_EQ(std::system(command.c_str()), 0) << "gmsh: scripts/install-packages --test installs it";
    const std::string text = base::contentOf(log).value();
    EXPECT_NE(text.find("343 nodes"), std::string::npos) << text;
    EXPECT_NE(text.find("1776 elements"), std::string::npos) << text;  // 1296 tetrahedra, 480 facets
    EXPECT_EQ(text.find("Error"), std::string::npos) << text;
    EXPECT_EQ(text.find("Warning"), std::string::npos) << text;
}

// CalculiX moves the outside by 1 mm; whatever is in the body, all of it then goes along.
TEST_F(MeshFiles, CalculixSolvesARigidMotion)
{
    const auto file = written("m.inp");
    std::ofstream(file, std::ios::app) << "*STEP\n*STATIC\n*BOUNDARY\nOUTSIDE,1,1,1.\nOUTSIDE,2,3,0.\n"
                                          "*NODE PRINT, NSET=NALL\nU\n*END STEP\n";
    const CcxSolution solution = runCcx(file);
    ASSERT_EQ(solution.u.size(), mesh_.points.size());
    for (const Vec3 u : solution.u) {
        ASSERT_LT(glm::distance(u, Vec3(1e-3, 0.0, 0.0)), 1e-9);
    }
}

// CalculiX knows no hyphen: the second of two tissues that differ in one only has its row in the name.
TEST_F(MeshFiles, TissuesOfOneNameInCalculixStayApart)
{
    table_.rows[1].name = "gland-1";
    table_.rows[2].name = "gland_1";
    const auto file = folder_.path() / "m.inp";
    const std::string text = meshText(mesh_, table_, file);
    for (const char* line : {"ELSET=T_GLAND_1\n", "ELSET=T_GLAND_1_2\n", "NAME=T_GLAND_1\n", "NAME=T_GLAND_1_2\n",
                             "ELSET=T_GLAND_1_2, MATERIAL=T_GLAND_1_2\n", "NSET=N_GLAND_1\n", "NSET=N_GLAND_1_2\n"}) {
        const auto first = text.find(line);
        ASSERT_NE(first, std::string::npos) << line;
        EXPECT_EQ(text.find(line, first + 1), std::string::npos) << line;
    }
}

TEST_F(MeshFiles, UnknownEndingIsRefused)
{
    EXPECT_THROW(checkMeshFile("mesh.stl"), std::runtime_error);
    EXPECT_THROW(meshText(mesh_, table_, "mesh"), std::runtime_error);
}

}  // namespace
}  // namespace palpate::reference
