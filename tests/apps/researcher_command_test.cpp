#include <tests/apps/program.h>
#include <volume/export.h>
#include <volume/import.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <map>

namespace palpate::apps {
namespace {

using volume::LabelImage;
using volume::LabelName;

// A body of 80 x 64 x 60 mm in voxels of 2 x 2 x 4 mm with a lump, a vessel behind it and two loose voxels of lump.
LabelImage patient()
{
    LabelImage image{{44, 36, 20}, {Mat3(1.0), Vec3(0.0)}, {}};
    image.affine.linear = Mat3(Vec3(-2e-3, 0, 0), Vec3(0, 2e-3, 0), Vec3(0, 0, 4e-3));
    image.affine.origin = Vec3(43e-3, -35e-3, -38e-3);
    volume::forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        const Vec3 p = image.affine.toPatient(Vec3(n));
        const Vec3 q = p / Vec3(40e-3, 32e-3, 30e-3);
        std::uint16_t label = glm::dot(q, q) < 1 ? 1 : 0;
        label = label != 0 && glm::length(p - Vec3(0, -6e-3, 0)) < 8e-3 ? std::uint16_t{2} : label;
        label = label != 0 && glm::length(Vec3(p.x, p.y - 12e-3, 0)) < 4e-3 ? std::uint16_t{3} : label;
        image.values.push_back(label);
    });
    image.values[image.offset({30, 12, 12})] = 2;
    image.values[image.offset({31, 12, 12})] = 2;
    return image;
}

const std::vector<LabelName> segments{{1, "Body", ""}, {2, "Left lesion", ""}, {3, "Aorta", ""}};

std::map<std::string, std::uint64_t> voxelsOf(const nlohmann::json& j)
{
    std::map<std::string, std::uint64_t> out;
    for (const auto& label : j.at("labels")) {
        out[label.at("name")] = label.at("voxels");
    }
    return out;
}

std::string tissueOf(const nlohmann::json& j, const std::string& name)
{
    for (const auto& label : j.at("labels")) {
        if (label.at("name") == name) {
            return label.at("tissue");
        }
    }
    return "none";
}

class Researcher : public ::testing::Test {
protected:
    void SetUp() override
    {
        volume::exportLabels(seg, patient(), segments);
        volume::exportLabels(bare, patient(), {});
    }

    const Folder folder;
    const std::string seg = folder / "patient.seg.nrrd", bare = folder / "bare.mha", vdb = folder / "patient.vdb";
};

TEST_F(Researcher, SegmentsAreMappedByTheirNamesAndUnknownLabelsAreListed)
{
    const auto j = figures({"import", seg, "-o", vdb});
    EXPECT_EQ(tissueOf(j, "Body"), "soft_tissue");
    EXPECT_EQ(tissueOf(j, "Left lesion"), "tumour");
    EXPECT_EQ(tissueOf(j, "Aorta"), "artery");
    expectRefusal({"import", bare, "-o", vdb}, "3 of its labels: 1 (");
    expectRefusal({"import", bare, "-o", vdb, "--set", "9=fat"}, "--set 9=fat: no voxel has a label");
    expectRefusal({"import", bare, "-o", vdb, "--set", "1=jelly"}, "'jelly' is not in the tissue table");
    const auto set = figures({"import", bare, "-o", vdb, "--set", "1=fat", "--default-tissue", "muscle"});
    EXPECT_EQ(tissueOf(set, "label 1"), "fat");
    EXPECT_EQ(tissueOf(set, "label 3"), "muscle");
    EXPECT_EQ(figures({"import", seg, "-o", vdb, "--set", "Left lesion=ilc"}).at("labels").at(2).at("tissue"), "ilc");
}

// A label without a name of its own goes by the one that the map gives it.
TEST_F(Researcher, LabelsAreSetByTheNamesInTheMapToo)
{
    const std::string map = folder / "map.toml";
    writeText(
        map,
        "name = \"mine\"\nsource = \"a test\"\nlabels = [{value = 1, name = \"trunk\", tissue = \"fat\"}, {value = 2, name "
        "= \"lump\", tissue = \"tumour\"}, {value = 3, name = \"pipe\", tissue = \"artery\"}]\n");
    const auto set = figures({"import", bare, "-o", vdb, "--map", map, "--set", "lump=ilc"});
    EXPECT_EQ(tissueOf(set, "lump"), "ilc");
    EXPECT_EQ(tissueOf(set, "pipe"), "artery");
    expectRefusal({"import", bare, "-o", vdb, "--map", map, "--set", "lung=ilc"}, "--set lung=ilc: no voxel has a label");
    expectRefusal({"import", bare, "-o", vdb, "--map", map, "--set", "lump=ilc", "--set", "2=fat"}, "both name label 2");
    // In a file with names of its own, these alone count.
    expectRefusal({"import", seg, "-o", vdb, "--map", map, "--set", "trunk=ilc"}, "trunk=ilc");
}

// What holds a body is said, and where: nothing in it is fixed, or a structure is.
TEST_F(Researcher, ABodyThatNothingHoldsSaysWhatItLiesOn)
{
    const auto lies = figures({"import", seg, "-o", vdb});
    EXPECT_LT(lies.at("support").at("normal").at(1).get<double>(), -0.9);
    EXPECT_EQ(figures({"info", vdb}).at("support"), lies.at("support"));
    const std::string words = "nothing in it is fixed: it lies on its back, held behind ";
    EXPECT_NE(palpate({"info", vdb}).out.find(words), std::string::npos);
    EXPECT_TRUE(figures({"import", seg, "-o", vdb, "--set", "Left lesion=chest_wall"}).at("support").is_null());
    EXPECT_EQ(palpate({"info", vdb}).out.find(words), std::string::npos);
}

// Sets of label values as other programs write them, without names. Each would once have become another program's organs.
TEST_F(Researcher, ValuesAloneNeverDecide)
{
    const std::vector<std::pair<const char*, std::vector<std::uint16_t>>> sets{
        {"FSL FIRST", {10, 11, 12, 13, 16, 17, 18, 26, 49, 50, 51, 52, 53, 54, 58}},
        {"aseg without cortex", {2, 4, 5, 7, 8, 10, 11, 12, 13, 14, 15, 16, 17, 18, 24, 26, 28, 41, 43, 44, 46, 47}},
        {"VerSe", {19, 20, 21, 22, 23, 24, 28}},
        {"white matter", {3, 5, 20, 33, 60, 92, 105}},
        {"tens", {10, 20, 30, 40, 50, 60}}};
    for (const auto& [name, values] : sets) {
        SCOPED_TRACE(name);
        LabelImage image = patient();
        for (std::size_t i = 0; i < image.values.size(); ++i) {
            image.values[i] = image.values[i] != 0 ? values[i % values.size()] : std::uint16_t{0};
        }
        const std::string file = folder / "unnamed.nii.gz";
        volume::exportLabels(file, image, {});
        expectRefusal({"import", file, "-o", vdb}, "no tissue is known for " + std::to_string(values.size()));
        expectRefusal({"import", file, "-o", vdb}, "; its values would fit --map ");
        expectRefusal({"import", file, "-o", vdb}, "--map totalsegmentator (");
        EXPECT_FALSE(std::filesystem::exists(vdb));
        EXPECT_EQ(palpate({"import", file, "-o", vdb, "--map", "totalsegmentator"}).status, 0) << "who says so is believed";
        std::filesystem::remove(vdb);
    }
}

// A map of another program calls labels by other names: vertebrae would become bowel.
TEST_F(Researcher, AMapThatContradictsTheNamesIsRefused)
{
    const std::vector<LabelName> names{{1, "vertebrae_L5", ""}, {2, "Left lesion", ""}, {3, "Aorta", ""}};
    volume::exportLabels(seg, patient(), names);
    expectRefusal({"import", seg, "-o", vdb, "--map", "totalsegmentator"},
                  "1 is 'vertebrae_L5' (bone) in the file and 'spleen' (spleen) in the map");
    EXPECT_FALSE(std::filesystem::exists(vdb));
    // A map that has no names of its own, only says what the labels are made of.
    const std::string own = folder / "own.toml";
    writeText(own,
              "name = \"own\"\nlabels = [\n  { value = 1, tissue = \"liver\" },\n  { value = 2, tissue = \"fat\" },\n"
              "  { value = 3, tissue = \"vein\" },\n]\n");
    EXPECT_EQ(tissueOf(figures({"import", seg, "-o", vdb, "--map", own}), "vertebrae_L5"), "liver");
}

// A colour table gives the names, and one line tells of all of them; --verbose has one for each.
TEST_F(Researcher, AColourTableGivesNamesAndOneWarningSumsThemUp)
{
    const std::string table = folder / "colours.ctbl", wrong = folder / "wrong.ctbl";
    writeText(
        table,
        "# Color table\n0 background 0 0 0 0\n1 body 200 160 140 255\n2 liver_lesion 32 128 32 255\n3 aorta 255 0 0 255\n");
    writeText(wrong, "1 body 1 2 3 255\n2 aorta 1 2 3 255\n");
    const auto j = figures({"import", bare, "-o", vdb, "--names", table});
    EXPECT_EQ(tissueOf(j, "liver_lesion"), "tumour");
    EXPECT_EQ(tissueOf(j, "aorta"), "artery");
    ASSERT_EQ(j.at("warnings").size(), 1U) << j.at("warnings");
    EXPECT_EQ(j.at("warnings").at(0),
              "3 labels are taken for a tissue by their names: 'body' as soft_tissue, 'liver_lesion' as tumour, 'aorta' as "
              "artery; "
              "--verbose lists each");
    EXPECT_EQ(figures({"import", bare, "-o", vdb, "--names", table, "--verbose"}).at("warnings").size(), 3U);
    expectRefusal({"import", seg, "-o", vdb, "--names", wrong}, "2 is 'Left lesion' in the file and 'aorta' in the table");
    expectRefusal({"import", bare, "-o", vdb, "--names", folder / "none"}, "none: there is no such file");
    expectRefusal({"import", bare, "-o", vdb, "--axes", "RAS"}, "it says itself where its axes run");
    expectRefusal({"import", bare, "-o", vdb, "--volume", "2"}, "--volume 2: it holds one volume");
}

TEST_F(Researcher, LabelMapsAreListedWithTheirSources)
{
    const auto listed = palpate({"import", "--list-maps"});
    EXPECT_EQ(listed.status, 0);
    for (const char* words :
         {"totalsegmentator-total_mr ", "brats-2023 ", "msd-liver ", "VerSe 2019 and 2020", "FSL FIRST"}) {
        EXPECT_NE(listed.out.find(words), std::string::npos) << words;
    }
}

// A label map that was begun by the program and filled in by hand is one that it takes.
TEST_F(Researcher, ALabelMapIsBegunAndFilledIn)
{
    const std::string map = folder / "map.toml";
    const Outcome begun = palpate({"import", bare, "--write-map", map});
    ASSERT_EQ(begun.status, 0);
    std::string text = readText(map);
    const auto labels = std::ranges::count(text, '{');
    EXPECT_TRUE(begun.out.starts_with(map + ": " + std::to_string(labels) + " labels, ")) << begun.out;
    const std::vector<std::string> import{"import", bare, "--map", map, "-o", vdb};
    expectRefusal(import, "no tissue '?': write in the label map which one it is");
    expectRefusal(import, map + ": label ");
    for (std::size_t at = text.find("\"?\"", text.find("labels")); at != std::string::npos; at = text.find("\"?\"", at)) {
        text.replace(at, 3, "\"liver\"");
    }
    writeText(map, text);
    EXPECT_EQ(tissueOf(figures({"import", bare, "--map", map, "-o", vdb}), "label 3"), "liver");
}

// Each step reports what it did, and the volume holds it; nothing is done that was not asked for.
TEST_F(Researcher, StepsAreReportedToTheVoxel)
{
    const auto plain = voxelsOf(figures({"import", seg, "-o", vdb}));
    EXPECT_TRUE(figures({"import", seg, "-o", vdb}).at("steps").empty());
    const auto j =
        figures({"import", seg, "-o", vdb, "--largest-component", "Left lesion", "--add-skin", "4mm", "--pad", "8"});
    const auto after = voxelsOf(j);
    EXPECT_EQ(after.at("Left lesion"), plain.at("Left lesion") - 2);
    EXPECT_EQ(tissueOf(j, "skin"), "skin");
    std::uint64_t skin = 0;
    for (const auto& step : j.at("steps")) {
        skin +=
            step.at("step") == "add-skin" && step.at("structure") == "skin" ? step.at("voxels").get<std::uint64_t>() : 0;
    }
    EXPECT_EQ(skin, after.at("skin"));
    EXPECT_EQ(after.at("Body") + after.at("Left lesion") + after.at("Aorta") + after.at("skin"),
              plain.at("Body") + plain.at("Left lesion") + plain.at("Aorta"));
    EXPECT_EQ(j.at("size"), (std::vector<int>{44 + 8, 36 + 8, 20 + 4}));
    const auto cubes =
        figures({"import", seg, "-o", vdb, "--voxel", "2mm", "--crop", "Left lesion", "--crop-margin", "10"});
    EXPECT_NEAR(cubes.at("spacing_mm").at(2).get<double>(), 2.0, 1e-9);
    EXPECT_EQ(cubes.at("steps").at(0).at("step"), "crop");
    for (const auto& step : cubes.at("steps")) {
        if (step.contains("before_ml") && step.at("structure") == "Left lesion") {
            EXPECT_LT(std::abs(step.at("change_pct").get<double>()), 5.0);
        }
    }
    expectRefusal({"import", seg, "-o", vdb, "--crop", "liver"}, "--crop liver: there is no structure");
    expectRefusal({"import", seg, "-o", vdb, "--voxel", "huge"}, "--voxel huge: must be a length");
    expectRefusal({"import", seg, "-o", vdb, "--close-skin-holes"}, "nothing in the volume is skin");
}

// An image on another grid, and what it does to the stiffness.
TEST_F(Researcher, AnImageOnAnotherGridScalesTheStiffness)
{
    const volume::VoxelGrid grid{{30, 30, 30}, {Mat3(4e-3), Vec3(-58e-3)}};
    std::vector<float> values;
    volume::forEachIndex(Index3(0), grid.size - 1, [&](Index3 n) {
        values.push_back(static_cast<float>(500.0 + 1e3 * grid.affine.toPatient(Vec3(n)).x));
    });
    const std::string image = folder / "mr.nrrd", map = folder / "map.toml", out = folder / "kpa.nrrd";
    volume::exportImage(image, grid, values);
    writeText(map, "points = [[400, 0.1], [600, 2.1]]\n");  // factor = 1.1 + x / 100 mm
    const auto j = figures({"import", seg, "-o", vdb, "--image", image, "--stiffness-from", map});
    EXPECT_GT(j.at("grids_mb").at("image").get<double>(), 0.0);
    ASSERT_EQ(palpate({"export", vdb, "-o", out, "--what", "stiffness"}).status, 0);
    const volume::ImportedImage stiffness = volume::importImage(out);
    const LabelImage labels = patient();
    volume::forEachIndex(Index3(0), labels.size - 1, [&](Index3 n) {
        if (labels.values[labels.offset(n)] == 1) {
            const double x = labels.affine.toPatient(Vec3(n)).x;
            ASSERT_NEAR(stiffness.values[labels.offset(n)], 10.0 * (1.1 + x / 0.1), 1e-3);
        }
    });
    expectRefusal({"import", seg, "-o", vdb, "--image", image, "--stiffness-from", "hu"}, "add --image-unit HU");
    const auto ct = figures({"import", seg, "-o", vdb, "--image", image, "--image-unit", "HU", "--stiffness-from", "hu"});
    EXPECT_EQ(ct.at("image"), "on the voxels of the tissue, in HU; scales the stiffness by 0.5 at -60 to 2 at 140");
    expectRefusal({"import", seg, "-o", vdb, "--stiffness-from", "hu"}, "add --image");
}

// Out of the program and in again: the same voxels, names and tissues at the same places.
TEST_F(Researcher, AnExportIsImportedAgainAsItWas)
{
    const auto before = figures({"import", seg, "-o", vdb, "--add-skin", "3"});
    const std::string again = folder / "again.vdb", map = folder / "again.toml";
    for (const std::string name : {"e.nii.gz", "e.nrrd", "e.seg.nrrd", "e.mhd"}) {
        SCOPED_TRACE(name);
        const std::string file = folder / name;
        ASSERT_EQ(palpate({"export", vdb, "-o", file, "--write-map", map}).status, 0);
        const auto after = figures({"import", file, "--map", map, "-o", again});
        EXPECT_EQ(after.at("labels"), before.at("labels"));
        EXPECT_EQ(after.at("size"), before.at("size"));
        for (int k = 0; k < 3; ++k) {
            const auto i = static_cast<std::size_t>(k);
            EXPECT_NEAR(after.at("origin_mm").at(i).get<double>(), before.at("origin_mm").at(i).get<double>(), 1e-6);
        }
        EXPECT_EQ(after.at("provenance").at("label hash"), before.at("provenance").at("label hash"));
    }
    expectRefusal({"export", vdb, "-o", folder / "e.jpg"}, "is no format that is written");
    expectRefusal({"export", vdb, "-o", folder / "e.png"}, "needs a session");
    expectRefusal({"export", vdb, "-o", folder / "e.vtu"}, "needs a session");
    const std::vector<std::string> scan{"export", "--record", folder / "r.db",  "--at",
                                        "1s",     "-o",       folder / "e.png", "--what"};
    const std::vector<std::vector<std::string>> ignored{{"ct", "--width", "900"}, {"ultrasound", "--window", "bone"}};
    for (const auto& more : ignored) {
        std::vector<std::string> words = scan;
        words.insert(words.end(), more.begin(), more.end());
        expectRefusal(words, more[1] + ": is for");
    }
    expectRefusal({"export", vdb, "-o", folder / "e.nrrd", "--height", "900"}, "--height: is for");
    expectRefusal({"export", vdb, "-o", folder / "e.nrrd", "--nifti2"}, "--nifti2: is for .nii and .nii.gz");
    expectRefusal({"export", vdb, "-o", folder / "e.nrrd", "--what", "image"}, "holds no image");
}

// OpenVDB's own tool lists our grids, with the voxels that we count.
TEST_F(Researcher, OtherOpenVdbToolsReadTheVolume)
{
    if (std::system("command -v vdb_print > /dev/null") != 0) {
        GTEST_SKIP() << "vdb_print is not installed (libopenvdb-tools)";
    }
    const auto j = figures({"import", seg, "-o", vdb});
    const std::string list = folder / "grids.txt";
    ASSERT_EQ(std::system(("vdb_print -l '" + vdb + "' > '" + list + "' 2>&1").c_str()), 0);
    std::string text = readText(list);
    std::erase(text, ',');  // thousands
    for (const char* grid : {"label", "stiffness", "occupancy"}) {
        EXPECT_NE(text.find(grid), std::string::npos) << text;
    }
    const auto voxels = voxelsOf(j);
    const std::uint64_t active = voxels.at("Body") + voxels.at("Left lesion") + voxels.at("Aorta");
    EXPECT_NE(text.find(std::to_string(active)), std::string::npos) << text;
}

// From a segmentation to a biopsy, and the deformed tissue back to a file.
TEST_F(Researcher, ASceneIsProposedRunsAndItsStatesAreExported)
{
    ASSERT_EQ(palpate({"import", seg, "-o", vdb, "--add-skin", "3mm", "--pad", "10mm"}).status, 0);
    const std::string scene = folder / "biopsy.toml", record = folder / "s.db";
    const auto j = figures({"scene", vdb, "--target", "Left lesion", "--vital", "Aorta", "-o", scene});
    ASSERT_GE(j.at("ways").size(), 2U);
    EXPECT_EQ(j.at("vital"), (std::vector<std::string>{"Aorta"}));
    EXPECT_NE(readText(scene).find("file = \"patient.vdb\""), std::string::npos);
    for (const auto& way : j.at("ways")) {
        EXPECT_GE(way.at("clearance_mm").get<double>(), 1.5);
    }
    const auto trained = figures({"train", scene, "--headless", "--unpaced", "--model", "chainmail", "--record", record});
    ASSERT_FALSE(trained.at("core").empty());
    EXPECT_GT(trained.at("core").at(0).at("length_in_lesion_mm").get<double>(), 5.0);

    const std::string rest = folder / "rest.nii.gz", first = folder / "first.nii.gz", field = folder / "u.nii.gz";
    ASSERT_EQ(palpate({"export", vdb, "-o", rest}).status, 0);
    ASSERT_EQ(palpate({"export", "--record", record, "--at", "0s", "-o", first}).status, 0);
    EXPECT_EQ(volume::importLabels(rest).image.values, volume::importLabels(first).image.values);
    const auto moved = figures({"export", "--record", record, "--at", "3s", "-o", field, "--what", "displacement"});
    EXPECT_GE(moved.at("tick").get<int>(), 2999);
    ASSERT_EQ(palpate({"export", "--record", record, "--at", "3s", "-o", folder / "u.vtu"}).status, 0);
    const std::string vtu = readText(folder / "u.vtu");
    EXPECT_NE(vtu.find("displacement_mm"), std::string::npos);
    expectRefusal({"export", "--record", record, "--at", "900s", "-o", field}, "the record runs from 0 s to");
    expectRefusal({"export", "--record", record, "--at", "3s", "-o", folder / "u.foo"},
                  ".mhd; of a record also .vtu and .png");
    expectRefusal({"scene", vdb, "--target", "spleen", "-o", scene},
                  "--target spleen: the volume has no structure or tissue");
    expectRefusal({"scene", vdb, "--lesion-in", "Aorta", "--lesion", "30mm", "-o", scene}, "has no room");
}

// What is named takes the place of what the volume's roles say.
TEST_F(Researcher, VitalStructuresAreThoseThatAreNamed)
{
    ASSERT_EQ(palpate({"import", seg, "-o", vdb, "--add-skin", "3mm", "--pad", "10mm"}).status, 0);
    const std::string scene = folder / "biopsy.toml";
    const auto vitalOf = [&](const std::string& names) {
        std::vector<std::string> words{"scene", vdb, "--target", "Aorta", "-o", scene};
        names.empty() ? void() : static_cast<void>(words.insert(words.end(), {"--vital", names}));
        const auto named = figures(words).at("vital").get<std::vector<std::string>>();
        EXPECT_EQ(readText(scene).find("name = \"Left lesion\"") != std::string::npos, !names.empty());
        return named;
    };
    EXPECT_EQ(vitalOf("Left lesion"), std::vector<std::string>{"Left lesion"});
    EXPECT_NE(vitalOf(""), std::vector<std::string>{"Left lesion"});
    const auto refused = [&](const std::string& names, const std::string& why) {
        expectRefusal({"scene", vdb, "--target", "Left lesion", "--vital", names, "-o", scene}, why);
    };
    refused("spleen", "--vital spleen: the volume has no structure or tissue of this name");
    refused("Aorta,Aorta", "--vital Aorta: is named twice: leave it out");
    refused("Left lesion", "--vital Left lesion: is the target: leave it out");
}

}  // namespace
}  // namespace palpate::apps
