// Real files of many writers, against counts that independent readers made (MANIFEST.md beside them).
#include "manifest.h"

#include <tests/error_of.h>
#include <tests/volume/files.h>
#include <volume/import.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>
#include <zlib.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <set>

namespace palpate::volume {
namespace {

namespace fs = std::filesystem;
using manifest::Counts;
using manifest::Row;

// Files that are no volume or cannot be known, and a word of the reason. Everything else in the table must come in as it
// was counted, as labels or as an image.
const std::map<std::string, std::string>& refusals()
{
    static const std::map<std::string, std::string> all = {
        {"pynrrd/BallBinary30x30x30_byteskip_minus_five.nhdr", "byte skip: -5"},
        {"pynrrd/BallBinary30x30x30_nifti.nhdr", "54000"},
        {"pynrrd/test1d_ascii.nrrd", "1 dimensions"},
        {"pynrrd/test2d_ascii.nrrd", "2 dimensions"},
        {"pynrrd/test_customFields.nrrd", "1 dimensions"},
        {"nibabel/analyze.hdr", "is Analyze 7.5 with a factor of 1715.04"},
        {"nibabel/example_nifti2.nii.gz", "volumes, or as many values per voxel"},
        {"nibabel/functional.nii", "volumes, or as many values per voxel"},
        {"nibabel/nifti1.hdr", "not there"},
        {"nibabel/test.mgz", "volumes, or as many values per voxel"},
        {"nifti_rs/minimal_extended_hdr.nii", "2 dimensions"},
        {"nifti_rs/fuzz_artifacts/crash-1.nii", "does not begin with its length"},
        {"nifti_rs/fuzz_artifacts/crash-ed7d46344d7efb3b9f0c374d66d2e02f66cc447d.nii", "does not begin with its length"},
        {"nifti_rs/rgb/3D.nii", "colours"},
        {"nifti_rs/rgb/4D.nii", "colours"},
        {"lfs_pointer/brain_atlas_image_3d.mha", "git-LFS"},
        {"dicom2nifti_bad_series_a/failing/sliceincrement/001/*", "a slice is missing between"}};
    return all;
}

// One line: file, problem, remedy.
void expectReason(const Row& row, const std::string& what, const std::string& reason)
{
    EXPECT_NE(what.find(reason), std::string::npos) << row.name << ": " << what;
    EXPECT_EQ(what.find('\n'), std::string::npos) << what;
    EXPECT_NE(what.find(": "), std::string::npos) << what;
}

void expectPlace(const Row& row, Index3 size, const Affine& a)
{
    std::string said = row.size;
    while (std::count(said.begin(), said.end(), 'x') > 2 && said.substr(said.size() - 2) == "x1") {
        said.resize(said.size() - 2);
    }
    const std::string here = fmt::format("{}x{}x{}", size.x, size.y, size.z);
    // A .seg.nrrd's layers stand in front of its size.
    EXPECT_TRUE(said == here || said == "2x" + here) << row.name << " " << said << " " << here;
    manifest::Place place = manifest::placeOf(row);
    if (!place.given) {
        return;
    }
    if (row.name == "mricron_jhu/JHU-WhiteMatter-labels-2mm.nii.gz") {
        place.direction[8] = 1;  // the table has the qform; ours is the sform
    }
    const bool sform = row.name == "niivue_labels/shear.nii.gz";  // the table has the qform's directions
    for (int k = 0; k < 3; ++k) {
        const auto i = static_cast<std::size_t>(k);
        EXPECT_NEAR(1e3 * a.origin[k], place.origin[i], sform ? 0.5 : 1e-3) << row.name;
        EXPECT_NEAR(1e3 * a.spacing()[k], place.spacing[i], 1e-3) << row.name;
        for (int r = 0; r < 3 && !sform; ++r) {
            EXPECT_NEAR(a.linear[k][r] / a.spacing()[k], place.direction[static_cast<std::size_t>(3 * r + k)], 2e-3)
                << row.name << " axis " << k << " row " << r;
        }
    }
}

void expectLabels(const Row& row, const Counts& counts)
{
    ImportOptions options;
    options.dicomLabels = row.name.ends_with(".dcm");  // label values in files of modality CT
    if (options.dicomLabels) {
        expectReason(row, tests::errorOf([&] { importLabels(row.path); }), "so an image");
    }
    const ImportedLabels labels = importLabels(row.path, options);
    const auto found = manifest::histogram(labels.image);
    EXPECT_EQ(found.size(), counts.different) << row.name;
    if (counts.listed) {
        std::map<int, std::uint64_t> expected;
        for (const auto& [value, voxels] : counts.voxels) {
            expected[static_cast<int>(value)] = voxels;
        }
        EXPECT_EQ(found, expected) << row.name;
    } else {
        EXPECT_EQ(found.count(0) ? found.at(0) : 0, counts.zero) << row.name;
        EXPECT_EQ(found.rbegin()->first, static_cast<int>(counts.most)) << row.name;
    }
    expectPlace(row, labels.image.size, labels.image.affine);
}

void expectImage(const Row& row, Counts counts)
{
    ImportedImage image = importImage(row.path);
    expectPlace(row, image.size, image.affine);
    if (row.name == "highdicom_seg/ct_image.dcm") {  // counted as stored; its RescaleIntercept is -1024
        counts.least -= 1024;
        counts.most -= 1024;
        counts.zero = static_cast<std::uint64_t>(std::count(image.values.begin(), image.values.end(), 0.0F));
        EXPECT_EQ(image.what, "HU");
    }
    const auto zero = static_cast<std::uint64_t>(std::count(image.values.begin(), image.values.end(), 0.0F));
    EXPECT_EQ(zero, counts.zero) << row.name;
    std::sort(image.values.begin(), image.values.end());
    EXPECT_NEAR(static_cast<double>(image.values.front()), counts.least, 1e-4 * (1 + std::abs(counts.least))) << row.name;
    EXPECT_NEAR(static_cast<double>(image.values.back()), counts.most, 1e-4 * (1 + std::abs(counts.most))) << row.name;
    const auto end = std::unique(image.values.begin(), image.values.end());
    EXPECT_EQ(static_cast<std::size_t>(end - image.values.begin()), counts.different) << row.name;
    EXPECT_EQ(!image.warnings.empty() && image.warnings.back().find("not numbers") != std::string::npos,
              counts.nonFinite > 0)
        << row.name;
}

// A voxel of a segment is the segment's in the end, or is counted as lost to another.
void expectSegments(const Row& row)
{
    ImportOptions options;
    if (row.format.find("FRACTIONAL") != std::string::npos) {
        options.fractionalThreshold = 0.0F;  // the table counts every voxel that is not zero
    }
    const ImportedLabels labels = importLabels(row.path, options);
    auto found = manifest::histogram(labels.image);
    found.erase(0);
    for (const Overlap& o : labels.overlaps) {
        found[o.lost] += o.voxels;
    }
    EXPECT_EQ(found, manifest::segmentVoxels(row)) << row.name;
    for (const LabelName& name : labels.names) {
        EXPECT_NE(row.counts.find(fmt::format("{}:{}", name.value, name.name)), std::string::npos) << row.name;
    }
}

void expectSeries(const Row& row)
{
    ImportedImage image = importImage(row.path);
    expectPlace(row, image.size, image.affine);
    const std::string gaps = row.place.substr(row.place.find("gaps [") + 6);
    EXPECT_NEAR(1e3 * image.affine.spacing().z, std::stod(gaps), row.name.find("gantry") != std::string::npos ? 1.5 : 1e-3)
        << row.name;
    // A series of CT or MR is an image, and comes in as labels only for who says so and when its values could be labels.
    expectReason(row, tests::errorOf([&] { importLabels(row.path); }), "so an image");
    ImportOptions options;
    options.dicomLabels = true;
    std::sort(image.values.begin(), image.values.end());
    const bool negative = image.values.front() < 0;
    const auto different = std::unique(image.values.begin(), image.values.end()) - image.values.begin();
    const std::string why = tests::errorOf([&] { importLabels(row.path, options); });
    EXPECT_EQ(why.empty(), !negative && different <= 1024 && shearOf(image.affine) < 0.01) << row.name << why;
}

// The overlapping segments of 3D Slicer: seven in the first layer, a sphere of value 1 in the second.
void expectLayers(const Row& row)
{
    const ImportedLabels labels = importLabels(row.path);
    expectPlace(row, labels.image.size, labels.image.affine);
    auto found = manifest::histogram(labels.image);
    for (const Overlap& o : labels.overlaps) {
        found[o.lost] += o.voxels;
    }
    found.erase(0);
    const std::map<int, std::uint64_t> expected = {{1, 8487},  {2, 1216},  {3, 2712},   {4, 3259},
                                                   {5, 34450}, {6, 33700}, {7, 154589}, {8, 19139}};
    EXPECT_EQ(found, expected);
}

void judge(const Row& row)
{
    const auto refused = refusals().find(row.name);
    if (refused != refusals().end()) {
        ImportOptions options;
        options.dicomLabels = true;
        expectReason(row, tests::errorOf([&] { importLabels(row.path, options); }), refused->second);
        expectReason(row, tests::errorOf([&] { importImage(row.path); }), refused->second);
        return;
    }
    if (row.isSegmentation()) {
        expectReason(row, tests::errorOf([&] { importImage(row.path); }), "is a DICOM SEG");
        return expectSegments(row);
    }
    if (row.isSeries()) {
        return expectSeries(row);
    }
    if (row.counts.rfind("L0 ", 0) == 0) {
        expectReason(row, tests::errorOf([&] { importImage(row.path); }), "2 layers");
        return expectLayers(row);
    }
    if (row.name == "nifti_rs/minimal2.hdr") {  // the table's reader did not look for minimal2.img.gz
        EXPECT_EQ(manifest::histogram(importLabels(row.path).image).size(), 64U);
        return;
    }
    const Counts counts = manifest::countsOf(row);
    ASSERT_GT(counts.different, 0U) << row.name << ": the table's line is not understood";
    if (counts.isLabelMap()) {
        return expectLabels(row, counts);
    }
    const bool empty = counts.different == 1 && counts.most == 0;
    const bool sheared = row.name == "niivue_labels/shear.nii.gz";
    expectReason(row, tests::errorOf([&] { importLabels(row.path); }),
                 sheared ? "sheared by 18.5 degrees"
                 : empty ? "no voxel is set"
                         : "give the segmentation");
    if (!empty) {
        expectImage(row, counts);
    }
}

TEST(Manifest, EveryFileComesInAsCountedOrIsRefusedWithItsReason)
{
    const std::vector<Row> rows = manifest::rows();
    if (rows.empty()) {
        GTEST_SKIP() << "no test volumes in " << PALPATE_TEST_DATA;
    }
    EXPECT_GT(rows.size(), 120U);
    loadDicomDictionary();
    for (const Row& row : rows) {
        ASSERT_TRUE(fs::exists(row.path)) << row.name;
        ASSERT_NO_THROW(judge(row)) << row.name;
    }
}

// A file that nobody counted would be a file that nobody checks.
TEST(Manifest, HoldsEveryVolumeThatIsThere)
{
    std::set<fs::path> known;
    for (const Row& row : manifest::rows()) {
        known.insert(row.path);
    }
    if (known.empty()) {
        GTEST_SKIP() << "no test volumes in " << PALPATE_TEST_DATA;
    }
    const std::set<std::string> other = {".md", ".txt", ".tsv", ".ctbl", ".loc", ".raw", ".zraw", ".img", ""};
    for (const auto& entry : fs::recursive_directory_iterator(manifest::folder())) {
        const fs::path& file = entry.path();
        const bool raw = other.count(file.extension()) > 0 || file.string().find(".raw.gz") != std::string::npos ||
                         file.string().find(".img.gz") != std::string::npos;
        if (entry.is_regular_file() && !raw) {
            EXPECT_TRUE(known.count(file) > 0 || known.count(file.parent_path()) > 0) << file;
        }
    }
}

std::string inflated(const fs::path& file)
{
    std::string bytes, piece(1 << 16, '\0');
    gzFile in = gzopen(file.c_str(), "rb");
    for (int n = 0; (n = gzread(in, piece.data(), static_cast<unsigned>(piece.size()))) > 0;) {
        bytes.append(piece, 0, static_cast<std::size_t>(n));
    }
    gzclose(in);
    return bytes;
}

// One head in twelve voxel orders: every labelled voxel is in the same place. The intensities stand for labels here, so the
// slope of the copies is taken out.
TEST(Manifest, OneHeadInTwelveVoxelOrdersIsInOnePlace)
{
    const fs::path data = manifest::folder() / "niivue_orientations_a/nifti_space";
    if (!fs::exists(data)) {
        GTEST_SKIP() << "no test volumes in " << PALPATE_TEST_DATA;
    }
    const fs::path copy = fs::temp_directory_path() / fmt::format("palpate-orders-{}.nii", ::getpid());
    std::vector<LabelImage> heads;
    for (const auto& entry : fs::directory_iterator(data)) {
        std::string bytes = inflated(entry.path());
        std::memset(bytes.data() + 112, 0, 8);  // scl_slope, scl_inter
        std::ofstream(copy, std::ios::binary) << bytes;
        heads.push_back(importLabels(copy).image);
    }
    fs::remove(copy);
    ASSERT_EQ(heads.size(), 12U);
    const LabelImage& first = heads[0];
    for (const LabelImage& head : heads) {
        double apart = 0;
        std::size_t labelled = 0, different = 0;
        forEachIndex(Index3(0), head.size - 1, [&](Index3 n) {
            const std::uint16_t value = head.values[head.offset(n)];
            if (value == 0) {
                return;
            }
            const Vec3 p = head.affine.toPatient(Vec3(n));
            const Index3 there(glm::floor(first.affine.toIndex(p) + 0.5));
            apart = std::max(apart, glm::length(first.affine.toPatient(Vec3(there)) - p));
            different += first.values.at(first.offset(there)) == value ? 0 : 1;
            ++labelled;
        });
        EXPECT_EQ(labelled, 338752U - 158953U);
        EXPECT_EQ(different, 0U);
        EXPECT_LT(apart, 2e-8);  // [m]: the files' own sforms are of single precision, 1e-5 mm at 100 mm
    }
}

// Names that the writers put into their files: a NIfTI extension, 3D Slicer's segments, DICOM's.
TEST(Manifest, NamesColoursAndTerminologyAreTakenFromTheFile)
{
    const fs::path data = manifest::folder();
    if (!fs::exists(data / "slicer_seg_nrrd")) {
        GTEST_SKIP() << "no test volumes in " << data;
    }
    const auto named = [](const ImportedLabels& labels, int value) {
        const auto found =
            std::find_if(labels.names.begin(), labels.names.end(), [&](const LabelName& n) { return n.value == value; });
        return found == labels.names.end() ? LabelName{} : *found;
    };
    const ImportedLabels slicer = importLabels(data / "slicer_seg_nrrd/Segmentation.seg.nrrd");
    EXPECT_EQ(slicer.names.size(), 7U);
    EXPECT_EQ(named(slicer, 6).name, "left lung");
    const std::array<std::uint8_t, 3> bone = {253, 232, 158};  // Color:=0.992157 0.909804 0.619608
    EXPECT_EQ(named(slicer, 1).colour, bone);
    EXPECT_NE(named(slicer, 1).terminology.find("SCT^113197003^Rib"), std::string::npos);
    const ImportedLabels total = importLabels(data / "totalsegmentator_ct/example_seg.nii.gz");
    EXPECT_EQ(total.names.size(), 117U);
    EXPECT_EQ(named(total, 5).name, "liver");
    const ImportedLabels dicom = importLabels(data / "dcmqi_seg/liver.dcm");
    EXPECT_EQ(named(dicom, 1).name, "Liver");
    EXPECT_NE(named(dicom, 1).terminology.find("^Liver"), std::string::npos);
    EXPECT_TRUE(named(dicom, 1).colour.has_value());
}

// One mask per structure: a voxel of a mask is the structure's in the end, or is counted as lost; an empty mask is left
// out.
TEST(Manifest, FoldersOfMasksBecomeOneLabelMap)
{
    const fs::path data = manifest::folder() / "totalsegmentator_ct";
    if (!fs::exists(data)) {
        GTEST_SKIP() << "no test volumes in " << PALPATE_TEST_DATA;
    }
    const ImportedLabels labels = importLabels(data / "example_seg_tissue_types");
    auto found = manifest::histogram(labels.image);
    found.erase(0);
    for (const Overlap& o : labels.overlaps) {
        found[o.lost] += o.voxels;
    }
    EXPECT_EQ(found, (std::map<int, std::uint64_t>{{1, 35293}, {2, 35357}, {3, 33969}}));  // as the table counts each
    ASSERT_EQ(labels.names.size(), 3U);
    EXPECT_EQ(labels.names[1].name, "subcutaneous_fat");
    const ImportedLabels organs = importLabels(data / "example_seg_fast");
    ASSERT_EQ(organs.names.size(), 1U);
    EXPECT_EQ(organs.names[0].name, "liver");
    EXPECT_EQ(std::count(organs.image.values.begin(), organs.image.values.end(), organs.names[0].value), 39350);
    ASSERT_EQ(organs.warnings.size(), 1U);
    EXPECT_NE(organs.warnings[0].find("without a voxel are left out: heart"), std::string::npos);
    EXPECT_NE(tests::errorOf([&] { importLabels(data); }).find("give the segmentation"), std::string::npos);
}

// Half of a file is never taken for all of it.
TEST(Manifest, TruncatedCopiesAreRefused)
{
    const fs::path data = manifest::folder();
    const fs::path folder = fs::temp_directory_path() / fmt::format("palpate-truncated-{}", ::getpid());
    const std::vector<std::string> files = {
        "totalsegmentator_ct/example_seg.nii.gz", "nifti_rs/27/int16.nii",           "spl_abdomen_atlas/seg.nrrd",
        "pynrrd/BallBinary30x30x30.nrrd",         "niivue_labels/torsoLabel.nii.gz", "dcmqi_seg/liver.dcm",
        "pynrrd/BallBinary30x30x30_bz2.nrrd",     "dcmqi_seg/24x38x3/seg/label.seg"};
    if (!fs::exists(data / files[0])) {
        GTEST_SKIP() << "no test volumes in " << data;
    }
    fs::create_directories(folder);
    for (const std::string& name : files) {
        const fs::path copy = folder / fs::path(name).filename();
        const auto whole = fs::file_size(data / name);
        for (const double fraction : {0.0, 0.02, 0.3, 0.7, 0.99}) {
            fs::copy_file(data / name, copy, fs::copy_options::overwrite_existing);
            fs::permissions(copy, fs::perms::owner_write, fs::perm_options::add);
            fs::resize_file(copy, static_cast<std::uintmax_t>(fraction * static_cast<double>(whole)));
            EXPECT_THROW(importLabels(copy), std::runtime_error) << name << " cut to " << fraction;
        }
        fs::copy_file(data / name, copy, fs::copy_options::overwrite_existing);
        EXPECT_NO_THROW(importLabels(copy)) << name;
    }
    fs::remove_all(folder);
}

}  // namespace
}  // namespace palpate::volume
