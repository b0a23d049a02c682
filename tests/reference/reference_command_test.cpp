#include <studies/accuracy/reference_file.h>
#include <tests/apps/program.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>

namespace palpate::apps {
namespace {

constexpr const char* sceneText =
    "name = \"small\"\n[volume]\nphantom = \"block\"\nvoxel_mm = 2.0\n[volume.parameters]\nwidth_mm = 40\n"
    "thickness_mm = 24\ntumour_diameter_mm = 12\ntumour_centre_mm = 12\n[target]\nstructure = \"tumour\"\n"
    "entry_mm = [0, 0, 0]\naim_mm = [0, 12, 0]\n";

// A reference file of which only the press counts: 4 mm beside the scene's entry.
std::string pressBeside(const Folder& folder, const std::string& tool, bool hasPress)
{
    studies::ReferenceInfo info;
    info.tool = tool;
    info.scene = "small";
    if (hasPress) {
        info.press = {Vec3(4e-3, -10.5e-3, 0.0), Vec3(0, 1, 0), Vec3(1, 0, 0), 8.5e-3};
    }
    const std::string file = folder / "beside.ref";
    studies::saveReference(file, {}, info);
    return file;
}

// Beside the lump the ball feels less of it than over it, and is pushed away from it: by 2.6 to 3.1 % of the force on
// meshes of 4 and 5 mm, but by 1.0 to 1.3 % on those of 8 mm.
TEST(ReferenceCommand, PressesWhereAnotherReferenceDoes)
{
    const Folder folder;
    writeText(folder / "small.toml", sceneText);
    const auto solved = [&](std::vector<std::string> more) {
        std::vector<std::string> arguments{folder / "small.toml", "--looks", "3", "--size", "5", "--json",
                                           folder / "r.json"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Outcome o = Program("palpate-reference", arguments).wait();
        EXPECT_EQ(o.status, 0) << o.err;
        return nlohmann::json::parse(readText(folder / "r.json"));
    };
    const auto over = solved({}), beside = solved({"--path-of", pressBeside(folder, "sphere_10mm", true)});
    EXPECT_NE(over.at("key"), beside.at("key"));
    for (const auto& [place, right] : {std::pair{over, 0.0}, {beside, 4.0}}) {  // the ball's middle, 3 mm deep
        const auto at = place.at("looks")[0].at("position_mm").get<std::vector<double>>();
        EXPECT_NEAR(at[0], right, 1e-3);
        EXPECT_NEAR(at[1], -7.0, 1e-3);
        EXPECT_NEAR(at[2], 0.0, 1e-3);
    }
    const auto force = [](const nlohmann::json& r, std::size_t i) {
        return r.at("looks")[0].at("force_n")[i].get<double>();
    };
    EXPECT_LT(force(over, 1), 1.03 * force(beside, 1));  // against the press
    EXPECT_GT(force(beside, 0), 0.01 * std::abs(force(beside, 1)));
}

// What lies on one side of the plane would count twice: without a word up to twice the force.
TEST(ReferenceCommand, RefusesAPlaneOfSymmetryBesideTheTool)
{
    const Folder folder;
    writeText(folder / "small.toml", sceneText);
    const Outcome o =
        Program("palpate-reference", {folder / "small.toml", "--path-of", pressBeside(folder, "sphere_10mm", true),
                                      "--looks", "3", "--mirrored", "x", "--json", folder / "r.json"})
            .wait();
    EXPECT_GT(o.status, 0);
    EXPECT_EQ(o.err, "palpate-reference: --mirrored x: the tool is 4.000 mm from the plane x = 0: solve all of it\n");
    EXPECT_FALSE(std::filesystem::exists(folder / "r.json"));
}

TEST(ReferenceCommand, RefusesPathsThatAreNone)
{
    const Folder folder;
    writeText(folder / "small.toml", sceneText);
    const auto refused = [&](const std::string& file, const std::string& hint) {
        const Outcome o =
            Program("palpate-reference", {folder / "small.toml", "--path-of", file, "--json", folder / "r.json"}).wait();
        EXPECT_GT(o.status, 0) << hint;
        EXPECT_EQ(std::ranges::count(o.err, '\n'), 1) << o.err;
        EXPECT_NE(o.err.find(hint), std::string::npos) << o.err;
    };
    refused(pressBeside(folder, "sphere_10mm", false), "has no path");
    refused(pressBeside(folder, "sphere_5mm", true), "its tool is sphere_5mm, not sphere_10mm");
    refused(folder / "small.toml", "is no reference that can be used");
    refused(folder / "none.ref", "none.ref");
}

TEST(ReferenceCommand, RefusesWhatItWouldNotDo)
{
    const Folder folder;
    writeText(folder / "small.toml", sceneText);
    const auto refused = [&](std::vector<std::string> arguments, const std::string& hint) {
        const Outcome o = Program("palpate-reference", arguments).wait();
        EXPECT_GT(o.status, 0) << hint;
        EXPECT_EQ(std::ranges::count(o.err, '\n'), 1) << o.err;
        EXPECT_NE(o.err.find(hint), std::string::npos) << o.err;
    };
    const std::string scene = folder / "small.toml";
    refused({scene, "--looks", "1", "-o", folder / "small.inp"}, "written as .vtu");
    refused({scene, "--looks", "1", "--all", "--json", folder / "r.json"}, "--all requires");
    refused({scene, "--verify"}, "leave it or the scene out");
    refused({scene, "--press", "nan", "--json", folder / "r.json"}, "must be a number");
}

// Half an hour's work is not lost for want of room for the pictures of it.
TEST(ReferenceCommand, FiguresAreWrittenBeforeTheStateThatMayNotFit)
{
    const Folder folder;
    writeText(folder / "small.toml", sceneText);
    // A limit of 64 kB a file is a disk that is full for the state alone.
    const Outcome o = Program("/bin/bash", {"-c",
                                            "ulimit -f 64; exec " PALPATE_BIN_DIR "/palpate-reference \"$0\" --looks 1 "
                                            "--size 8 -o \"$1.vtu\" --json \"$1.json\"",
                                            folder / "small.toml", folder / "r"})
                          .wait();
    EXPECT_EQ(o.status, 1);
    EXPECT_NE(o.err.find("r.vtu: cannot be written"), std::string::npos) << o.err;
    EXPECT_FALSE(std::filesystem::exists(folder / "r.vtu"));
    EXPECT_TRUE(std::filesystem::exists(folder / "r.json"));
}

TEST(ReferenceCommand, EndsOnASignalWithOneLine)
{
    const Folder folder;
    Program program("palpate-reference", {"block", "--looks", "1", "--size", "1", "--json", folder / "r.json"});
    ASSERT_TRUE(catches(program, SIGTERM));
    program.send(SIGTERM);
    const Outcome o = program.wait();
    EXPECT_EQ(o.status, 128 + SIGTERM);
    EXPECT_EQ(o.err, "palpate-reference: interrupted\n");
}

}  // namespace
}  // namespace palpate::apps
