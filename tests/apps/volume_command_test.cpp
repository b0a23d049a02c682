#include <tests/apps/program.h>

#include <gtest/gtest.h>

#include <cstdint>
#include <map>

namespace palpate::apps {
namespace {

using Counts = std::map<int, std::uint64_t>;  // label value, voxels

// FDA's VICTRE breast phantom p_1; its voxels were counted with an independent MetaImage reader.
const std::string victre = std::string(PALPATE_TEST_DATA) + "/victre_p1/p_1.mhd";
const Counts victreVoxels{{0, 43028583}, {1, 15949597}, {2, 1280833},  {29, 9363296}, {33, 22131},  {40, 4861758},
                          {88, 403012},  {95, 18367},   {125, 102610}, {150, 88660},  {225, 112001}};

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr double maxMemory = 1e9;  // sanitizers keep memory of their own
#else
constexpr double maxMemory = 2000;  // [MB]
#endif

void expectVolumeKeys(const nlohmann::json& j)
{
    EXPECT_EQ(j.at("size").size(), 3U);
    EXPECT_EQ(j.at("spacing_mm").size(), 3U);
    EXPECT_EQ(j.at("direction").size(), 9U);
    EXPECT_EQ(j.at("origin_mm").size(), 3U);
    EXPECT_GT(j.at("memory_mb").get<double>(), 0.0);
    EXPECT_TRUE(j.at("warnings").is_array());
    ASSERT_FALSE(j.at("labels").empty());
    for (const std::string key : {"value", "name", "tissue", "voxels", "volume_ml"}) {
        EXPECT_TRUE(j.at("labels").at(0).contains(key)) << key;
    }
}

Counts voxels(const nlohmann::json& j)
{
    Counts out;
    for (const auto& label : j.at("labels")) {
        out[label.at("value")] = label.at("voxels");
    }
    return out;
}

TEST(VolumeCommands, APhantomsVolumeSaysWhatThePhantomSaid)
{
    const Folder folder;
    const std::string file = folder / "layered.vdb";
    const auto made = figures({"phantom", "layered", "-o", file, "--set", "fat_mm=20", "--seed", "3"});
    const auto info = figures({"info", file});
    expectVolumeKeys(info);
    EXPECT_EQ(voxels(info), voxels(made));
    EXPECT_EQ(info.at("size"), made.at("size"));
    for (const char* const value : {"0x20", " 20", "20 ", "20mm", ""}) {
        expectRefusal({"phantom", "layered", "-o", file, "--set", std::string("fat_mm=") + value}, "is not a number");
    }
}

// Cut anywhere, a volume is refused; what is left of it never becomes tissue.
// The skin of "layered" is the plane y = 0: entries lie within a thousandth of a millimetre of it, on both sides.
TEST(VolumeCommands, ATableOfWaysHasNoNegativeZero)
{
    const Folder folder;
    const std::string volume = folder / "layered.vdb";
    ASSERT_EQ(palpate({"phantom", "layered", "-o", volume}).status, 0);
    const Outcome ways = palpate({"scene", volume, "-o", folder / "s.toml"});
    EXPECT_NE(ways.out.find(" 0.0 "), std::string::npos) << ways.out;
    EXPECT_EQ(ways.out.find("-0.0 "), std::string::npos) << ways.out;
}

TEST(VolumeCommands, ATruncatedVolumeIsRefusedOnOneLine)
{
    const Folder folder;
    const std::string whole = folder / "whole.vdb", cut = folder / "cut.vdb";
    ASSERT_EQ(palpate({"phantom", "block", "--voxel", "2", "-o", whole}).status, 0);
    const std::string bytes = readText(whole);
    for (const std::size_t keep : {std::size_t{0}, std::size_t{40}, bytes.size() / 3, bytes.size() - 1}) {
        SCOPED_TRACE(keep);
        writeText(cut, bytes.substr(0, keep));
        expectRefusal({"info", cut}, cut + ": ");
        expectRefusal({"train", cut, "--headless"}, cut + ": ");
    }
}

TEST(VolumeCommands, APatientSizedPhantomIsImportedToTheVoxelAndTrainedOn)
{
    if (!std::filesystem::exists(victre)) {
        GTEST_SKIP() << "no test volumes in " << PALPATE_TEST_DATA << ": " << victre;
    }
    const Folder folder;
    const std::string file = folder / "victre.vdb", record = folder / "session.db";
    // Its values would fit more than one program's, and no name says whose they are.
    expectRefusal({"import", victre, "-o", file}, "--map victre (1 is fat");
    const auto imported = figures({"import", victre, "--map", "victre", "-o", file});
    expectVolumeKeys(imported);
    EXPECT_EQ(voxels(imported), victreVoxels);
    EXPECT_EQ(imported.at("size"), (std::vector<int>{374, 448, 449}));

    const auto trained = figures({"train", file, "--unpaced", "--headless", "--seconds", "3", "--record", record});
    EXPECT_EQ(trained.at("ticks"), 3000);
    EXPECT_GT(trained.at("contacts"), 0);
    EXPECT_LT(trained.at("peak_memory_mb").get<double>(), maxMemory);

    const auto replayed = figures({"replay", record});
    EXPECT_EQ(replayed.at("identical"), true);
    EXPECT_EQ(replayed.at("force_hash"), trained.at("force_hash"));
}

}  // namespace
}  // namespace palpate::apps
