#include <datasets/phantom.h>
#include <datasets/scene.h>
#include <datasets/scene_text.h>
#include <datasets/tables.h>
#include <sweep/folder.h>

#include <tests/error_of.h>
#include <tests/folder.h>

#include <gtest/gtest.h>

#include <fstream>
#include <string>

namespace palpate::sweep {
namespace {

// The same command after an edit of the scene that the plan names: its cases would be of the old scene.
TEST(SweepFolder, APlanWhoseSceneWasEditedIsRefused)
{
    const tests::Folder home;
    const std::string plan = home / "p.toml", folder = home / "s";
    datasets::Scene scene = *datasets::builtInScene("block");
    scene.tool.radius = 4.1e-3;
    const auto write = [&](const std::string& more) {
        std::ofstream(home / "scene.toml") << datasets::sceneText(scene) << more;
    };
    const auto refusal = [&](const std::string& given) {
        return tests::errorOf([&] { SweepFolder(folder, given, false); });
    };
    write("");
    std::ofstream(plan) << "scene = \"scene.toml\"\n[[axis]]\nkey = \"dffb.gain\"\nvalues = [0.1, 0.5]\n";
    EXPECT_EQ(refusal(plan), "");
    EXPECT_EQ(refusal(plan), "");
    write("# another comment\n");
    EXPECT_EQ(refusal(plan), "");
    scene.tool.radius = 4.2e-3;
    write("");
    EXPECT_EQ(refusal(plan), folder + ": its cases are of another scene than " + plan +
                                 " has now: choose another folder, or leave out the plan to resume with the scene of the "
                                 "folder");
    EXPECT_EQ(refusal(""), "");
}

// On a machine that has the folder, and not the volume: a report needs no more than the rows.
TEST(SweepFolder, ResultsCanBeReadWithoutTheVolume)
{
    const tests::Folder home;
    const std::string plan = home / "p.toml", folder = home / "s", volume = home / "v.vdb";
    datasets::makePhantom(datasets::builtInScene("block")->source.phantom, datasets::defaultTissues()).save(volume);
    std::ofstream(home / "scene.toml") << "name = \"own\"\n[volume]\nfile = \"v.vdb\"\n[target]\nstructure = \"tumour\"\n";
    std::ofstream(plan) << "scene = \"scene.toml\"\n[[axis]]\nkey = \"tissue.fat.youngs_kpa\"\nvalues = [3, 4]\n";
    SweepRow row;
    row.outputs.resize(SweepFolder(folder, plan, true).plan().outputs.size());
    row.build = row.machine = "here";
    SweepFolder(folder, "", true).write(row);
    std::ofstream(volume, std::ios::app) << "more";
    EXPECT_EQ(tests::errorOf([&] { SweepFolder(folder, "", false); }),
              folder + ": " + volume +
                  ", which its scene reads, has changed since the sweep began: bring it back, or begin in another folder");
    std::filesystem::remove(volume);
    EXPECT_NE(tests::errorOf([&] { SweepFolder(folder, "", false); }), "");
    const auto rows = SweepFolder::ofResults(folder).rows();
    ASSERT_EQ(rows.size(), 2U);
    EXPECT_TRUE(rows[0] && !rows[1]);
    std::ofstream(home / "s/scene.toml", std::ios::app) << "# edited";
    EXPECT_NE(tests::errorOf([&] { SweepFolder::ofResults(folder); }), "");
}

}  // namespace
}  // namespace palpate::sweep
