// The options of `palpate import` and `palpate scene`, as they are typed: what each does, and how each is refused. A
// refusal is one line and leaves no volume.
#include <tests/apps/program.h>
#include <volume/export.h>
#include <volume/import.h>
#include <volume/tissue.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <random>

#include <sys/stat.h>

namespace palpate::apps {
namespace {

namespace fs = std::filesystem;
using volume::LabelImage;
using Arguments = std::vector<std::string>;

const std::string data = PALPATE_TEST_DATA;

// A MetaImage of 2 x 3 x 4 voxels, all of them 1 but for those given.
template <typename T>
std::string metaImage(const char* type, std::initializer_list<T> values,
                      const char* frame = "TransformMatrix = 1 0 0 0 1 0 0 0 1\n")
{
    std::vector<T> all(24, T{1});
    std::copy(values.begin(), values.end(), all.begin());
    return fmt::format("NDims = 3\nDimSize = 2 3 4\nElementSpacing = 1 2 3\n{}ElementType = {}\nElementDataFile = LOCAL\n",
                       frame, type) +
           std::string(reinterpret_cast<const char*>(all.data()), all.size() * sizeof(T));
}

class ImportOptions : public ::testing::Test {
protected:
    std::string write(const std::string& name, const std::string& bytes) const
    {
        writeText(folder / name, bytes);
        return folder / name;
    }

    Arguments import(const std::string& file, Arguments more) const
    {
        more.insert(more.begin(), {"import", file, "-o", vdb});
        return more;
    }

    void refused(const std::string& file, const Arguments& more, const std::string& hint) const
    {
        expectRefusal(import(file, more), hint);
        EXPECT_FALSE(fs::exists(vdb)) << hint;
    }

    nlohmann::json taken(const std::string& file, const Arguments& more) const
    {
        auto j = figures(import(file, more));
        EXPECT_TRUE(fs::remove(vdb));
        return j;
    }

    static bool warns(const nlohmann::json& j, const std::string& words)
    {
        return j.at("warnings").dump().find(words) != std::string::npos;
    }

    const Folder folder;
    const std::string vdb = folder / "o.vdb";
    const std::string one = write("one.mha", metaImage<std::uint8_t>("MET_UCHAR", {1, 2, 2}));
    const Arguments named{"--set", "1=fat", "--set", "2=liver"};

    Arguments with(Arguments more) const
    {
        more.insert(more.end(), named.begin(), named.end());
        return more;
    }
};

TEST_F(ImportOptions, ValuesThatAreNoLabelsAreRenumberedForWhoAsks)
{
    const std::string file = write("many.mha", metaImage<std::int32_t>("MET_INT", {70000, -3}));
    refused(file, {"--default-tissue", "fat"}, "--renumber");
    const auto j = taken(file, {"--renumber", "--set", "70000=liver", "--set", "-3=bone", "--set", "1=fat"});
    ASSERT_EQ(j.at("labels").size(), 3U);
    EXPECT_NE(j.dump().find("label 70000"), std::string::npos);
    refused(file, {"--renumber", "--map", "brats", "--set", "1=fat"}, "'label 70000'");
}

// The header names 1 and 3, and no voxel has 1 or 2: 70000 must not become what the header calls 1.
TEST_F(ImportOptions, ARenumberedValueTakesNoNameOfAnother)
{
    const std::string head =
        "NRRD0004\ntype: int\ndimension: 3\nspace: LPS\nsizes: 2 3 4\nspace directions: (1,0,0) (0,1,0) (0,0,1)\n"
        "endian: little\nencoding: raw\nSegment0_ID:=a\nSegment0_Name:=spleen\nSegment0_LabelValue:=1\nSegment0_Layer:=0\n"
        "Segment1_ID:=b\nSegment1_Name:=liver\nSegment1_LabelValue:=3\nSegment1_Layer:=0\n\n";
    std::vector<std::int32_t> values(24, 3);
    values[5] = 70000;
    const std::string file = write("two.seg.nrrd", head + std::string(reinterpret_cast<const char*>(values.data()), 96));
    refused(file, {"--renumber"}, "'label 70000'");
    const auto labels = taken(file, {"--renumber", "--set", "70000=bone"}).at("labels");
    ASSERT_EQ(labels.size(), 2U);
    EXPECT_EQ(labels[0].at("name"), "label 70000");
    EXPECT_EQ(labels[0].at("tissue"), "bone");
    EXPECT_EQ(labels[1].at("tissue"), "liver");

    // Nor does a map of the file hold it, or contradict a table of names for it.
    const std::string map = folder / "m.toml";
    EXPECT_EQ(palpate({"import", file, "--renumber", "--write-map", map}).status, 0);
    EXPECT_NE(readText(map).find("--set 70000=TISSUE"), std::string::npos);
    EXPECT_EQ(readText(map).find("label 70000\""), std::string::npos);
    EXPECT_EQ(taken(file, {"--renumber", "--map", map, "--set", "70000=bone"}).at("labels").size(), 2U);
    const std::string bare = write("bare.mha", metaImage<std::int32_t>("MET_INT", {70000})),
                      names = write("names.ctbl", "1 fat 1 2 3 255\n70000 liver 1 2 3 255\n");
    EXPECT_EQ(
        taken(bare, {"--renumber", "--names", names, "--map", "totalsegmentator", "--set", "1=fat"}).at("labels").size(),
        2U);
}

// The data beside a header, a mask of a folder, the names that are found by themselves.
TEST_F(ImportOptions, FiguresAndMapsReplaceNothingThatIsReadOrEdited)
{
    const std::string whole = metaImage<std::uint8_t>("MET_UCHAR", {1, 2, 2}), local = "LOCAL\n";
    const std::size_t head = whole.find(local);
    fs::create_directories(folder / "labelsTr");
    fs::create_directories(folder / "masks");
    const std::string raw = write("z.raw", whole.substr(head + local.size())),
                      pair = write("z.mhd", whole.substr(0, head) + "z.raw\n"), mask = write("masks/a.mha", whole),
                      listed = write("labelsTr/one.mha", whole),
                      names = write("dataset.json", R"({"labels": {"fat": 1, "liver": 2}})");
    const std::vector<std::array<std::string, 3>> cases{{pair, one, raw},
                                                        {one, pair, raw},
                                                        {folder / "masks", one, mask},
                                                        {one, folder / "masks", mask},
                                                        {listed, one, names}};
    for (const auto& [input, image, output] : cases) {
        const std::string before = readText(output);
        refused(input, with({"--image", image, "--json", output}),
                output + ": is a file that is read, and would be replaced");
        EXPECT_EQ(readText(output), before);
    }
    const std::string figures = write("masks/figures.json", "{}");
    EXPECT_EQ(palpate(import(pair, with({"--json", figures}))).status, 0);
    EXPECT_EQ(palpate(import(pair, with({"--json", figures}))).status, 0) << "figures of before are replaced";
    // In a folder that is read only its own figures are.
    writeText(mask, metaImage<std::uint8_t>("MET_UCHAR", {1, 1, 1}));
    const std::string masks = folder / "masks", own = folder / "masks/own.json";
    expectRefusal(import(masks, {"--set", "a=fat", "--json", write("masks/notes.json", R"({"labels": 3})")}),
                  "no import wrote it");
    EXPECT_EQ(readText(folder / "masks/notes.json"), R"({"labels": 3})");
    for (int i = 0; i < 2; ++i) {
        EXPECT_EQ(palpate(import(masks, {"--set", "a=fat", "--json", own})).err, "");
    }
    const std::string map = folder / "m.toml";
    EXPECT_EQ(palpate({"import", one, "--write-map", map}).status, 0);
    writeText(map, "edited");
    expectRefusal({"import", one, "--write-map", map}, map + ": is there already");
    EXPECT_EQ(readText(map), "edited");
}

TEST_F(ImportOptions, NearlyWholeValuesAreRoundedForWhoAsks)
{
    const std::string file = write("near.mha", metaImage<float>("MET_FLOAT", {0.99999994F, 2.0003F})),
                      far = write("far.mha", metaImage<float>("MET_FLOAT", {1.4F}));
    refused(file, named, "--round");
    const auto j = taken(file, with({"--round"}));
    EXPECT_EQ(j.at("labels").size(), 2U);
    refused(far, {"--round", "--set", "1=fat"}, "1.4");
}

TEST_F(ImportOptions, AVolumeOfSeveralIsChosen)
{
    const std::string head =
        "NDims = 4\nDimSize = 2 3 4 2\nElementSpacing = 1 2 3 1\nTransformMatrix = 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n"
        "ElementType = MET_UCHAR\nElementDataFile = LOCAL\n";
    const std::string file = write("two.mha", head + std::string(24, '\1') + std::string(24, '\2'));
    refused(file, {"--set", "1=fat"}, "holds 2 volumes");
    refused(file, {"--set", "1=fat", "--volume", "3"}, "--volume 3: it holds 2 volumes");
    expectRefusal(import(file, {"--volume", "0"}), "--volume: Value 0 not in range");
    EXPECT_EQ(taken(file, {"--volume", "2", "--set", "2=liver"}).at("labels").at(0).at("tissue"), "liver");
    refused(one, with({"--image", file}), "holds 2 volumes");
    refused(one, with({"--image", file, "--image-volume", "3"}), "--volume 3: it holds 2 volumes");
    refused(one, with({"--image-volume", "2"}), "--image-volume: needs the image: add --image FILE");
    EXPECT_EQ(taken(one, with({"--image", file, "--image-volume", "2"})).count("image"), 1U);
}

TEST_F(ImportOptions, AxesAreSaidWhereTheFileDoesNot)
{
    const std::string file = write("bare.mha", metaImage<std::uint8_t>("MET_UCHAR", {1, 2, 2}, ""));
    EXPECT_TRUE(warns(taken(file, named), "does not say which side is left"));
    const auto j = taken(file, with({"--axes", "RAS"}));
    EXPECT_FALSE(warns(j, "which side is left"));
    refused(file, with({"--axes", "RLA"}), "must be three letters");
    refused(one, with({"--axes", "RAS"}), "leave --axes out");
}

// Both files leave their axes open. The image has 1000 where the label is 2, and the stiffness map doubles there.
TEST_F(ImportOptions, AnImageThatDoesNotSayItsAxesHasThoseOfTheLabels)
{
    const std::string centred = "Offset = -0.5 -2 -4.5\n",
                      labels = write("bare.mha", metaImage<std::uint8_t>("MET_UCHAR", {1, 2, 1, 2, 1, 2}, centred.c_str())),
                      image = write("ct.mha", metaImage<float>("MET_FLOAT", {1, 1000, 1, 1000, 1, 1000}, centred.c_str())),
                      said =
                          write("said.mha", metaImage<float>("MET_FLOAT", {1, 1000, 1, 1000, 1, 1000},
                                                             (centred + "TransformMatrix = 1 0 0 0 1 0 0 0 1\n").c_str()));
    const auto valueIn = [&](const Arguments& more) {
        EXPECT_EQ(palpate(import(labels, with(more))).status, 0);
        const volume::Tissue tissue = volume::Tissue::load(vdb);
        fs::remove(vdb);
        const std::vector<std::uint16_t> label = tissue.labels().values;
        const std::vector<float> value = tissue.companion()->values;
        double sum = 0, count = 0;
        for (std::size_t i = 0; i < label.size(); ++i) {
            sum += label[i] == 2 ? static_cast<double>(value[i]) : 0.0;
            count += label[i] == 2 ? 1 : 0;
        }
        return sum / count;
    };
    EXPECT_DOUBLE_EQ(valueIn({"--image", image}), 1000.0);
    EXPECT_DOUBLE_EQ(valueIn({"--image", image, "--axes", "RAS"}), 1000.0);
    EXPECT_DOUBLE_EQ(valueIn({"--image", image, "--axes", "RAS", "--image-axes", "LPS"}), 1.0);
    EXPECT_DOUBLE_EQ(valueIn({"--image", said, "--axes", "RAS"}), 1.0) << "it says its own";
    refused(labels, with({"--image", said, "--image-axes", "RAS"}), "leave --axes out");
    refused(labels, with({"--image-axes", "RAS"}), "--image-axes: needs the image: add --image FILE");
}

TEST_F(ImportOptions, ABoxFarAwayHoldsNothing)
{
    for (const char* box : {"1e6,2e6,-1000,1000,-1000,1000", "3e9,4e9,-1000,1000,-1000,1000", "-1e300,-1e299,0,9,0,9"}) {
        refused(one, with({"--crop", box}), "no voxel lies there");
    }
}

TEST_F(ImportOptions, WhatIsOnlyOfDicomDoesNotPassInSilence)
{
    refused(one, with({"--series", "1.2.3"}), "leave --series out");
    refused(one, with({"--threshold", "0.3"}), "it is no fractional DICOM SEG");
    EXPECT_TRUE(warns(taken(one, with({"--dicom-labels"})), "--dicom-labels decides nothing"));
    expectRefusal(import(one, with({"--threshold", "1.5"})), "--threshold: Value 1.5 not in range");
    EXPECT_TRUE(warns(taken(one, with({"--overlap", "first"})), "--overlap decides nothing"));
    if (!fs::exists(data + "/highdicom_seg")) {
        GTEST_SKIP() << "no test volumes in " << data;
    }
    const std::string seg = data + "/highdicom_seg/seg_image_ct_binary_overlap.dcm",
                      fraction = data + "/highdicom_seg/seg_image_ct_true_fractional.dcm",
                      ct = data + "/dcmqi_seg/24x38x3/image";
    const auto voxels = [](const nlohmann::json& j) {
        std::vector<int> out;
        for (const auto& label : j.at("labels")) {
            out.push_back(label.at("voxels"));
        }
        return out;
    };
    const Arguments anything{"--default-tissue", "fat"};
    const auto by = [&](const std::string& file, Arguments more) {
        more.insert(more.end(), anything.begin(), anything.end());
        return voxels(taken(file, more));
    };
    EXPECT_NE(by(seg, {"--overlap", "first"}), by(seg, {"--overlap", "last"}));
    refused(seg, {"--threshold", "0.3", "--default-tissue", "fat"}, "leave --threshold out");
    refused(seg, {"--overlap", "sideways", "--default-tissue", "fat"}, "sideways");
    EXPECT_GT(by(fraction, {"--threshold", "0.1"}).at(1), by(fraction, {"--threshold", "0.5"}).at(1));
    refused(fraction, {"--threshold", "0.6", "--default-tissue", "fat"}, "no voxel is set in any of its segments");
    refused(ct, {"--default-tissue", "fat"}, "--dicom-labels");
    refused(ct, {"--dicom-labels", "--series", "1.2.3", "--default-tissue", "fat"}, "1.2.3");
    EXPECT_FALSE(by(ct, {"--dicom-labels", "--renumber"}).empty());
}

TEST_F(ImportOptions, TablesOfEveryKindGiveNames)
{
    const std::pair<const char*, const char*> tables[] = {
        {"slicer.ctbl", "# Color\n1 fat 10 20 30 255\n2 liver 10 20 30 255\n"},
        {"snap.txt", "1 10 20 30 1 1 1 \"fat\"\n2 10 20 30 1 1 1 \"liver\"\n"},
        {"lut.txt", "#No. Label Name: R G B A\n1   fat   10 20 30 0\n2   liver   10 20 30 0\n"},
        {"dataset.json", R"({"labels": {"0": "background", "1": "fat", "2": "liver"}})"},
        {"nnunet/dataset.json", R"({"labels": {"background": 0, "fat": 1, "liver": 2}})"}};
    fs::create_directory(folder / "nnunet");
    for (const auto& [name, text] : tables) {
        SCOPED_TRACE(name);
        const auto j = taken(one, {"--names", write(name, text)});
        EXPECT_EQ(j.at("labels").at(0).at("tissue"), "fat");
        EXPECT_EQ(j.at("labels").at(1).at("tissue"), "liver");
    }
    refused(one, {"--names", write("broken.json", "{\"labels\": [1, 2]}")}, "broken.json");
    refused(one, {"--names", one}, "neither VALUE NAME R G B A");
    refused(one, {"--names", write("dataset.json", R"({"labels": {"fat": 1, "frobnicator": 2}})")}, "2 'frobnicator'");
    refused(one, {"--names", write("dataset.json", R"({"labels": {"aorta": 1, "fat": 2}})"), "--map", "totalsegmentator"},
            "1 is 'aorta' (artery)");
}

TEST_F(ImportOptions, SettingsThatContradictEachOtherAreRefused)
{
    refused(one, with({"--set", "1=bone"}), "both name label 1: leave one out");
    EXPECT_EQ(taken(one, with({"--set", "1=fat"})).at("labels").size(), 2U) << "the same twice is no contradiction";
    const std::string table = write("t.ctbl", "1 fat 1 2 3 255\n2 liver 1 2 3 255\n");
    refused(one, {"--names", table, "--set", "liver=spleen", "--set", "2=kidney"}, "--set liver=spleen and --set 2=kidney");
    refused(one, with({"--crop-margin", "5"}), "--crop-margin requires --crop");
    refused(one, with({"--write-map", folder / "m.toml"}), "give -o V.vdb, or --write-map FILE");
    EXPECT_FALSE(fs::exists(folder / "m.toml"));
    expectRefusal({"import", one, "-o", folder / "o.nii"}, "a volume is a .vdb file");
    expectRefusal(import(one, with({"--tissues", folder / "none"})), "there is no such file");
}

TEST_F(ImportOptions, WhatIsNoFileIsCalledWhatItIs)
{
    const std::string loop = folder / "loop.nii", pipe = folder / "pipe.nii";
    fs::create_symlink(loop, loop);
    ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
    refused(loop, named, "link");
    refused(pipe, named, "pipe");
    refused("/dev/zero", named, "is a device");
    refused(one, with({"--image", pipe}), "pipe");
}

// --- Bodies around organs ----------------------------------------------------------------------------------------------

// A trunk of 240 x 180 x 120 mm in voxels of 3 mm: skin, fat, a wall of muscle, vertebrae with discs and a canal, two lungs
// above, a kidney with a tumour on each side's back, a liver and an aorta; CT numbers with noise.
struct PaperPatient {
    static constexpr double voxel = 3e-3;
    LabelImage organs{{90, 70, 40}, {Mat3(voxel), -0.5 * voxel* Vec3(89, 69, 39)}, {}};
    std::vector<float> ct, mr;

    enum Organ : std::uint16_t { none, kidney, tumour, lung, liver, vertebra, aorta };

    // What is at a place [mm], and its CT number.
    static std::pair<Organ, float> at(Vec3 p)
    {
        const auto away = [&](Vec3 q, double r) { return glm::length(p - q) < r; };
        const double wall = std::hypot(p.x / 120, p.y / 90);
        if (wall > 1) {
            return {none, -1000.0F};
        }
        if (away({62, 28, -20}, 9)) {
            return {tumour, 42.0F};
        }
        if (away({58, 28, -20}, 24) || away({-58, 28, -20}, 24)) {
            return {kidney, 32.0F};
        }
        if (p.z > 25 && (away({50, -5, 55}, 38) || away({-50, -5, 55}, 38))) {
            return {lung, -820.0F};
        }
        if (away({-45, -20, -5}, 28)) {
            return {liver, 58.0F};
        }
        if (std::hypot(p.x, p.y - 32) < 18) {
            const bool disc = std::fmod(p.z + 600, 30) < 6;
            return disc ? std::pair(none, 80.0F) : std::pair(vertebra, std::hypot(p.x, p.y - 32) > 14 ? 400.0F : 160.0F);
        }
        if (std::hypot(p.x - 4, p.y - 2) < 9) {
            return {aorta, 45.0F};
        }
        return {none, wall > 0.97 ? 30.0F : wall > 0.88 ? -105.0F : wall > 0.8 ? 55.0F : -95.0F};
    }

    PaperPatient()
    {
        std::mt19937 random(3);
        std::normal_distribution<float> noise(0, 12);
        volume::forEachIndex(Index3(0), organs.size - 1, [&](Index3 n) {
            const auto [organ, hu] = at(1e3 * organs.affine.toPatient(Vec3(n)));
            organs.values.push_back(organ);
            ct.push_back(hu + noise(random));
            mr.push_back(hu < -500 ? 0 : hu < -50 ? 900.0F : 300 + hu);
        });
    }

    // Label map with some of the organs, renumbered, as a public set has them.
    LabelImage with(const std::map<std::uint16_t, std::uint16_t>& values) const
    {
        LabelImage image = organs;
        for (std::uint16_t& v : image.values) {
            v = values.count(v) > 0 ? values.at(v) : std::uint16_t{0};
        }
        return image;
    }
};

class PublicPatient : public ImportOptions {
protected:
    static void SetUpTestSuite() { patient = std::make_unique<PaperPatient>(); }
    static void TearDownTestSuite() { patient.reset(); }

    void SetUp() override
    {
        const volume::VoxelGrid grid{patient->organs.size, patient->organs.affine};
        volume::exportImage(ct, grid, patient->ct);
        volume::exportImage(mr, grid, patient->mr);
    }

    std::string labels(const std::map<std::uint16_t, std::uint16_t>& values) const
    {
        volume::exportLabels(seg, patient->with(values), {});
        return seg;
    }

    // Two commands: a volume with its body, and a scene on it that nothing is wrong with; then a biopsy. What is invented
    // is no reason to trust a way: --strict refuses it.
    void expectBiopsy(const std::string& file, const Arguments& body, const Arguments& target, bool invented = false) const
    {
        figures(import(file, body));
        const std::string scene = folder / "s.toml";
        Arguments propose{"scene", vdb, "-o", scene};
        propose.insert(propose.end(), target.begin(), target.end());
        Arguments strict = propose;
        strict.push_back("--strict");
        if (invented) {
            expectRefusal(strict, "invented_soft_tissue is invented: no image shows what the way crosses there");
            EXPECT_FALSE(fs::exists(scene));
        } else {
            propose = strict;
        }
        const auto ways = figures(propose).at("ways");
        ASSERT_FALSE(ways.empty());
        EXPECT_EQ(ways.at(0).dump().find("lung"), std::string::npos) << ways.at(0);
        const auto trained =
            figures({"train", scene, "--trainee", "expert", "--headless", "--unpaced", "--setting", "fast"});
        EXPECT_LE(trained.at("score").at("beyond_target_mm").get<double>(), 3.0);
        EXPECT_GT(trained.at("score").at("best_target_pct").get<double>(), 40.0);
    }

    static std::unique_ptr<PaperPatient> patient;
    const std::string ct = folder / "ct.nii.gz", mr = folder / "mr.nii.gz", seg = folder / "seg.nii.gz";
    const Arguments fromCt{"--image", ct, "--image-unit", "HU", "--body-from-image"};
    Arguments and_(Arguments more) const
    {
        more.insert(more.end(), fromCt.begin(), fromCt.end());
        return more;
    }
};
std::unique_ptr<PaperPatient> PublicPatient::patient;

using Kept = std::map<std::uint16_t, std::uint16_t>;

TEST_F(PublicPatient, BodyFromImageSaysWhatItFoundAndWhatItNeeds)
{
    const std::string file = labels({{PaperPatient::kidney, 1}, {PaperPatient::tumour, 2}});
    const auto j = taken(file, and_({"--map", "kits"}));
    std::map<std::string, double> ml;
    for (const auto& step : j.at("steps")) {
        if (step.at("step") == "body-from-image") {
            ml[step.at("structure")] = step.at("voxels").get<double>() * 0.027;
        }
    }
    for (const char* name : {"body_skin", "body_fat", "body_muscle", "body_bone", "body_lung"}) {
        EXPECT_GT(ml[name], 20) << name;
    }
    double bone = 0;
    for (const std::uint16_t v : patient->organs.values) {
        bone += v == PaperPatient::vertebra ? 0.027 : 0;
    }
    EXPECT_NEAR(ml["body_bone"], bone, 0.1 * bone);
    refused(file, {"--map", "kits", "--body-from-image"}, "--body-from-image: needs the image: add --image FILE");
    refused(file, {"--map", "kits", "--body-from-image", "--image", ct}, "add --image-unit HU");
    refused(file, {"--map", "kits", "--body-from-image", "mr", "--image", ct}, "mr not in {ct}");
    refused(file, and_({"--map", "kits", "--body-from-hull", "10"}), "excludes");
    const volume::VoxelGrid far{Index3(8), {Mat3(3e-3), Vec3(1.0)}};
    const std::string elsewhere = folder / "elsewhere.nii.gz";
    volume::exportImage(elsewhere, far, std::vector<float>(512, -1000.0F));
    refused(file, {"--map", "kits", "--image", elsewhere, "--image-unit", "HU"}, "covers less than half");
    refused(labels({{PaperPatient::tumour, 2}, {PaperPatient::kidney, 1}}),
            {"--map", "kits", "--image", mr, "--image-unit", "K", "--body-from-image"}, "K not in {HU}");
    for (const char* wrong : {"1", "-5", "300", "thick", "nan"}) {
        refused(file, {"--map", "kits", "--body-from-hull", wrong}, "must be a length from 2mm to 200mm");
    }
    EXPECT_TRUE(warns(taken(file, {"--map", "kits", "--body-from-hull", "15"}), "the body around the labels is invented"));
}

TEST_F(PublicPatient, KidneyAndTumourOfKits)
{
    expectBiopsy(labels({{PaperPatient::kidney, 1}, {PaperPatient::tumour, 2}}), and_({"--map", "kits"}), {});
}

TEST_F(PublicPatient, ALungAlone)
{
    const std::string file = labels({{PaperPatient::lung, 1}});
    refused(file, and_({}), "or one of");  // a mask of 1 may be anything
    expectBiopsy(file, and_({"--set", "1=lung"}), {"--lesion-in", "label 1", "--lesion", "20"});
}

TEST_F(PublicPatient, ASpineInVerSesNumbers)
{
    const std::string file = labels({{PaperPatient::vertebra, 20}, {PaperPatient::liver, 99}});
    refused(file, and_({"--map", "verse"}), "no tissue is known for 1 of its labels: 99");
    expectBiopsy(file, and_({"--map", "verse", "--set", "99=liver"}), {"--lesion-in", "label 99", "--lesion", "15"});
}

TEST_F(PublicPatient, AnMrLiverInAnInventedBody)
{
    const std::string file = labels({{PaperPatient::liver, 63}});  // as CHAOS has it
    refused(file, {"--set", "63=liver", "--image", mr, "--body-from-image"}, "or invent a body with --body-from-hull MM");
    expectBiopsy(file, {"--set", "63=liver", "--image", mr, "--body-from-hull", "25"},
                 {"--lesion-in", "label 63", "--lesion", "15"}, true);
}

TEST_F(PublicPatient, AProstateInAnInventedBody)
{
    expectBiopsy(labels({{PaperPatient::liver, 1}}), {"--map", "msd-prostate", "--body-from-hull", "30"},
                 {"--lesion-in", "PZ", "--lesion", "10"}, true);
}

// What --strict refuses, and says without it.
TEST_F(PublicPatient, AStrictSceneHasSkin)
{
    const std::string file = labels({{PaperPatient::kidney, 1}, {PaperPatient::tumour, 2}}), scene = folder / "s.toml";
    ASSERT_EQ(palpate(import(file, {"--map", "kits"})).status, 0);
    expectRefusal({"scene", vdb, "--strict", "-o", scene}, "skin");
    EXPECT_FALSE(fs::exists(scene));
    const auto loose = palpate({"scene", vdb, "-o", scene});
    EXPECT_EQ(loose.status, 0) << loose.err;
    EXPECT_NE((loose.err + loose.out).find("skin"), std::string::npos);
}

}  // namespace
}  // namespace palpate::apps
