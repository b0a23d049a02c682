#include <tests/apps/program.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>

namespace palpate::apps {
namespace {

Outcome mesh(const std::vector<std::string>& arguments)
{
    return Program("palpate-mesh", arguments).wait();
}

void expectMeshRefusal(const std::vector<std::string>& arguments, const std::string& hint)
{
    const Outcome o = mesh(arguments);
    EXPECT_GT(o.status, 0) << hint;
    EXPECT_EQ(std::ranges::count(o.err, '\n'), 1) << o.err;
    EXPECT_TRUE(o.err.starts_with("palpate-mesh: ")) << o.err;
    EXPECT_NE(o.err.find(hint), std::string::npos) << o.err << "  does not hold: " << hint;
    EXPECT_EQ(o.out, "");
}

// A small phantom as a scene of its own.
std::string sceneIn(const Folder& folder)
{
    const auto file = folder / "small.toml";
    writeText(file,
              "name = \"small\"\n[volume]\nphantom = \"block\"\nvoxel_mm = 2.0\n[volume.parameters]\nwidth_mm = 40\n"
              "thickness_mm = 24\ntumour_diameter_mm = 12\ntumour_centre_mm = 12\n[target]\nstructure = \"tumour\"\n");
    return file;
}

TEST(MeshCommand, PrintsQualityAndWritesMeshAndFigures)
{
    const Folder folder;
    const Outcome o = mesh({sceneIn(folder), "-o", folder / "m.vtu", "--size", "6", "--json", folder / "q.json"});
    ASSERT_EQ(o.status, 0) << o.err;
    EXPECT_TRUE(std::filesystem::exists(folder / "m.vtu"));
    const auto q = nlohmann::json::parse(readText(folder / "q.json"));
    EXPECT_EQ(q.at("flipped"), 0);
    EXPECT_EQ(q.at("faces_shared_by_more_than_two"), 0);
    EXPECT_GT(q.at("least_dihedral_deg").get<double>(), 5.0);
    ASSERT_EQ(q.at("tissues").size(), 3U);
    for (const auto& tissue : q.at("tissues")) {
        EXPECT_NE(o.out.find("\n" + tissue.at("tissue").get<std::string>() + " "), std::string::npos) << o.out;
    }
    EXPECT_NE(o.out.find("0 tetrahedra flipped"), std::string::npos) << o.out;
}

// SPL's abdomen on voxels of 4 mm: 95 labels of 15 tissues, most of them thinner than the mesh.
TEST(MeshCommand, PatientKeepsItsVolumesAndGoodAngles)
{
    const std::string labels = PALPATE_TEST_DATA "/spl_abdomen_atlas/seg.nrrd";
    if (!std::filesystem::exists(labels)) {
        GTEST_SKIP() << "no test volumes in " << PALPATE_TEST_DATA << ": " << labels;
    }
    const Folder folder;
    const Outcome import = Program("palpate", {"import", labels, "--map", "spl-abdomen", "--set", "699=air", "--voxel",
                                               "4mm", "-o", folder / "patient.vdb"})
                               .wait();
    ASSERT_EQ(import.status, 0) << import.err;
    const Outcome o = mesh({folder / "patient.vdb", "-o", folder / "m.vtu", "--size", "16", "--json", folder / "q.json"});
    ASSERT_EQ(o.status, 0) << o.err;
    const auto q = nlohmann::json::parse(readText(folder / "q.json"));
    EXPECT_EQ(q.at("flipped"), 0);
    EXPECT_EQ(q.at("faces_shared_by_more_than_two"), 0);
    EXPECT_GT(q.at("least_dihedral_deg").get<double>(), 5.0);
    EXPECT_EQ(q.at("tissues").size(), 15U);
    for (const auto& tissue : q.at("tissues")) {
        EXPECT_TRUE(tissue.at("thickness_mm").get<double>() < 6.0 ||
                    std::abs(tissue.at("volume_error_pct").get<double>()) < 1.0)
            << tissue;
    }
}

TEST(MeshCommand, BadInputIsOneLine)
{
    const Folder folder;
    const std::string scene = sceneIn(folder), out = folder / "m.vtu";
    expectMeshRefusal({}, "no volume");
    expectMeshRefusal({scene}, "nothing to write");
    expectMeshRefusal({"nowhere", "-o", out}, "neither a volume (.vdb) nor a built-in phantom");
    expectMeshRefusal({folder / "nowhere.vdb", "-o", out}, "nowhere.vdb");
    expectMeshRefusal({scene, "-o", folder / "m.stl"}, ".vtu, .vtk, .msh or .inp");
    expectMeshRefusal({scene, "-o", folder / "no/such/folder/m.vtu"}, "no/such/folder");
    expectMeshRefusal({scene, "-o", out, "--size", "0"}, "--size");
    expectMeshRefusal({scene, "-o", out, "--size", "many"}, "--size");
    expectMeshRefusal({scene, "-o", out, "--size", "5", "--largest", "4"}, "--largest 4: must be at least the 5 mm");
    expectMeshRefusal({scene, "-o", out, "--surface", "none"}, "--surface");
    writeText(folder / "not.vdb", "this is no volume");
    expectMeshRefusal({folder / "not.vdb", "-o", out}, "not.vdb");
    expectMeshRefusal({folder.path().string(), "-o", out}, folder.path().string());
    EXPECT_FALSE(std::filesystem::exists(out));
    // What TetGen's process is asked for is read as carefully.
    EXPECT_NE(mesh({"--tetgen-job", folder / "not.vdb", folder / "result"}).status, 0);
}

TEST(MeshCommand, EndsOnASignalWithOneLineInItsName)
{
    const Folder folder;
    Program program("palpate-mesh", {"breast", "--size", "2", "-o", folder / "m.vtu"});
    ASSERT_TRUE(catches(program, SIGINT));
    program.send(SIGINT);
    const Outcome o = program.wait();
    EXPECT_EQ(o.status, 128 + SIGINT);
    EXPECT_EQ(o.err, "palpate-mesh: interrupted\n");
    EXPECT_FALSE(std::filesystem::exists(folder / "m.vtu"));
}

}  // namespace
}  // namespace palpate::apps
