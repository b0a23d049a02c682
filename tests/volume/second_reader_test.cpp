// Real files through ITK (which has GDCM inside), as a second reader: the same value in the same place.
#include "manifest.h"

#include <base/cells.h>
#include <volume/import.h>

#include <gtest/gtest.h>
#include <tests/folder.h>
#include <tests/volume/files.h>
#include <tests/volume/itk_compiler.h>

#include <itkGDCMImageIO.h>
#include <itkMetaImageIO.h>
#include <itkNrrdImageIO.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <filesystem>
#include <fstream>
#include <functional>

namespace palpate::volume {
namespace {

namespace fs = std::filesystem;

/// What ITK makes of a file.
struct Second {
    Index3 size{1};
    Affine affine;
    std::vector<double> values;
};

template <typename T>
std::vector<double> doubles(itk::ImageIOBase& io, std::size_t count)
{
    std::vector<T> raw(count);
    io.Read(raw.data());
    return {raw.begin(), raw.end()};
}

Second read(itk::ImageIOBase& io, const fs::path& file)
{
    using Type = itk::IOComponentEnum;
    io.SetFileName(file.string());
    io.ReadImageInformation();
    Second out;
    itk::ImageIORegion region(io.GetNumberOfDimensions());
    for (unsigned axis = 0; axis < std::min(3U, io.GetNumberOfDimensions()); ++axis) {
        const int a = static_cast<int>(axis);
        region.SetSize(axis, io.GetDimensions(axis));
        out.size[a] = static_cast<int>(io.GetDimensions(axis));
        out.affine.origin[a] = 1e-3 * io.GetOrigin(axis);
        for (unsigned row = 0; row < 3; ++row) {
            out.affine.linear[a][static_cast<int>(row)] = 1e-3 * io.GetSpacing(axis) * io.GetDirection(axis)[row];
        }
    }
    io.SetIORegion(region);
    const std::size_t count = base::countOf(out.size);
    const std::map<Type, std::function<std::vector<double>()>> readers = {
        {Type::UCHAR, [&] { return doubles<unsigned char>(io, count); }},
        {Type::SHORT, [&] { return doubles<short>(io, count); }},
        {Type::USHORT, [&] { return doubles<unsigned short>(io, count); }},
        {Type::INT, [&] { return doubles<int>(io, count); }},
        {Type::FLOAT, [&] { return doubles<float>(io, count); }},
        {Type::DOUBLE, [&] { return doubles<double>(io, count); }}};
    out.values = readers.at(io.GetComponentType())();
    return out;
}

// Every voxel of theirs is a voxel of ours, with the same value.
void expectInside(const Second& second, const ImportedImage& image, const std::string& name)
{
    std::size_t different = 0, at = 0;
    double apart = 0;
    const Mat3 toIndex = glm::inverse(image.affine.linear);
    forEachIndex(Index3(0), second.size - 1, [&](Index3 n) {
        const Vec3 p = second.affine.toPatient(Vec3(n));
        const Index3 ours(glm::floor(toIndex * (p - image.affine.origin) + 0.5));
        const Index3 in = glm::clamp(ours, Index3(0), image.size - 1);
        apart = std::max(apart, glm::length(image.affine.toPatient(Vec3(in)) - p));
        const auto offset =
            (static_cast<std::size_t>(in.z) * static_cast<std::size_t>(image.size.y) + static_cast<std::size_t>(in.y)) *
                static_cast<std::size_t>(image.size.x) +
            static_cast<std::size_t>(in.x);
        different += static_cast<double>(image.values[offset]) == second.values[at++] ? 0 : 1;
    });
    EXPECT_LT(apart, 1e-6) << name;  // [m]
    EXPECT_EQ(different, 0U) << name;
}

TEST(SecondReader, AgreesOnEveryDicomSeries)
{
    loadDicomDictionary();
    int compared = 0;
    for (const manifest::Row& row : manifest::rows()) {
        if (!row.isSeries() || row.name.find("sliceincrement") != std::string::npos) {
            continue;
        }
        const ImportedImage image = importImage(row.path);
        for (const auto& slice : fs::directory_iterator(row.path)) {
            const auto io = itk::GDCMImageIO::New();
            expectInside(read(*io, slice.path()), image, slice.path());
            ++compared;
        }
    }
    if (compared == 0) {
        GTEST_SKIP() << "no test volumes in " << PALPATE_TEST_DATA;
    }
    EXPECT_GT(compared, 130);
}

TEST(SecondReader, AgreesOnNrrdFiles)
{
    int compared = 0;
    for (const manifest::Row& row : manifest::rows()) {
        const bool small = fs::exists(row.path) && fs::is_regular_file(row.path) && fs::file_size(row.path) < 300000;
        const bool plain = row.format.find("bzip2") == std::string::npos && row.format.find("ASCII") == std::string::npos &&
                           row.place.find("refuses") == std::string::npos && row.counts.rfind("L0", 0) != 0;
        // ITK reads the zeros of a header in front of the voxels as voxels.
        if (row.format.rfind("NRRD", 0) != 0 || !small || !plain || row.name.find("_nifti.nhdr") != std::string::npos) {
            continue;
        }
        const auto io = itk::NrrdImageIO::New();
        expectInside(read(*io, row.path), importImage(row.path), row.name);
        ++compared;
    }
    if (compared == 0) {
        GTEST_SKIP() << "no test volumes in " << PALPATE_TEST_DATA;
    }
    EXPECT_GT(compared, 20);
}

// dcmqi's segmentations and the NRRD files that they were made of or became: a segment is where its label is.
// A negative spacing turns its axis round; without a matrix, too.
TEST(SecondReader, AgreesOnNegativeSpacings)
{
    const tests::Folder folder;
    const std::string voxels("abcdefghijklmnopqrstuvwx");
    const auto compare = [&](itk::ImageIOBase& io, const std::string& name, const std::string& text) {
        const fs::path file = folder / name;
        std::ofstream(file) << text << voxels;
        const ImportedLabels ours = importLabels(file);
        const Second theirs = read(io, file);
        for (int axis = 0; axis < 3; ++axis) {
            EXPECT_LT(glm::distance(ours.image.affine.linear[axis], theirs.affine.linear[axis]), 1e-12) << text << axis;
        }
        EXPECT_LT(glm::distance(ours.image.affine.origin, theirs.affine.origin), 1e-12) << text;
    };
    const std::string meta = "ObjectType = Image\nNDims = 3\nDimSize = 2 3 4\nElementType = MET_UCHAR\n",
                      local = "ElementDataFile = LOCAL\n";
    const std::string nrrd = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 3 4\nencoding: raw\n";
    for (const std::string spacing : {"1.2 -0.7 2.5", "-1.2 0.7 2.5", "1.2 0.7 -2.5", "-1 -2 -3"}) {
        for (const std::string matrix : {"", "TransformMatrix = 0 1 0 -1 0 0 0 0 1\nOffset = 3 4 5\n"}) {
            compare(*itk::MetaImageIO::New(), "a.mha", meta + "ElementSpacing = " + spacing + "\n" + matrix + local);
        }
        compare(*itk::NrrdImageIO::New(), "a.nrrd", nrrd + "spacings: " + spacing + "\n\n");
    }
}

TEST(SecondReader, SegmentationsAreWhereTheirNrrdFilesAre)
{
    const fs::path data = manifest::folder() / "dcmqi_seg";
    if (!fs::exists(data)) {
        GTEST_SKIP() << "no test volumes in " << PALPATE_TEST_DATA;
    }
    struct Pair {
        const char *seg, *nrrd;
        std::uint16_t segment, label;
    };
    const std::vector<Pair> pairs = {{"liver.dcm", "liver_seg.nrrd", 1, 1},
                                     {"24x38x3/seg/label.seg", "24x38x3/nrrd/label.nrrd", 1, 1},
                                     {"sparse-labelmap-noppv.dcm", "sparse_labelmap_noppv_seg.nrrd", 1, 1},
                                     {"sparse-labelmap-ppv5.dcm", "sparse_labelmap_ppv5_seg.nrrd", 1, 1},
                                     {"partial_overlaps.dcm", "partial_overlaps-1.nrrd", 1, 1},
                                     {"partial_overlaps.dcm", "partial_overlaps-2.nrrd", 2, 2},
                                     {"partial_overlaps.dcm", "partial_overlaps-3.nrrd", 3, 3},
                                     {"partial_overlaps.dcm", "partial_overlaps-1.nrrd", 4, 4},
                                     {"partial_overlaps.dcm", "partial_overlaps-1.nrrd", 5, 5}};
    const std::vector<std::string> names = {"GREEN", "ORANGE", "PURPLE", "LIGHT_BLUE", "DARK_BLUE"};
    for (const Pair& pair : pairs) {
        ImportOptions options;
        if (std::string(pair.seg) == "partial_overlaps.dcm") {
            options.overlap = {names[pair.segment - 1U]};  // so that it is there as a whole
        }
        const LabelImage seg = importLabels(data / pair.seg, options).image;
        const LabelImage nrrd = importLabels(data / pair.nrrd).image;
        std::size_t labelled = 0, missed = 0;
        forEachIndex(Index3(0), nrrd.size - 1, [&](Index3 n) {
            if (nrrd.values[nrrd.offset(n)] != pair.label) {
                return;
            }
            const Vec3 index = seg.affine.toIndex(nrrd.affine.toPatient(Vec3(n)));
            const Index3 there = glm::clamp(Index3(glm::floor(index + 0.5)), Index3(0), seg.size - 1);
            const bool same = glm::length(index - Vec3(there)) < 1e-2 && seg.values[seg.offset(there)] == pair.segment;
            missed += same ? 0 : 1;
            ++labelled;
        });
        const auto all = static_cast<std::size_t>(std::count(seg.values.begin(), seg.values.end(), pair.segment));
        EXPECT_EQ(missed, 0U) << pair.seg << " " << pair.nrrd;
        EXPECT_EQ(labelled, all) << pair.seg << " " << pair.nrrd;
        EXPECT_GT(labelled, 0U);
    }
}

// TotalSegmentator's label map was made of this series: it lies on the same grid, whichever way its axes run.
TEST(SecondReader, ALabelMapLiesOnTheSeriesThatItWasMadeOf)
{
    const fs::path data = manifest::folder() / "totalsegmentator_dicom";
    if (!fs::exists(data)) {
        GTEST_SKIP() << "no test volumes in " << PALPATE_TEST_DATA;
    }
    const ImportedImage image = importImage(data / "example_ct_dicom");
    const LabelImage labels = importLabels(data / "example_seg_dicom.nii.gz").image;
    // Vertebra (32) is dense and liver (5) soft, in the same voxels.
    double sum = 0, liver = 0;
    std::size_t bones = 0, livers = 0;
    forEachIndex(Index3(0), labels.size - 1, [&](Index3 n) {
        const std::uint16_t v = labels.values[labels.offset(n)];
        if (v != 5 && v != 32) {
            return;
        }
        const Vec3 index = image.affine.toIndex(labels.affine.toPatient(Vec3(n)));
        const Index3 there(glm::floor(index + 0.5));
        ASSERT_LT(glm::length(index - Vec3(there)), 0.01);
        const double hu = static_cast<double>(
            image.values[static_cast<std::size_t>((there.z * image.size.y + there.y) * image.size.x + there.x)]);
        (v == 5 ? liver : sum) += hu;
        (v == 5 ? livers : bones) += 1;
    });
    EXPECT_GT(liver / static_cast<double>(livers), 0.0);  // [HU]; soft tissue
    EXPECT_LT(liver / static_cast<double>(livers), 200.0);
    EXPECT_GT(sum / static_cast<double>(bones), 120.0);  // vertebra
}

}  // namespace
}  // namespace palpate::volume
