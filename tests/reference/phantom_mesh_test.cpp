// Meshes of phantoms: quality, volumes, and what other programs make of the files.
#include <base/inputs.h>
#include <datasets/phantom.h>
#include <datasets/scene.h>
#include <datasets/tables.h>
#include <reference/ccx.h>
#include <reference/mesh_files.h>
#include <reference/volume_mesh.h>
#include <tests/folder.h>

#include <gtest/gtest.h>
#include <vtkCell.h>
#include <vtkCellData.h>
#include <vtkDataArray.h>
#include <vtkNew.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLUnstructuredGridReader.h>
#include <glm/geometric.hpp>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>

namespace palpate::reference {
namespace {

const char* const meshProgram = PALPATE_BIN_DIR "/palpate-mesh";

volume::Tissue phantom(const std::string& name, double voxel, std::map<std::string, double> numbers)
{
    datasets::PhantomSpec spec;
    spec.name = name;
    spec.voxel = voxel;
    spec.numbers = std::move(numbers);
    return datasets::makePhantom(spec, datasets::defaultTissues());
}

void expectGood(const MeshQuality& q)
{
    EXPECT_EQ(q.flipped, 0U);
    EXPECT_EQ(q.overShared, 0U);
    EXPECT_GT(q.minDihedral, 5.0);
    EXPECT_GT(q.tets, 500U);
    bool thick = false;
    for (const TissueQuality& t : q.tissues) {
        thick = thick || !t.thin;
        EXPECT_TRUE(t.thin || std::abs(t.percent()) < 1.0) << int{t.row} << ": " << t.percent() << " %";
    }
    EXPECT_TRUE(thick);
}

VolumeMesh meshed(const volume::Tissue& tissue, double size, SurfaceKind surface)
{
    VolumeMeshOptions options;
    options.size = size;
    options.largest = 3.0 * size;
    options.surface = surface;
    options.tetgen.program = meshProgram;
    VolumeMesh made = meshVolume(tissue, options);
    expectGood(made.quality);
    // One region per tissue: every tissue of the voxels, bone too.
    const std::set<std::uint8_t> rows(made.mesh.tissue.begin(), made.mesh.tissue.end());
    EXPECT_EQ(rows.size(), made.quality.tissues.size());
    return made;
}

volume::Tissue smallBlock()
{
    return phantom("block", 2e-3,
                   {{"width_mm", 40}, {"thickness_mm", 24}, {"tumour_diameter_mm", 14}, {"tumour_centre_mm", 12}});
}

TEST(VolumeMesh, OfABlockIsGoodAndGraded)
{
    const VolumeMesh made = meshed(smallBlock(), 6e-3, SurfaceKind::cgal);
    EXPECT_GT(made.quality.longest, 9e-3);
}

TEST(VolumeMesh, WithoutTissueIsRefused)
{
    volume::TissueTable table = datasets::defaultTissues();
    for (auto& row : table.rows) {
        row.role = volume::Role::air;
    }
    datasets::PhantomSpec spec;
    spec.name = "block";
    spec.voxel = 5e-3;
    VolumeMeshOptions options;
    options.tetgen.program = meshProgram;
    EXPECT_THROW(meshVolume(datasets::makePhantom(spec, table), options), std::runtime_error);
}

TEST(VolumeMesh, OfLayersIsGood)
{
    const VolumeMesh made = meshed(phantom("layered", 1e-3, {{"width_mm", 30}}), 5e-3, SurfaceKind::cgal);
    EXPECT_GT(made.quality.tissues.size(), 4U);
}

TEST(VolumeMesh, OfACoarseBreastIsGood)
{
    const VolumeMesh made = meshed(phantom("breast", 3e-3, {}), 9e-3, SurfaceKind::cgal);
    EXPECT_GT(made.quality.tissues.size(), 6U);
}

// The pair's mesh keeps its volumes in VTK, gmsh finds nothing wrong with it, and CalculiX, where the outside moves by 1
// mm, takes all of it along.
TEST(VolumeMesh, OfAPairIsGoodAndOpensElsewhere)
{
    const volume::Tissue tissue = datasets::sceneVolume(*datasets::builtInScene("pair"));
    const VolumeMesh made = meshed(tissue, 8e-3, SurfaceKind::cgal);
    const tests::Folder folder;
    const auto written = [&](const char* name) {
        const auto file = folder.path() / name;
        std::ofstream(file, std::ios::binary) << meshText(made.mesh, tissue.table(), file);
        return file;
    };
    vtkNew<vtkXMLUnstructuredGridReader> vtk;
    vtk->SetFileName(written("m.vtu").c_str());
    vtk->Update();
    auto* grid = vtk->GetOutput();
    std::map<int, double> volume;
    for (vtkIdType c = 0; c < grid->GetNumberOfCells(); ++c) {
        std::array<Vec3, 4> p;
        for (int i = 0; i < 4; ++i) {
            grid->GetPoint(grid->GetCell(c)->GetPointId(i), &p[static_cast<std::size_t>(i)].x);
        }
        volume[static_cast<int>(grid->GetCellData()->GetArray("tissue")->GetComponent(c, 0))] +=
            glm::dot(p[1] - p[0], glm::cross(p[2] - p[0], p[3] - p[0])) / 6.0;
    }
    for (const TissueQuality& t : made.quality.tissues) {
        EXPECT_NEAR(volume[t.row] / t.mesh, 1.0, 1e-5) << int{t.row};
    }
    const auto log = folder.path() / "log";
    const std::string command = "gmsh " + written("m.msh").string() + " -check > " + log.string() + " 2>&1";
    ASSERT_EQ(std::system(command.c_str()), 0) << "gmsh: scripts/install-packages --test installs it";
    const std::string text = base::contentOf(log).value();
    EXPECT_NE(text.find(std::to_string(made.mesh.points.size()) + " nodes"), std::string::npos) << text;
    EXPECT_EQ(text.find("Error"), std::string::npos) << text;
    EXPECT_EQ(text.find("Warning"), std::string::npos) << text;
    const auto file = written("m.inp");
    std::ofstream(file, std::ios::app) << "*STEP\n*STATIC\n*BOUNDARY\nOUTSIDE,1,1,1.\nOUTSIDE,2,3,0.\n"
                                          "*NODE PRINT, NSET=NALL\nU\n*END STEP\n";
    const CcxSolution solution = runCcx(file);
    ASSERT_EQ(solution.u.size(), made.mesh.points.size());
    for (const Vec3 u : solution.u) {
        ASSERT_LT(glm::distance(u, Vec3(1e-3, 0.0, 0.0)), 1e-8);
    }
}

}  // namespace
}  // namespace palpate::reference
