// Public label sets, with values and names as they come, against the tissue that each label gets or the error that the set
// gives: nothing passes without a tissue that somebody said.
#include <datasets/tables.h>
#include <tests/error_of.h>
#include <volume/prepare/mapping.h>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <map>

namespace palpate::prepare {
namespace {

using Names = std::vector<std::pair<std::uint16_t, std::string>>;
using Tissues = std::map<std::uint16_t, std::string>;

/// One row of the table: a file as it comes, what the user says, and what must become of it.
struct LabelSet {
    std::string what;
    std::vector<std::uint16_t> values;  // in the voxels; those of `names` where empty
    Names names;                        // in the file, a colour table or a dataset.json
    std::string map;                    // --map
    Tissues tissues;                    // each label's; others are not checked
    std::string error;                  // a part of the error, in place of tissues
};

std::vector<std::uint16_t> range(std::uint16_t first, std::uint16_t last)
{
    std::vector<std::uint16_t> values;
    for (std::uint16_t v = first; v <= last; ++v) {
        values.push_back(v);
    }
    return values;
}

// Names in order, from 1.
Names named(std::initializer_list<const char*> list)
{
    Names names;
    for (const char* name : list) {
        names.emplace_back(static_cast<std::uint16_t>(names.size() + 1), name);
    }
    return names;
}

const std::vector<std::uint16_t> firstValues = {10, 11, 12, 13, 16, 17, 18, 26, 49, 50, 51, 52, 53, 54, 58};

std::vector<LabelSet> bareSets()
{
    const std::string unknown = "no tissue is known for";
    // Values alone: an error that offers maps.
    return {
        {"FSL FIRST", firstValues, {}, "", {}, "--map fsl-first ("},
        {"aseg without cortex",
         {2, 4, 10, 11, 12, 13, 16, 17, 18, 28, 41, 43, 49, 50, 51},
         {},
         "",
         {},
         "--map freesurfer ("},
        {"VerSe", {19, 20, 21, 22, 23, 24, 28}, {}, "", {}, "--map verse (28 is T13"},
        {"round numbers", {10, 20, 30, 40, 50, 60}, {}, "", {}, unknown},
        {"JHU white matter", range(1, 48), {}, "", {}, "--map totalsegmentator-total_mr ("},
        {"AAL", range(1, 116), {}, "", {}, "--map totalsegmentator ("},
        {"BraTS 2021", {1, 2, 4}, {}, "", {}, "--map brats (4 is enhancing tumor"},
        {"KiTS", {1, 2, 3}, {}, "", {}, "--map kits ("},
        {"a mask", {1}, {}, "", {}, "more: is it one of these?"},
        {"a mask of 255", {255}, {}, "", {}, unknown},
        {"VICTRE", {1, 2, 29, 33, 40, 88, 95, 125, 150, 225}, {}, "", {}, "--map victre (225 is vein"},
        {"Destrieux", {11101, 12175, 13100, 2, 41}, {}, "", {}, "--map freesurfer ("},
    };
}

std::vector<LabelSet> mappedSets()
{
    return {
        {"FSL FIRST by its map", firstValues, {}, "fsl-first", {{10, "brain"}, {58, "brain"}, {16, "brain"}}, ""},
        {"VerSe by its map", {1, 8, 20, 25, 26, 28}, {}, "verse", {{1, "bone"}, {28, "bone"}}, ""},
        {"VerSe as FreeSurfer", {19, 20, 21}, {}, "freesurfer", {}, "no tissue is known for 3 of its labels"},
        {"Destrieux by its map",
         {11101, 12175, 14100, 17},
         {},
         "destrieux",
         {{11101, "grey_matter"}, {12175, "grey_matter"}, {14100, "white_matter"}, {17, "brain"}},
         ""},
        {"BraTS 2021 by its map", {1, 2, 4}, {}, "brats", {{1, "tumour"}, {2, "white_matter"}, {4, "tumour"}}, ""},
        {"BraTS 2023 with the old map", {1, 2, 3}, {}, "brats", {}, "no tissue is known for 1 of its labels: 3 ("},
        {"BraTS 2023", {1, 2, 3}, {}, "brats-2023", {{1, "tumour"}, {2, "white_matter"}, {3, "tumour"}}, ""},
        {"BraTS 2015", {1, 2, 3, 4}, {}, "brats-2012", {{3, "tumour"}, {2, "white_matter"}}, ""},
        {"BraTS 2024", {1, 2, 3, 4}, {}, "brats-2024-glioma", {{2, "white_matter"}, {4, "csf"}}, ""},
        {"KiTS 2023", {1, 2, 3}, {}, "kits", {{1, "kidney"}, {2, "tumour"}, {3, "cyst"}}, ""},
        {"AMOS by its map",
         range(1, 15),
         {},
         "amos",
         {{1, "spleen"}, {2, "kidney"}, {4, "gallbladder"}, {8, "artery"}, {9, "vein"}, {13, "bowel"}, {15, "soft_tissue"}},
         ""},
        {"MSD lung", {1}, {}, "msd-lung", {{1, "tumour"}}, ""},
        {"MSD spleen", {1}, {}, "msd-spleen", {{1, "spleen"}}, ""},
        {"MSD heart", {1}, {}, "msd-heart", {{1, "heart"}}, ""},
        {"TotalSegmentator v1",
         {1, 7, 8, 44, 104},
         {},
         "totalsegmentator-total_v1",
         {{1, "spleen"}, {7, "artery"}, {8, "vein"}, {44, "heart"}, {104, "bladder"}},
         ""},
        {"lung vessels, old numbers",
         {1, 2},
         {},
         "totalsegmentator-lung_vessels_LEGACY",
         {{1, "artery"}, {2, "trachea"}},
         ""},
        {"lung vessels, new numbers", {1, 2, 3, 4}, {}, "totalsegmentator-lung_vessels", {{1, "trachea"}, {4, "vein"}}, ""},
        {"a map that is not there", {1}, {}, "brats-2021", {}, "neither a file"},
    };
}

std::vector<LabelSet> totalSegmentatorSets()
{
    return {
        {"TotalSegmentator MR",
         {},
         {{13, "small_bowel"}, {19, "vertebrae"}, {23, "aorta"}, {24, "inferior_vena_cava"}},
         "",
         {{13, "bowel"}, {19, "bone"}, {23, "artery"}, {24, "vein"}},
         ""},
        {"TotalSegmentator MR with the CT map",
         {},
         {{19, "vertebrae"}, {23, "aorta"}, {24, "inferior_vena_cava"}},
         "totalsegmentator",
         {},
         "19 is 'vertebrae' (bone) in the file and 'duodenum' (bowel) in the map"},
        {"TotalSegmentator lung vessels",
         {},
         named({"lung_airways", "lung_airways_wall", "lung_arteries", "lung_veins"}),
         "",
         {{1, "trachea"}, {3, "artery"}, {4, "vein"}},
         ""},
        {"TotalSegmentator old lung vessels with the new map",
         {},
         named({"lung_vessels", "lung_trachea_bronchia"}),
         "totalsegmentator-lung_vessels",
         {},
         "1 is 'lung_vessels' (artery) in the file and 'lung_airways' (trachea)"},
        {"TotalSegmentator brain structures",
         {},
         {{1, "brainstem"}, {2, "subarachnoid_space"}, {3, "venous_sinuses"}, {10, "ventricle"}, {12, "frontal_lobe"}},
         "",
         {{1, "brain"}, {2, "csf"}, {3, "vein"}, {10, "csf"}, {12, "brain"}},
         ""},
        {"TotalSegmentator head and neck",
         {},
         {{3, "hyoid"}, {9, "internal_carotid_artery_right"}, {1, "larynx_air"}},
         "",
         {{3, "bone"}, {9, "artery"}, {1, "air"}},
         ""},
        {"TotalSegmentator appendicular bones",
         {},
         named({"patella", "tibia", "fibula", "tarsal"}),
         "",
         {{1, "bone"}, {2, "bone"}, {3, "bone"}, {4, "bone"}},
         ""},
        {"TotalSegmentator trunk cavities",
         {},
         named({"abdominal_cavity", "thoracic_cavity", "pericardium", "mediastinum"}),
         "",
         {{1, "soft_tissue"}, {3, "heart"}, {4, "heart"}},
         ""},
    };
}

std::vector<LabelSet> decathlonSets()
{
    return {
        {"MSD brain, dataset.json",
         {},
         named({"edema", "non-enhancing tumor", "enhancing tumour"}),
         "",
         {{1, "white_matter"}, {2, "tumour"}, {3, "tumour"}},
         ""},
        {"MSD brain read as BraTS",
         {},
         named({"edema", "non-enhancing tumor", "enhancing tumour"}),
         "brats-2023",
         {},
         "1 is 'edema' (white_matter) in the file and 'necrotic tumor core' (tumour) in the map"},
        {"MSD liver, dataset.json", {}, named({"liver", "cancer"}), "", {{1, "liver"}, {2, "tumour"}}, ""},
        {"MSD hippocampus, dataset.json", {}, named({"Anterior", "Posterior"}), "", {{1, "brain"}, {2, "brain"}}, ""},
        {"MSD prostate, dataset.json", {}, named({"PZ", "TZ"}), "", {{1, "prostate"}, {2, "prostate"}}, ""},
        {"MSD pancreas, dataset.json", {}, named({"pancreas", "cancer"}), "", {{1, "pancreas"}, {2, "tumour"}}, ""},
        {"MSD vessels, dataset.json", {}, named({"Vessel", "Tumour"}), "", {{1, "vein"}, {2, "tumour"}}, ""},
        {"MSD colon, dataset.json", {}, named({"colon cancer primaries"}), "", {{1, "tumour"}}, ""},
    };
}

std::vector<LabelSet> otherNamedSets()
{
    return {
        {"nnU-Net KiTS", {}, named({"kidney", "tumor", "cyst"}), "", {{1, "kidney"}, {2, "tumour"}, {3, "cyst"}}, ""},
        {"AMOS, dataset.json",
         {},
         {{4, "gall bladder"}, {8, "arota"}, {9, "postcava"}, {14, "bladder"}, {15, "prostate/uterus"}},
         "",
         {{4, "gallbladder"}, {8, "artery"}, {9, "vein"}, {14, "bladder"}, {15, "soft_tissue"}},
         ""},
        {"FLARE 2022",
         {},
         named({"liver", "right kidney", "spleen", "pancreas", "aorta", "inferior vena cava"}),
         "",
         {{1, "liver"}, {2, "kidney"}, {5, "artery"}, {6, "vein"}},
         ""},
        {"BTCV",
         {},
         {{9, "inferior vena cava"}, {10, "portal vein and splenic vein"}, {12, "right adrenal gland"}},
         "",
         {{9, "vein"}, {10, "vein"}, {12, "adrenal"}},
         ""},
        {"WORD",
         {},
         {{11, "intestine"}, {13, "rectum"}, {15, "Head_of_femur_L"}},
         "",
         {{11, "bowel"}, {13, "bowel"}, {15, "bone"}},
         ""},
        {"SPIDER",
         {},
         {{1, "vertebra L5"}, {100, "spinal canal"}, {201, "intervertebral disc"}},
         "",
         {},
         "100 'spinal canal'"},
        {"a heart's ventricle", {}, {{1, "myocardium"}, {2, "left ventricle"}}, "", {}, "2 'left ventricle'"},
        {"a muscle atlas",
         {},
         named({"psoas major", "quadratus lumborum", "erector spinae"}),
         "",
         {{1, "muscle"}, {2, "muscle"}, {3, "muscle"}},
         ""},
        {"lymph nodes",
         {},
         named({"Lymph nodes", "Thyroid gland", "GTV"}),
         "",
         {{1, "lymph_node"}, {2, "thyroid"}, {3, "tumour"}},
         ""},
        {"3D Slicer without names",
         {},
         named({"Segment_1", "Segment_2"}),
         "",
         {},
         "no tissue is known for 2 of its labels"},
        {"values as names", {5}, {{5, "label 5"}}, "", {}, "its values would fit"},
    };
}

std::vector<LabelSet> moreSets()
{
    const std::string unknown = "no tissue is known for";
    return {
        {"FLARE 2022 as it comes",
         {},
         named({"Liver", "Right kidney (RK)", "Inferior Vena Cava (IVC)", "Right Adrenal Gland (RAG)", "Left kidney (LK)"}),
         "",
         {{2, "kidney"}, {3, "vein"}, {4, "adrenal"}, {5, "kidney"}},
         ""},
        {"CHAOS MR", {63, 126, 189, 252}, {}, "", {}, unknown},
        {"MM-WHS", {205, 420, 500, 550, 600, 820, 850}, {}, "", {}, unknown},
        {"ACDC, dataset.json of nnU-Net",
         {},
         named({"RV", "MLV", "LVC"}),
         "",
         {},
         "no tissue is known for 3 of its labels"},
        {"ACDC, values", {1, 2, 3}, {}, "", {}, "or one of"},
        {"PROMISE12", {1}, {}, "", {}, "or one of"},
        {"Duke breast MRI", {}, named({"breast", "dense tissue", "blood vessels"}), "", {}, "1 'breast'"},
        {"SynthSeg", {2, 3, 4, 17, 24, 53, 1002, 2035}, {}, "", {}, "--map freesurfer ("},
        {"SynthSeg by its map",
         {2, 3, 4, 17, 24, 1002},
         {},
         "freesurfer",
         {{2, "white_matter"}, {4, "csf"}, {1002, "grey_matter"}},
         ""},
        {"HaN-Seg",
         {},
         named({"A_Carotid_L", "Bone_Mandible", "SpinalCord", "OpticNrv_R", "Glnd_Thyroid", "Eye_AL", "Parotid_L"}),
         "",
         {{1, "artery"}, {2, "bone"}, {3, "spinal_cord"}, {4, "nerve"}, {5, "thyroid"}, {6, "eye"}, {7, "soft_tissue"}},
         ""},
        {"HaN-Seg, all of it", {}, named({"A_Carotid_L", "BuccalMucosa", "Cavity_Oral"}), "", {}, "2 'BuccalMucosa'"},
        {"SegTHOR", {}, named({"esophagus", "heart", "trachea", "aorta"}), "", {{1, "esophagus"}, {4, "artery"}}, ""},
        {"CT-ORG",
         {},
         named({"liver", "bladder", "lungs", "kidneys", "bone", "brain"}),
         "",
         {{1, "liver"}, {3, "lung"}, {5, "bone"}},
         ""},
        {"AbdomenAtlas",
         {},
         named({"gall_bladder", "postcava", "celiac_truck", "hepatic_vessel", "femur_left"}),
         "",
         {{1, "gallbladder"}, {2, "vein"}, {3, "artery"}, {4, "vein"}, {5, "bone"}},
         ""},
        {"PANORAMA",
         {},
         named({"PDAC lesion", "veins", "arteries", "pancreas parenchyma", "pancreatic duct"}),
         "",
         {},
         "5 'pancreatic duct'"},
        {"HECKTOR", {}, named({"GTVp", "GTVn"}), "", {{1, "tumour"}, {2, "lymph_node"}}, ""},
        {"liver segments in Roman numerals",
         {},
         named({"I", "IVa", "V", "VI", "VIII"}),
         "",
         {},
         "no tissue is known for 5 of its labels"},
        {"bones of a skull",
         {},
         named({"frontal", "parietal", "occipital", "temporal"}),
         "",
         {},
         "no tissue is known for 4 of its labels"},
        {"what nobody knows",
         {},
         named({"unknown", "other", "necrosis"}),
         "",
         {},
         "no tissue is known for 3 of its labels"},
    };
}

volume::ImportedLabels labelsOf(const LabelSet& set, LabelCounts& counts)
{
    volume::ImportedLabels labels;
    std::vector<std::uint16_t> values = set.values;
    for (const auto& [value, name] : set.names) {
        labels.names.push_back({value, name, ""});
        values.push_back(value);
    }
    for (const std::uint16_t value : values) {
        counts[value] = 10 + value;
    }
    counts[0] = 1000;
    return labels;
}

void check(const LabelSet& set)
{
    SCOPED_TRACE(set.what);
    const volume::TissueTable table = datasets::defaultTissues();
    MappingOptions options;
    options.map = set.map;
    LabelCounts counts;
    const volume::ImportedLabels labels = labelsOf(set, counts);
    std::vector<std::string> notes;
    Tissues got;
    const std::string error = tests::errorOf([&] {
        for (const volume::LabelName& n : mapLabels(options, "file.nii", labels, counts, table, notes)) {
            got[n.value] = n.tissue;
        }
    });
    EXPECT_EQ(error.find('\n'), std::string::npos);
    if (!set.error.empty()) {
        EXPECT_NE(error.find(set.error), std::string::npos) << error;
        return;
    }
    ASSERT_EQ(error, "");
    for (const auto& [value, tissue] : set.tissues) {
        EXPECT_EQ(got[value], tissue) << value;
    }
    for (const auto& [value, voxels] : counts) {
        EXPECT_TRUE(value == 0 || table.find(got[value])) << value << " has no tissue";
    }
    // What was not said by the user is said to him.
    EXPECT_TRUE(!set.map.empty() || !notes.empty());
}

TEST(LabelSets, EachLabelHasTheTissueThatItMustHaveOrTheSetIsRefused)
{
    std::size_t sets = 0;
    for (const auto& list :
         {bareSets(), mappedSets(), totalSegmentatorSets(), decathlonSets(), otherNamedSets(), moreSets()}) {
        for (const LabelSet& set : list) {
            check(set);
            ++sets;
        }
    }
    EXPECT_GE(sets, 70U);
}

// One note for many labels; --verbose gives one for each.
TEST(LabelSets, ManyLabelsAreSummedUpInOneNote)
{
    const LabelSet set{"", {}, named({"psoas major", "deltoid", "trapezius", "tongue", "masseter_left"}), "", {}, ""};
    LabelCounts counts;
    const volume::ImportedLabels labels = labelsOf(set, counts);
    for (const bool verbose : {false, true}) {
        MappingOptions options;
        options.verbose = verbose;
        std::vector<std::string> notes;
        mapLabels(options, "f", labels, counts, datasets::defaultTissues(), notes);
        EXPECT_EQ(notes.size(), verbose ? 5U : 1U);
        EXPECT_EQ(notes[0], verbose
                                ? "label 1 'psoas major' is taken as muscle by its name"
                                : "5 labels are taken for a tissue by their names: 'psoas major' as muscle, 'deltoid' as "
                                  "muscle, 'trapezius' as muscle, ...; --verbose lists each");
    }
}

// A value that --renumber gave is none of the map's: 70000 as label 1 is no necrotic core.
TEST(LabelSets, ARenumberedValueIsNotLookedUpInAMap)
{
    const LabelSet set{"", {1, 2}, {}, "", {}, ""};
    LabelCounts counts;
    volume::ImportedLabels labels = labelsOf(set, counts);
    labels.renumbered.push_back({70000, 1});
    MappingOptions options;
    options.map = "brats";
    std::vector<std::string> notes;
    const auto map = [&] { return mapLabels(options, "f", labels, counts, datasets::defaultTissues(), notes); };
    EXPECT_NE(tests::errorOf(map).find("no tissue is known for 1 of its labels: 1 'label 70000'"), std::string::npos)
        << tests::errorOf(map);
    options.set = {"70000=fat"};
    const auto mapped = map();
    ASSERT_EQ(mapped.size(), 2U);
    EXPECT_EQ(mapped[0].tissue, "fat");
    EXPECT_EQ(mapped[0].name, "label 70000");
    EXPECT_EQ(mapped[1].tissue, "white_matter");
}

}  // namespace
}  // namespace palpate::prepare
