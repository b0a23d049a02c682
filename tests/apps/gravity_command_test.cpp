#include <tests/apps/program.h>

#include <gtest/gtest.h>

#include <string>

namespace palpate::apps {
namespace {

const std::string breast = "[volume]\nphantom = \"breast\"\nvoxel_mm = 3\n[target]\nstructure = \"tumour\"\n[gravity]\n";

TEST(Train, GravitySaysWhatItMovedAndTheReplayIsTheSession)
{
    const Folder folder;
    const std::string scene = folder / "prone.toml", record = folder / "prone.db";
    writeText(scene, breast + "posture = \"prone\"\nshape = \"supine\"\nmodulus = 0.3\n");
    const auto trained = figures({"train", scene, "--headless", "--unpaced", "--setting", "fast", "--record", record});
    const auto& gravity = trained.at("gravity");
    EXPECT_GT(gravity.at("moved_mm").get<double>(), 4.0);
    EXPECT_LT(gravity.at("unloaded_within_mm").get<double>(), 0.3);  // a tenth of a voxel
    EXPECT_GE(gravity.at("rounds").get<int>(), 2);
    EXPECT_GT(trained.at("contacts").get<int>(), 0);
    const auto replayed = figures({"replay", record});
    EXPECT_EQ(replayed.at("identical"), true) << replayed.dump(2);
}

TEST(Train, WhatCannotBeInASceneIsRefusedWithItsLine)
{
    const Folder folder;
    const std::string scene = folder / "prone.toml";
    const auto refusal = [&](const std::string& section, const std::string& says) {
        writeText(scene, breast + section);
        expectRefusal({"train", scene, "--headless"}, says);
    };
    refusal("posture = \"prone\"\n", "prone.toml:6: [gravity] shape is missing");
    // Also where this machine or the command line changes the scene: the line is that of the file.
    refusal("posture = \"prone\"\nshape = \"supine\"\n[tissue.fat]\nyoungs_kpa = 0\n",
            "prone.toml:10: [tissue.fat] youngs_kpa = 0 kPa: must be 0.01");
    refusal("posture = \"prone\"\nshape = \"supine\"\n[[script]]\nkind = \"move\"\nto_mm = [0, 0, 0]\n", "[[script]]");
}

}  // namespace
}  // namespace palpate::apps
