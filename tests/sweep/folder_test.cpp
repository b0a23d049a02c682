#include <datasets/scene.h>
#include <datasets/scene_text.h>
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

}  // namespace
}  // namespace palpate::sweep
