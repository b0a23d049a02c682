#include <datasets/label_map.h>
#include <datasets/tables.h>
#include <tests/error_of.h>
#include <tests/folder.h>

#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <regex>
#include <set>

namespace palpate::datasets {
namespace {

using tests::Folder;

const std::filesystem::path data = PALPATE_TEST_DATA;

std::map<int, std::string> namesOf(const std::string& map)
{
    std::map<int, std::string> out;
    for (const volume::LabelName& label : labelMap(map).labels) {
        out[label.value] = label.name;
    }
    return out;
}

// FreeSurferColorLUT.txt of FreeSurfer 6: the right side's values of aseg lie 39 above the left's up to the thalamus, those
// of the cortex's parcels 1000 above.
TEST(LabelMap, FreeSurferHasBothSidesAlike)
{
    const auto names = namesOf("freesurfer");
    EXPECT_EQ(names.at(17), "Left-Hippocampus");
    EXPECT_EQ(names.at(16), "Brain-Stem");
    EXPECT_EQ(names.at(1024), "ctx-lh-precentral");
    EXPECT_EQ(names.at(2035), "ctx-rh-insula");
    for (const int left : {2, 3, 4, 5, 7, 8, 10, 11, 12, 13}) {
        EXPECT_EQ(names.at(left).substr(4), names.at(left + 39).substr(5));
    }
    for (int parcel = 1000; parcel <= 1035; ++parcel) {
        EXPECT_EQ(names.at(parcel).substr(6), names.at(parcel + 1000).substr(6));
    }
}

// The atlases' own colour tables have the same values and names.
TEST(LabelMap, SplAtlasesAgreeWithTheirColourTables)
{
    const std::pair<const char*, const char*> tables[] = {{"spl-abdomen", "spl_abdomen_atlas/AbdominalAtlasColors.ctbl"},
                                                          {"spl-brain", "spl_brain_atlas/hncma-atlas-lut.ctbl"}};
    for (const auto& [map, file] : tables) {
        std::ifstream in(data / file);
        if (!in) {
            GTEST_SKIP() << "no test volumes in " << data;
        }
        const auto names = namesOf(map);
        std::size_t rows = 0;
        for (std::string line; std::getline(in, line);) {
            std::smatch row;
            if (!std::regex_match(line, row, std::regex("(\\d+) (\\S+)( \\d+){4}\\s*")) || std::stoi(row[1]) >= 5000) {
                continue;
            }
            std::string name = names.at(std::stoi(row[1]));
            std::replace(name.begin(), name.end(), ' ', '_');
            EXPECT_EQ(name, row[2].str());
            ++rows;
        }
        EXPECT_GT(rows, 90U);
    }
}

TEST(LabelMap, WhatIsWrittenIsReadBack)
{
    const Folder folder;
    LabelMap map{"mine", {{7, "a \"b\" \\ c", "fat"}, {65535, "\xc3\xa4", "skin"}}, {{"left lung", "lung"}}};
    std::ofstream(folder / "m.toml") << labelMapText(map);
    const LabelMap back = labelMap(folder / "m.toml");
    EXPECT_EQ(back.name, map.name);
    ASSERT_EQ(back.labels.size(), 2U);
    EXPECT_EQ(back.labels[0].name, map.labels[0].name);
    EXPECT_EQ(back.labels[1].value, 65535);
    EXPECT_EQ(back.segments, map.segments);
}

TEST(StructureNames, KnowWhatSegmentersWrite)
{
    const StructureNames names;
    const std::pair<const char*, const char*> known[] = {{"left lung", "lung"},
                                                         {"Lung (upper lobe) L", "lung"},
                                                         {"ribs", "rib"},
                                                         {"rib_left_7", "rib"},
                                                         {"vertebrae_T12", "bone"},
                                                         {"lumbar vertebral column", "bone"},
                                                         {"Aorta", "artery"},
                                                         {"inferior_vena_cava", "vein"},
                                                         {"skeletal_muscle", "muscle"},
                                                         {"Kidneys", "kidney"},
                                                         {"Left-Cerebral-Cortex", "grey_matter"},
                                                         {"subcutaneous_fat", "fat"},
                                                         {"tumor", "tumour"},
                                                         {"Lymph nodes", "lymph_node"},
                                                         {"Renal cyst", "cyst"},
                                                         {"tibia_left", "bone"},
                                                         {"Sigmoid colon", "bowel"},
                                                         {"esophagus", "esophagus"},
                                                         {"Right Adrenal Gland (RAG)", "adrenal"},
                                                         {"Inferior Vena Cava (IVC)", "vein"},
                                                         {"thyroid lobe left", "thyroid"},
                                                         {"temporal_lobe", "brain"}};
    for (const auto& [name, tissue] : known) {
        EXPECT_EQ(names.tissueOf(name).value_or("unknown"), tissue) << name;
    }
    // What only speaks of a tissue is not taken for it.
    for (const char* name :
         {"liver metastasis margin", "rib fracture", "left ventricle", "ventricle", "vessel", "breast", "edema", "PZ",
          "cancer margin", "123", "", "Segment_4", "unknown", "temporal", "frontal", "V", "left VI l", "VIIIb", "face"}) {
        EXPECT_FALSE(names.tissueOf(name)) << name;
    }
    EXPECT_EQ(names.suggestion("liver metastasis margin").value_or(""), "liver");
    EXPECT_FALSE(names.suggestion("Segment_4"));
}

// Every tissue of names.toml and of the label maps is in the table: else a name would lead nowhere.
TEST(StructureNames, LeadToTissuesThatThereAre)
{
    const volume::TissueTable table = defaultTissues();
    const StructureNames names;
    std::size_t found = 0;
    for (const volume::TissueRow& row : table.rows) {
        const auto tissue = names.tissueOf(row.name);
        found += tissue == row.name ? 1 : 0;
        if (tissue) {
            EXPECT_TRUE(table.find(*tissue)) << row.name;
        }
    }
    EXPECT_GT(found, 30U);
}

// Every built-in map says where it comes from, and has tissues that there are.
TEST(LabelMap, EveryBuiltInMapHasItsSourceAndItsTissues)
{
    const volume::TissueTable table = defaultTissues();
    std::set<std::string> names;
    for (const LabelMap& map : labelMaps()) {
        EXPECT_FALSE(map.source.empty()) << map.name;
        EXPECT_TRUE(names.insert(map.name).second) << map.name << " is there twice";
        EXPECT_FALSE(map.labels.empty()) << map.name;
        for (const volume::LabelName& label : map.labels) {
            EXPECT_TRUE(table.find(label.tissue)) << map.name << ": " << label.tissue;
            EXPECT_FALSE(label.name.empty()) << map.name << ": " << label.value;
        }
    }
    EXPECT_GE(names.size(), 60U);
}

// The same name means the same tissue whichever general map it is in, unless names.toml calls it ambiguous: else the order
// of the maps would decide.
TEST(StructureNames, MeanTheSameInAllGeneralMaps)
{
    const StructureNames names;
    for (const LabelMap& map : labelMaps()) {
        for (const volume::LabelName& label : map.labels) {
            const auto tissue = names.tissueOf(label.name);
            if (map.general && tissue) {
                EXPECT_EQ(*tissue, label.tissue) << map.name << ": " << label.name;
            }
        }
    }
}

// FreeSurferColorLUT.txt: Destrieux's parcels have the same numbers on both sides, and in the white matter 2000 more.
TEST(LabelMap, DestrieuxHasBothSidesAlike)
{
    const auto names = namesOf("destrieux");
    EXPECT_EQ(names.at(11101), "ctx_lh_G_and_S_frontomargin");
    EXPECT_EQ(names.at(12175), "ctx_rh_S_temporal_transverse");
    for (int parcel = 11100; parcel <= 11175; ++parcel) {
        EXPECT_EQ(names.at(parcel).substr(7), names.at(parcel + 1000).substr(7));
        EXPECT_EQ(names.at(parcel).substr(7), names.at(parcel + 2000).substr(6));
        EXPECT_EQ(names.at(parcel).substr(7), names.at(parcel + 3000).substr(6));
    }
}

std::string errorOfMap(const std::string& text)
{
    const Folder folder;
    std::ofstream(folder / "s.toml") << text;
    const std::string what = tests::errorOf([&] { stiffnessMap(folder / "s.toml", "HU", defaultTissues()); });
    return what.substr(what.rfind('/') + 1);
}

TEST(StiffnessMap, IsLinearBetweenItsPointsAndConstantBeyond)
{
    const volume::StiffnessMap map{{{-50, 0.5}, {50, 1.5}, {100, 3}}, {}, {}};
    EXPECT_DOUBLE_EQ(map.factor(-1000), 0.5);
    EXPECT_DOUBLE_EQ(map.factor(-50), 0.5);
    EXPECT_DOUBLE_EQ(map.factor(0), 1.0);
    EXPECT_DOUBLE_EQ(map.factor(75), 2.25);
    EXPECT_DOUBLE_EQ(map.factor(3000), 3.0);
    EXPECT_DOUBLE_EQ(volume::StiffnessMap{}.factor(3), 1.0);
    EXPECT_DOUBLE_EQ(stiffnessMap("hu", "HU", defaultTissues()).factor(40), 1.0);
}

TEST(StiffnessMap, ErrorsNameFileLineAndRemedy)
{
    EXPECT_EQ(errorOfMap("points = [[0, 1], [10, 2]]\ntissues = [\"fat\"]\n"), "");
    EXPECT_NE(errorOfMap("points = [[10, 1], [0, 2]]\n").find("s.toml:1: points"), std::string::npos);
    EXPECT_NE(errorOfMap("points = [[0, 0]]\n").find("factors from 0.001"), std::string::npos);
    EXPECT_NE(errorOfMap("unit = \"T1\"\npoints = [[0, 1]]\n").find("the image is in HU"), std::string::npos);
    EXPECT_NE(errorOfMap("points = [[0, 1]]\ntissues = [\"jelly\"]\n").find("'jelly' is not in the tissue table"),
              std::string::npos);
    EXPECT_NE(errorOfMap("tissues = [\"fat\"]\n").find("points is missing"), std::string::npos);
}

}  // namespace
}  // namespace palpate::datasets
