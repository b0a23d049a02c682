#include <datasets/label_map.h>
#include <datasets/tables.h>
#include <tests/error_of.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <set>

namespace palpate::datasets {
namespace {

using volume::Role;
using volume::TissueRow;
using volume::TissueTable;

const TissueRow& row(const TissueTable& table, const std::string& name)
{
    return table.rows.at(table.find(name).value());
}

TEST(TissueTable, EveryRowHasASourceAndPhysicalValues)
{
    for (const TissueRow& r : defaultTissues().rows) {
        SCOPED_TRACE(r.name);
        EXPECT_GE(r.source.size(), 10U);
        EXPECT_TRUE(r.poissonRatio >= 0 && r.poissonRatio < 0.5);
        EXPECT_TRUE(r.density > 1 && r.density < 2500);
        EXPECT_TRUE(r.compress > 0 && r.compress <= 1 && r.stretch >= 1 && r.shear >= 0);
        EXPECT_LE(r.cuttingForce, r.punctureForce) << "force drops after the puncture";
        if (r.role != Role::air) {
            EXPECT_TRUE(r.youngsModulus >= 100 && r.youngsModulus <= 2e10);
            EXPECT_TRUE(r.punctureForce > 0 && r.cuttingForce > 0 && r.frictionPerMetre > 0 && r.opacity > 0);
        }
    }
}

// Each figure has a source, or the word assumed; echo levels are on no scale that papers share.
TEST(TissueTable, EveryRowSaysWhatItDoesToUltrasoundAndFromWhere)
{
    for (const TissueRow& r : defaultTissues().rows) {
        SCOPED_TRACE(r.name);
        const volume::Acoustics& a = r.acoustics;
        EXPECT_TRUE(a.given());
        EXPECT_TRUE(a.soundSpeed > 300 && a.soundSpeed < 4000);
        EXPECT_TRUE(a.attenuation >= 0 && a.attenuationPower > 0);
        for (const char* column : {"c: ", "c, ", "attenuation: ", "echo: "}) {
            const bool both = a.source.find("c, attenuation: ") != std::string::npos;
            const bool needed = std::string(column) != (both ? "c: " : "c, ");
            EXPECT_EQ(a.source.find(column) != std::string::npos, needed) << column;
        }
    }
    EXPECT_EQ(row(defaultTissues(), "fat").acoustics.echo, 0) << "the reference";
}

// A row without such figures has those of the built-in table: by its name, else by its role.
TEST(TissueTable, TissuesThatSayNothingOfUltrasoundHaveStandIns)
{
    TissueRow mine = row(defaultTissues(), "liver");
    EXPECT_EQ(acousticsOf(mine).soundSpeed, 1586);
    mine.acoustics.soundSpeed = 1600;
    EXPECT_EQ(acousticsOf(mine).soundSpeed, 1600);
    mine.acoustics = {};
    EXPECT_EQ(acousticsOf(mine).soundSpeed, 1586);
    mine.name = "my own";
    EXPECT_EQ(acousticsOf(mine).soundSpeed, 1540);
    mine.role = Role::bone;
    EXPECT_EQ(acousticsOf(mine).soundSpeed, 3500);
}

TEST(TissueTable, AScenesEchoTakesThePlaceOfTheTables)
{
    const std::vector<TissueChange> changes{{"fat", {{"echo_db", -3.5}}}};
    const TissueTable changed = withChanges(defaultTissues(), changes);
    EXPECT_EQ(row(changed, "fat").acoustics.echo, -3.5);
    EXPECT_EQ(row(changed, "fat").acoustics.soundSpeed, 1440);
    EXPECT_EQ(row(changed, "gland").acoustics.echo, row(defaultTissues(), "gland").acoustics.echo);
}

// Samani, Zubovits, Plewes 2007, Phys Med Biol 52:1565, small strain [Pa].
TEST(TissueTable, BreastFollowsSamani2007)
{
    const TissueTable table = defaultTissues();
    const std::pair<const char*, double> samani[] = {
        {"fat", 3250},  {"gland", 3240}, {"fibroadenoma", 6400}, {"idc_low_grade", 10400},
        {"ilc", 15600}, {"dcis", 16400}, {"fibrocystic", 17100}, {"idc_high_grade", 42500}};
    for (const auto& [name, modulus] : samani) {
        EXPECT_DOUBLE_EQ(row(table, name).youngsModulus, modulus) << name;
        EXPECT_NE(row(table, name).source.find("Samani"), std::string::npos) << name;
    }
}

// A 10 mm push on 2 mm nodes is d = 5 spacings; it moves (2/3) d^3 / (a g^2) nodes, a = 1 - compress, g = shear.
TEST(TissueTable, APushOfSoftTissueMovesAbout1000Nodes)
{
    for (const char* name : {"fat", "gland", "liver"}) {
        const TissueRow r = row(defaultTissues(), name);
        const double moved = 2.0 / 3.0 * 125 / ((1 - r.compress) * r.shear * r.shear);
        EXPECT_TRUE(moved > 500 && moved < 1500) << name << " " << moved;
    }
}

TEST(TissueTable, SkinTakesMoreThanTwiceTheForceOfFat)
{
    const TissueTable table = defaultTissues();
    EXPECT_GE(row(table, "skin").punctureForce, 2 * row(table, "fat").punctureForce);
    EXPECT_DOUBLE_EQ(row(table, "liver").cuttingForce, 0.94);  // Okamura, Simone, O'Leary 2004
    EXPECT_TRUE(row(table, "liver").frictionPerMetre >= 10 && row(table, "liver").frictionPerMetre <= 19);
}

TEST(TissueTable, RolesSayWhatMustNotBeTouched)
{
    const TissueTable table = defaultTissues();
    EXPECT_EQ(table.rows.front().role, Role::air);
    for (const char* name : {"artery", "vein", "nerve", "heart"}) {
        EXPECT_EQ(row(table, name).role, Role::vital) << name;
    }
    for (const char* name : {"bone", "rib"}) {
        EXPECT_EQ(row(table, name).role, Role::bone) << name;
        EXPECT_TRUE(row(table, name).fixed) << name;
    }
}

class TissueFile : public ::testing::Test {
protected:
    std::string errorOf(const std::string& text)
    {
        std::ofstream(file_) << text;
        return tests::errorOf([&] { loadTissues(file_); });
    }
    void TearDown() override { std::filesystem::remove(file_); }

    const std::filesystem::path file_ =
        std::filesystem::temp_directory_path() / ("palpate_tissues_" + std::to_string(::getpid()) + ".toml");
};

const std::string airRow =
    "[[tissue]]\nname = \"air\"\nrole = \"air\"\nyoungs_kpa = 0\npoisson = 0\ndensity_kg_m3 = 1.2\ncompress = 0.5\n"
    "stretch = 2\nshear = 1\npuncture_n = 0\ncutting_n = 0\nfriction_n_per_m = 0\nfixed = false\ncolour = \"#000000\"\n"
    "opacity = 0\nsource = \"none\"\n";

std::string replaced(std::string text, const std::string& from, const std::string& to)
{
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
}

std::string fatRow()
{
    return replaced(replaced(replaced(airRow, "\"air\"", "\"fat\""), "\"air\"", "\"plain\""), "youngs_kpa = 0",
                    "youngs_kpa = 3");
}

TEST_F(TissueFile, ErrorsNameFileLineTissueKeyValueAndUnit)
{
    EXPECT_EQ(errorOf(airRow), "");
    const std::string fat = fatRow();
    EXPECT_EQ(errorOf(airRow + fat), "");
    const std::string at = file_.string() + ":20: tissue 'fat': youngs_kpa";  // 16 lines of air, then the fourth
    EXPECT_EQ(errorOf(airRow + replaced(fat, "youngs_kpa = 3", "youngs_kpa = -3")),
              at + " = -3 kPa: must be 0 to 2e+07 kPa");
    EXPECT_EQ(errorOf(airRow + replaced(fat, "youngs_kpa = 3", "youngs_kpa = \"soft\"")),
              at + " = \"soft\": expected a number in kPa, found text");
    EXPECT_EQ(errorOf(airRow + replaced(fat, "youngs_kpa = 3", "youngs_kpa = nan")),
              at + " = nan kPa: must be a finite number");
    EXPECT_NE(errorOf(airRow + replaced(fat, "youngs_kpa = 3", "youngs_kpa = 0")).find(at), std::string::npos);
    EXPECT_EQ(errorOf(airRow + replaced(fat, "youngs_kpa = 3", "young_kpa = 3")),
              file_.string() + ":17: tissue 'fat': youngs_kpa is missing (kPa)");
    EXPECT_NE(errorOf(airRow + fat + "colr = 3\n").find("unknown key; did you mean colour?"), std::string::npos);
    EXPECT_NE(errorOf(airRow + replaced(fat, "#000000", "#0000zz")).find("must be \"#rrggbb\""), std::string::npos);
    EXPECT_NE(errorOf(airRow + airRow).find("name = \"air\": is there twice"), std::string::npos);
    EXPECT_NE(errorOf(fat).find("the first tissue, and no other, must be \"air\""), std::string::npos);
    EXPECT_NE(errorOf("[[tissue]\n").find(":1: not TOML: "), std::string::npos);
    const std::string relaxing = airRow + fat + "relaxing_fast = 0.5\n";
    EXPECT_NE(errorOf(relaxing).find("tissue 'fat': relaxation_source is missing"), std::string::npos);
    EXPECT_EQ(errorOf(relaxing + "relaxation_source = \"assumed\"\n"), "");
    EXPECT_NE(errorOf(relaxing + "relaxing_slow = 0.5\nrelaxation_source = \"assumed\"\n")
                  .find("relaxing_slow = 0.5: must not be over 0.95 together with relaxing_fast"),
              std::string::npos);
}

TEST_F(TissueFile, InnerWallsHaveADistanceAForceAndASource)
{
    const std::string fat = fatRow(), spacing = airRow + fat + "wall_spacing_mm = 5\n";
    EXPECT_NE(errorOf(spacing).find("tissue 'fat': wall_n is missing"), std::string::npos);
    EXPECT_NE(errorOf(airRow + fat + "wall_n = 0.2\n").find("wall_spacing_mm is missing"), std::string::npos);
    EXPECT_NE(errorOf(spacing + "wall_n = 0.2\n").find("wall_source is missing"), std::string::npos);
    EXPECT_EQ(errorOf(spacing + "wall_n = 0.2\nwall_source = \"assumed\"\n"), "");
    EXPECT_NE(errorOf(airRow + fat + "wall_spacing_mm = 0.1\nwall_n = 0.2\nwall_source = \"assumed\"\n").find("0.5"),
              std::string::npos);
}

// What relaxes says where its figures come from, and what is held in space does not.
TEST(Tissues, WeightsOfRelaxationHaveASource)
{
    int count = 0;
    for (const volume::TissueRow& row : defaultTissues().rows) {
        count += row.relaxation().any() ? 1 : 0;
        EXPECT_EQ(row.relaxation().any(), !row.relaxationSource.empty()) << row.name;
        EXPECT_FALSE(row.relaxation().any() && row.fixed) << row.name;
    }
    EXPECT_GT(count, 10);
}

TEST(LabelMap, EveryTissueIsInTheBuiltInTable)
{
    const TissueTable table = defaultTissues();
    for (const std::string& name : labelMapNames()) {
        for (const volume::LabelName& label : labelMap(name).labels) {
            EXPECT_TRUE(table.find(label.tissue)) << name << " " << label.name << " " << label.tissue;
        }
    }
}

// totalsegmentator/map_to_binary.py of TotalSegmentator v2, class_map["total"].
TEST(LabelMap, TotalSegmentatorHasItsClasses)
{
    const LabelMap map = labelMap("totalsegmentator");
    ASSERT_EQ(map.labels.size(), 118U);  // 117 classes and the background
    for (std::size_t i = 0; i < map.labels.size(); ++i) {
        EXPECT_EQ(map.labels[i].value, i);
    }
    EXPECT_EQ(map.labels[5].name, "liver");
    EXPECT_EQ(map.labels[52].name, "aorta");
    EXPECT_EQ(map.labels[52].tissue, "artery");
    EXPECT_EQ(map.labels[79].name, "spinal_cord");
    EXPECT_EQ(map.labels[92].name, "rib_left_1");
    EXPECT_EQ(map.labels[117].name, "costal_cartilages");
}

// The values of a file's row in the manifest: "11 values: 0:43028583, 1:15949597, ..".
std::set<int> manifestLabels(const std::string& file)
{
    std::ifstream in(std::filesystem::path(PALPATE_TEST_DATA) / "MANIFEST.md");
    std::set<int> labels;
    for (std::string line; std::getline(in, line);) {
        const std::size_t at = line.find(" values: ");
        if (line.rfind("| " + file + " |", 0) != 0 || at == std::string::npos) {
            continue;
        }
        const std::string column = line.substr(at, line.find('|', at) - at);
        const std::regex pair("(\\d+):\\d+");
        for (std::sregex_iterator it(column.begin(), column.end(), pair), end; it != end; ++it) {
            labels.insert(std::stoi((*it)[1]));
        }
    }
    return labels;
}

TEST(LabelMap, LabelsOfRealSegmentationsAreKnown)
{
    if (!std::filesystem::exists(std::filesystem::path(PALPATE_TEST_DATA) / "MANIFEST.md")) {
        GTEST_SKIP() << "no test volumes in " << PALPATE_TEST_DATA;
    }
    const std::pair<const char*, const char*> files[] = {{"victre", "p_1.mhd"},
                                                         {"totalsegmentator", "example_seg.nii.gz"},
                                                         {"totalsegmentator", "example_seg_fast_force_split.nii.gz"}};
    for (const auto& [name, file] : files) {
        std::set<int> known;
        for (const volume::LabelName& label : labelMap(name).labels) {
            known.insert(label.value);
        }
        const std::set<int> labels = manifestLabels(file);
        EXPECT_GE(labels.size(), 10U) << file;
        for (const int label : labels) {
            EXPECT_TRUE(known.contains(label)) << file << " " << label;
        }
    }
}

TEST(LabelMap, AnUnknownNameNamesTheNearest)
{
    try {
        labelMap("totalsegmentater");
        FAIL();
    } catch (const std::runtime_error& e) {
        EXPECT_EQ(e.what(),
                  fmt::format("totalsegmentater: neither a file (there is no such file: check the name) nor one of "
                              "the {} built-in label maps, is it totalsegmentator?; 'palpate import --list-maps' "
                              "lists them",
                              labelMaps().size()));
    }
}

}  // namespace
}  // namespace palpate::datasets
