// Real files of many writers, against counts that independent readers made (MANIFEST.md beside them).
#include <volume/import.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <sstream>

namespace palpate::volume {
namespace {

namespace fs = std::filesystem;

struct Row {
    std::string file;  // folder/name
    std::vector<std::string> cells;
};

std::vector<Row> manifest()
{
    std::vector<Row> rows;
    std::ifstream in(fs::path(PALPATE_TEST_DATA) / "MANIFEST.md");
    std::string folder;
    for (std::string line; std::getline(in, line);) {
        if (line.rfind("## ", 0) == 0) {
            folder = line.substr(3);
        }
        if (line.rfind("| ", 0) != 0 || line.rfind("| file |", 0) == 0) {
            continue;
        }
        Row row;
        std::istringstream cells(line.substr(1));
        for (std::string cell; std::getline(cells, cell, '|');) {
            row.cells.push_back(std::regex_replace(cell, std::regex("^ +| +$"), ""));
        }
        row.file = folder + "/" + row.cells.at(0);
        const bool ours = std::regex_search(row.file, std::regex("\\.(nii|nii\\.gz|hdr|hdr\\.gz|nrrd|nhdr|mha|mhd)$"));
        if (ours && row.cells.size() >= 6) {
            rows.push_back(row);
        }
    }
    return rows;
}

// What must not be taken, and a word of the reason. Everything else in the table must come in as counted.
const std::map<std::string, std::string>& refusals()
{
    static const std::map<std::string, std::string> all = {
        {"totalsegmentator_ct/example_ct.nii.gz", "image"},
        {"totalsegmentator_ct/example_ct_sm.nii.gz", "image"},
        {"totalsegmentator_ct/example_seg_fast/heart.nii.gz", "no voxel is set"},
        {"slicer_seg_nrrd/CTChest4.nrrd", "image"},
        {"slicer_seg_nrrd/SegmentationOverlapping.seg.nrrd", "2 layers"},
        {"pyradiomics/brain1_image.nrrd", "different values"},
        {"pyradiomics/brain2_image.nrrd", "different values"},
        {"pyradiomics/prostate_phantom_subvolume.nrrd", "different values"},
        {"pynrrd/BallBinary30x30x30_byteskip_minus_five.nhdr", "byte skip: -5"},
        {"pynrrd/BallBinary30x30x30_bz2.nrrd", "bzip2"},
        {"pynrrd/BallBinary30x30x30_nifti.nhdr", "54352"},
        {"pynrrd/test1d_ascii.nrrd", "1 dimensions"},
        {"pynrrd/test2d_ascii.nrrd", "2 dimensions"},
        {"pynrrd/test_customFields.nrrd", "1 dimensions"},
        {"pynrrd/test_simple4d_raw.nrrd", "4 dimensions"},
        {"nibabel/analyze.hdr", "Analyze"},
        {"nibabel/anatomical.nii", "image"},
        {"nibabel/example_nifti2.nii.gz", "NIfTI-2"},
        {"nibabel/functional.nii", "4 dimensions"},
        {"nibabel/nifti1.hdr", "not there"},
        {"nibabel/resampled_anat_moved.nii", "whole numbers"},
        {"nibabel/someones_anatomy.nii.gz", "scl_slope"},
        {"nibabel/someones_epi.nii.gz", "scl_slope"},
        {"nifti_rs/f32.nii.gz", "whole numbers"},
        {"nifti_rs/minimal_extended_hdr.nii", "2 dimensions"},
        {"nifti_rs/fuzz_artifacts/crash-1.nii", ""},
        {"nifti_rs/fuzz_artifacts/crash-ed7d46344d7efb3b9f0c374d66d2e02f66cc447d.nii", ""},
        {"nifti_rs/rgb/3D.nii", "colours"},
        {"nifti_rs/rgb/4D.nii", "4 dimensions"},
        {"niivue_labels/shear.nii.gz", "sheared"},
        {"lfs_pointer/brain_atlas_image_3d.mha", "git-LFS"}};
    return all;
}

std::string expectedRefusal(const Row& row)
{
    const auto found = refusals().find(row.file);
    if (found != refusals().end()) {
        return found->second;
    }
    return row.cells[6].find("non-integer") != std::string::npos ? "whole numbers" : "-";
}

std::map<int, std::uint64_t> countsOf(const LabelImage& image)
{
    std::map<int, std::uint64_t> counts;
    std::vector<std::uint64_t> histogram(65536, 0);
    for (const std::uint16_t v : image.values) {
        ++histogram[v];
    }
    for (std::size_t v = 0; v < histogram.size(); ++v) {
        if (histogram[v] > 0) {
            counts[static_cast<int>(v)] = histogram[v];
        }
    }
    return counts;
}

std::vector<double> numbers(const std::string& text)
{
    std::istringstream in(text);
    std::vector<double> out;
    for (double v = 0; in >> v;) {
        out.push_back(v);
    }
    return out;
}

// "11 values: 0:43028583, 1:15949597", or "96 values: min 0 max 699; zero 5958679" for many.
void expectCounts(const Row& row, const LabelImage& image)
{
    const auto counts = countsOf(image);
    const std::string& text = row.cells[6];
    EXPECT_EQ(counts.size(), std::stoul(text)) << row.file;
    std::smatch match;
    if (std::regex_search(text, match, std::regex("zero (\\d+)"))) {
        const auto zeros = counts.find(0);
        EXPECT_EQ(zeros == counts.end() ? 0 : zeros->second, std::stoull(match[1])) << row.file;
        return;
    }
    std::map<int, std::uint64_t> expected;
    const std::regex pair("(\\d+):(\\d+)");
    const std::string list = text.substr(text.find(':'), text.find(';') - text.find(':'));
    for (std::sregex_iterator it(list.begin(), list.end(), pair), end; it != end; ++it) {
        expected[std::stoi((*it)[1])] = std::stoull((*it)[2]);
    }
    EXPECT_EQ(counts, expected) << row.file;
}

void expectGeometry(const Row& row, const LabelImage& image)
{
    std::string size = row.cells[3];
    EXPECT_EQ(fmt::format("{}x{}x{}", image.size.x, image.size.y, image.size.z), size) << row.file;
    const std::regex form("origin \\(([^)]*)\\) size .* sp ([-\\d. ]+) dir \\[([^\\]]*)\\]");
    std::smatch match;
    if (!std::regex_search(row.cells[5], match, form)) {
        return;
    }
    const std::vector<double> origin = numbers(match[1]);
    const std::vector<double> spacing = numbers(match[2]);
    std::vector<double> direction = numbers(match[3]);
    if (row.file == "mricron_jhu/JHU-WhiteMatter-labels-2mm.nii.gz") {
        direction[8] = 1;  // the table has ITK's choice, the qform; ours is the sform
    }
    const Affine& a = image.affine;
    for (int k = 0; k < 3; ++k) {
        const auto i = static_cast<std::size_t>(k);
        EXPECT_NEAR(1e3 * a.origin[k], origin[i], 1e-3) << row.file;
        EXPECT_NEAR(1e3 * a.spacing()[k], spacing[i], 1e-4) << row.file;
        for (int r = 0; r < 3; ++r) {
            EXPECT_NEAR(a.linear[k][r] / a.spacing()[k], direction[static_cast<std::size_t>(3 * r + k)], 2e-3)
                << row.file << " axis " << k << " row " << r;
        }
    }
}

TEST(Manifest, EveryFileComesInAsCountedOrIsRefusedWithItsReason)
{
    const std::vector<Row> rows = manifest();
    if (rows.empty()) {
        GTEST_SKIP() << "no test volumes in " << PALPATE_TEST_DATA;
    }
    for (const Row& row : rows) {
        const fs::path file = fs::path(PALPATE_TEST_DATA) / row.file;
        if (!fs::exists(file)) {
            continue;
        }
        const std::string reason = expectedRefusal(row);
        try {
            const ImportedLabels labels = importLabels(file);
            EXPECT_EQ(reason, "-") << row.file << " must be refused";
            if (row.cells[6].rfind("NOT READABLE", 0) == 0) {
                continue;  // read through minimal2.img.gz, which the table's reader did not try
            }
            expectCounts(row, labels.image);
            expectGeometry(row, labels.image);
        } catch (const std::runtime_error& e) {
            const std::string what = e.what();
            EXPECT_NE(reason, "-") << what;
            EXPECT_NE(what.find(reason), std::string::npos) << what;
            EXPECT_EQ(what.find('\n'), std::string::npos) << what;
            EXPECT_NE(what.find(": "), std::string::npos) << what;
        }
    }
}

// The VICTRE phantom's header says CompressedData = False; its data are gzip. Counts: MANIFEST.md.
TEST(Manifest, VictrePhantomIsReadAsItsDataAre)
{
    const fs::path file = fs::path(PALPATE_TEST_DATA) / "victre_p1/p_1.mhd";
    if (!fs::exists(file)) {
        GTEST_SKIP() << "no test volumes in " << PALPATE_TEST_DATA;
    }
    const ImportedLabels labels = importLabels(file);
    const std::map<int, std::uint64_t> expected = {{0, 43028583}, {1, 15949597}, {2, 1280833}, {29, 9363296},
                                                   {33, 22131},   {40, 4861758}, {88, 403012}, {95, 18367},
                                                   {125, 102610}, {150, 88660},  {225, 112001}};
    EXPECT_EQ(countsOf(labels.image), expected);
    ASSERT_EQ(labels.warnings.size(), 1U);
    EXPECT_NE(labels.warnings[0].find("CompressedData = False"), std::string::npos);
}

// Names that the writers put into their files: a NIfTI extension, 3D Slicer's segments.
TEST(Manifest, LabelNamesAreTakenFromTheFile)
{
    const fs::path data = PALPATE_TEST_DATA;
    if (!fs::exists(data / "slicer_seg_nrrd")) {
        GTEST_SKIP() << "no test volumes in " << PALPATE_TEST_DATA;
    }
    const auto nameOf = [](const ImportedLabels& labels, int value) -> std::string {
        for (const LabelName& n : labels.names) {
            if (n.value == value) {
                return n.name;
            }
        }
        return "";
    };
    const ImportedLabels slicer = importLabels(data / "slicer_seg_nrrd/Segmentation.seg.nrrd");
    EXPECT_EQ(slicer.names.size(), 7U);
    EXPECT_EQ(nameOf(slicer, 6), "left lung");
    const ImportedLabels total = importLabels(data / "totalsegmentator_ct/example_seg.nii.gz");
    EXPECT_EQ(total.names.size(), 117U);
    EXPECT_EQ(nameOf(total, 5), "liver");
}

// Half of a file is never taken for all of it.
TEST(Manifest, TruncatedCopiesAreRefused)
{
    const fs::path data = PALPATE_TEST_DATA;
    const fs::path folder = fs::temp_directory_path() / fmt::format("palpate-truncated-{}", ::getpid());
    const std::vector<std::string> files = {"totalsegmentator_ct/example_seg.nii.gz", "nifti_rs/27/int16.nii",
                                            "spl_abdomen_atlas/seg.nrrd", "pynrrd/BallBinary30x30x30.nrrd",
                                            "niivue_labels/torsoLabel.nii.gz"};
    if (!fs::exists(data / files[0])) {
        GTEST_SKIP() << "no test volumes in " << data;
    }
    fs::create_directories(folder);
    for (const std::string& name : files) {
        const fs::path copy = folder / fs::path(name).filename();
        const auto whole = fs::file_size(data / name);
        for (const double share : {0.0, 0.02, 0.3, 0.7, 0.99}) {
            fs::copy_file(data / name, copy, fs::copy_options::overwrite_existing);
            fs::permissions(copy, fs::perms::owner_write, fs::perm_options::add);
            fs::resize_file(copy, static_cast<std::uintmax_t>(share * static_cast<double>(whole)));
            EXPECT_THROW(importLabels(copy), std::runtime_error) << name << " cut to " << share;
        }
        fs::copy_file(data / name, copy, fs::copy_options::overwrite_existing);
        EXPECT_NO_THROW(importLabels(copy)) << name;
    }
    fs::remove_all(folder);
}

}  // namespace
}  // namespace palpate::volume
