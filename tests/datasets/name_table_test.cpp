// Colour tables and dataset.json that give names to labels.
#include <tests/error_of.h>
#include <tests/folder.h>
#include <volume/prepare/name_table.h>

#include <gtest/gtest.h>

#include <fstream>

namespace palpate::prepare {
namespace {

namespace fs = std::filesystem;

class NamesOfTables : public ::testing::Test {
protected:
    fs::path write(const fs::path& name, const std::string& text) const
    {
        const fs::path file = folder.path() / name;
        fs::create_directories(file.parent_path());
        std::ofstream(file) << text;
        return file;
    }
    // "VALUE NAME; .." of a table.
    static std::string read(const fs::path& file)
    {
        std::string out;
        for (const NameTable::Entry& e : readNameTable(file).entries) {
            out += std::to_string(e.value) + " " + e.name + "; ";
        }
        return out;
    }
    static volume::ImportedLabels bare() { return {}; }

    const tests::Folder folder;
    const LabelCounts counts{{0, 9}, {1, 5}, {2, 3}};
};

TEST_F(NamesOfTables, AreReadFromEveryKindOfTable)
{
    EXPECT_EQ(read(write("s.ctbl",
                         "# Color table file s.ctbl\n# 3 values\n0 background 0 0 0 0\n1 right_lung 10 20 30 255\r\n"
                         "2 left lung 4 5 6 255\n")),
              "0 background; 1 right_lung; 2 left lung; ");
    EXPECT_EQ(read(write("FreeSurferColorLUT.txt",
                         "#No. Label Name:      R   G   B   A\n\n0   Unknown     0 0 0 0\n"
                         "17  Left-Hippocampus       220 216 20  0\n"
                         "12175  ctx_rh_S_temporal_transverse  221 60 60 0\n")),
              "0 Unknown; 17 Left-Hippocampus; 12175 ctx_rh_S_temporal_transverse; ");
    EXPECT_EQ(read(write("snap.txt",
                         "#####\n# ITK-SnAP Label Description File\n    0     0    0    0        0  0  0    \"Clear "
                         "Label\"\n    1   255    0    0        1  1  1    \"Liver, right\"\n")),
              "0 Clear Label; 1 Liver, right; ");
    EXPECT_EQ(read(write("msd.json", R"({"name": "Liver", "labels": {"0": "background", "1": "liver", "2": "cancer"}})")),
              "0 background; 1 liver; 2 cancer; ");
    EXPECT_EQ(read(write("nnunet.json", R"({"labels": {"background": 0, "liver": 1, "whole": [1, 2], "tumour": [2]}})")),
              "0 background; 1 liver; 2 tumour; ");
    const NameTable table = readNameTable(folder / "s.ctbl");
    EXPECT_EQ(table.entries[1].colour, (std::array<std::uint8_t, 3>{10, 20, 30}));
    EXPECT_EQ(readNameTable(folder / "nnunet.json").regions, std::vector<std::string>{"whole"});
}

TEST_F(NamesOfTables, OfWhatIsNoTableAreRefusedWithTheLine)
{
    const auto error = [&](const std::string& text) { return tests::errorOf([&] { read(write("t.txt", text)); }); };
    EXPECT_NE(error("1 a 1 2 3 4\nliver\n").find("t.txt:2: neither VALUE NAME R G B A"), std::string::npos);
    EXPECT_NE(error("1 a 1 2 3\n").find("t.txt:1:"), std::string::npos);
    EXPECT_NE(error("").find("holds no names of labels"), std::string::npos);
    EXPECT_NE(error("{\"labels\": ").find("is not JSON"), std::string::npos);
    EXPECT_NE(error("{\"label\": {}}").find("is JSON without \"labels\""), std::string::npos);
    EXPECT_NE(error("{\"labels\": {\"liver\": 1.5}}").find("labels: \"liver\" is neither"), std::string::npos);
    EXPECT_NE(error(std::string(200000, 'x')).find("t.txt:1:"), std::string::npos);
    EXPECT_NE(tests::errorOf([&] { read(folder / "none"); }).find("there is no such file"), std::string::npos);
    EXPECT_NE(tests::errorOf([&] { read(folder.path()); }).find("is a folder, not a file"), std::string::npos);
}

TEST_F(NamesOfTables, AreGivenToLabelsThatHaveNone)
{
    MappingOptions options;
    options.names = write("t.ctbl", "1 liver 1 2 3 255\n7 spleen 1 2 3 255\n");
    volume::ImportedLabels labels = bare();
    addNames(options, "f.nii", counts, labels);
    ASSERT_EQ(labels.names.size(), 1U);
    EXPECT_EQ(labels.names[0].name, "liver");
    ASSERT_EQ(labels.warnings.size(), 1U);
    EXPECT_EQ(labels.warnings[0], "t.ctbl has no name for 1 of the labels: 2");

    // By the value that the file has, not by the one that --renumber gave.
    labels = bare();
    labels.renumbered = {{7, 2}};
    addNames(options, "f.nii", counts, labels);
    ASSERT_EQ(labels.names.size(), 2U);
    EXPECT_EQ(labels.names[1].name, "spleen");
}

TEST_F(NamesOfTables, ThatContradictTheFileOrNameNothingAreRefused)
{
    MappingOptions options;
    options.names = write("t.ctbl", "1 liver 1 2 3 255\n2 tumor 1 2 3 255\n");
    volume::ImportedLabels labels = bare();
    labels.names = {{1, "Liver", ""}, {2, "spleen", ""}};
    const auto add = [&] { addNames(options, "f.nii", counts, labels); };
    EXPECT_NE(tests::errorOf(add).find("2 is 'spleen' in the file and 'tumor' in the table"), std::string::npos);
    labels.names = {{1, "Liver", ""}, {2, "label 2", ""}};
    add();
    EXPECT_EQ(labels.names[1].name, "tumor");

    options.names = write("o.ctbl", "5 liver 1 2 3 255\n");
    EXPECT_NE(tests::errorOf(add).find("names none of the labels of f.nii (1; 2)"), std::string::npos);
    options.names = write("d.ctbl", "1 liver 1 2 3 255\n1 spleen 1 2 3 255\n");
    EXPECT_NE(tests::errorOf(add).find("calls label 1 both 'liver' and 'spleen'"), std::string::npos);
}

// dataset.json of MSD and nnU-Net where the file lies in their folders, and nowhere else.
TEST_F(NamesOfTables, AreFoundOnlyWhereTheyCertainlyBelong)
{
    const MappingOptions options;
    const std::string json = R"({"labels": {"0": "background", "1": "liver", "2": "cancer"},
        "training": [{"image": "./imagesTr/a.nii.gz", "label": "./labelsTr/a.nii.gz"}]})";
    write("Task03_Liver/dataset.json", json);
    const fs::path task = folder / "Task03_Liver";
    volume::ImportedLabels labels = bare();
    addNames(options, task / "labelsTr" / "a.nii.gz", counts, labels);
    ASSERT_EQ(labels.names.size(), 2U);
    EXPECT_EQ(labels.names[1].name, "cancer");
    ASSERT_EQ(labels.warnings.size(), 1U);
    EXPECT_EQ(labels.warnings[0], "names of labels are those of " + (task / "dataset.json").string());

    labels = bare();
    addNames(options, task / "labelsTr" / "b.nii.gz", counts, labels);
    EXPECT_TRUE(labels.names.empty());
    ASSERT_EQ(labels.warnings.size(), 1U);
    EXPECT_NE(labels.warnings[0].find("is not used: it does not list b.nii.gz"), std::string::npos);

    labels = bare();
    addNames(options, task / "other" / "a.nii.gz", counts, labels);
    addNames(options, task / "a.nii.gz", counts, labels);
    EXPECT_TRUE(labels.names.empty() && labels.warnings.empty());

    // A prediction of nnU-Net has its plans beside it.
    write("out/dataset.json", R"({"labels": {"background": 0, "liver": 1, "cancer": 2}})");
    write("out/plans.json", "{}");
    addNames(options, folder / "out/x.nii.gz", counts, labels);
    EXPECT_EQ(labels.names.size(), 2U);

    // Names in the file are its own.
    labels = bare();
    labels.names = {{1, "spleen", ""}};
    addNames(options, task / "labelsTr" / "a.nii.gz", counts, labels);
    EXPECT_EQ(labels.names.size(), 1U);
}

}  // namespace
}  // namespace palpate::prepare
