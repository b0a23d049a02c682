// What a file leaves open, and what it says that cannot be: rules that hold for all formats alike (docs/formats.md).
#include <tests/error_of.h>
#include <tests/folder.h>
#include <tests/volume/files.h>
#include <volume/import.h>
#include <volume/tissue.h>

#include "bodies.h"
#include "gzip.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <glm/geometric.hpp>

#include <cmath>
#include <cstring>
#include <fstream>
#include <numeric>

namespace palpate::volume {
namespace {

namespace fs = std::filesystem;

// 2 x 3 x 4 voxels of `volumes` volumes: voxel i of volume v is (i + v) % 5.
template <typename T>
std::vector<T> smallRamp(int volumes = 1)
{
    std::vector<T> values;
    for (int v = 0; v < volumes; ++v) {
        for (int i = 0; i < 24; ++i) {
            values.push_back(static_cast<T>((i + v) % 5));
        }
    }
    return values;
}

/// The fields of a NIfTI-1 header, or of Analyze without its magic.
struct NiftiFields {
    std::string bytes = std::string(352, '\0');

    NiftiFields(std::int16_t type, std::int16_t bits)
    {
        put<std::int32_t>(0, 348).sizes({3, 2, 3, 4, 1}).put(70, type).put(72, bits).put(108, 352.0F);
        put(80, 1.0F).put(84, 2.0F).put(88, 3.0F);
        std::memcpy(bytes.data() + 344, "n+1", 4);
    }
    template <typename T>
    NiftiFields& put(std::size_t at, T value)
    {
        std::memcpy(bytes.data() + at, &value, sizeof value);
        return *this;
    }
    NiftiFields& sizes(std::initializer_list<std::int16_t> dim)
    {
        std::size_t at = 40;
        for (const std::int16_t n : dim) {
            put(at, n);
            at += 2;
        }
        return *this;
    }
    NiftiFields& oriented() { return put<std::int16_t>(254, 1).put(280, 1.0F).put(300, 2.0F).put(320, 3.0F); }
};

std::string smallMeta(const std::string& extra, const std::string& data = "LOCAL", const std::string& type = "MET_UCHAR")
{
    return fmt::format("NDims = 3\nDimSize = 2 3 4\nElementSpacing = 1 2 3\n{}ElementType = {}\nElementDataFile = {}\n",
                       extra, type, data);
}

class ReadingRules : public ::testing::Test {
protected:
    fs::path write(const std::string& name, const std::string& bytes) const
    {
        std::ofstream(folder / name, std::ios::binary) << bytes;
        return folder / name;
    }
    static std::string reason(const fs::path& file, const ImportOptions& options = {})
    {
        return tests::errorOf([&] { importLabels(file, options); });
    }
    static bool warns(const ImportedLabels& labels, const std::string& words)
    {
        return std::any_of(labels.warnings.begin(), labels.warnings.end(),
                           [&](const std::string& w) { return w.find(words) != std::string::npos; });
    }

    const tests::Folder folder;
};

// FDA ships p_1.mhd with p_1.raw.gz, and its header names p_1.raw in some releases.
TEST_F(ReadingRules, ADataFileThatIsOnlyThereGzippedIsRead)
{
    const std::string data = bytesOf(smallRamp<std::uint8_t>());
    write("p.raw.gz", gzip(data));
    const ImportedLabels labels = importLabels(write("p.mhd", smallMeta(patientAxes, "p.raw")));
    EXPECT_EQ(labels.image.values, smallRamp<std::uint16_t>());
    EXPECT_TRUE(warns(labels, "its data file p.raw is not there: p.raw.gz beside it is read"));
    const ImportedLabels nrrd = importLabels(
        write("p.nhdr",
              "NRRD0004\ntype: uchar\ndimension: 3\nspace: LPS\nsizes: 2 3 4\nspace directions: (1,0,0) (0,2,0) "
              "(0,0,3)\nencoding: raw\ndata file: p.raw\n\n"));
    EXPECT_EQ(nrrd.image.values, labels.image.values);
    // The one that is named goes first.
    write("p.raw", bytesOf(std::vector<std::uint8_t>(24, 7)));
    EXPECT_EQ(importLabels(folder / "p.mhd").image.values, std::vector<std::uint16_t>(24, 7));
}

// One rule: the axes are taken as left, posterior, superior with one warning, and --axes says otherwise.
TEST_F(ReadingRules, FilesThatDoNotSayWhichSideIsLeftAreTreatedAlike)
{
    const std::string data = bytesOf(smallRamp<std::uint8_t>());
    NiftiFields analyze(2, 8);
    std::memset(analyze.bytes.data() + 344, 0, 4);
    write("analyze.img", data);
    const fs::path files[] = {
        write("plain.nii", NiftiFields(2, 8).bytes + data),
        write("analyze.hdr", analyze.put(108, 0.0F).bytes.substr(0, 348)),
        write("plain.mha", smallMeta("") + data),
        write("plain.nrrd", "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 3 4\nspacings: 1 2 3\nencoding: raw\n\n" + data),
    };
    for (const fs::path& file : files) {
        SCOPED_TRACE(file.filename());
        const ImportedLabels labels = importLabels(file);
        EXPECT_EQ(labels.image.values, smallRamp<std::uint16_t>());
        ASSERT_EQ(labels.warnings.size(), 1U);
        EXPECT_TRUE(warns(labels, "does not say which side is left: its axes are taken as left, posterior, superior"));
        EXPECT_NEAR(glm::length(labels.image.affine.linear[1] - Vec3(0, 2e-3, 0)), 0, 1e-9);
        ImportOptions options;
        options.axes = "RSA";  // x to the right, y to the head, z to the front
        const ImportedLabels told = importLabels(file, options);
        EXPECT_TRUE(told.warnings.empty());
        EXPECT_NEAR(glm::length(told.image.affine.linear[0] - Vec3(-1e-3, 0, 0)), 0, 1e-9);
        EXPECT_NEAR(glm::length(told.image.affine.linear[1] - Vec3(0, 0, 2e-3)), 0, 1e-9);
        EXPECT_NEAR(glm::length(told.image.affine.linear[2] - Vec3(0, -3e-3, 0)), 0, 1e-9);
        for (const char* wrong : {"RL", "RRA", "LPX", "lps"}) {
            options.axes = wrong;
            EXPECT_NE(reason(file, options).find("must be three letters"), std::string::npos) << wrong;
        }
    }
    ImportOptions options;
    options.axes = "RAS";
    for (const fs::path& file :
         {write("said.nii", NiftiFields(2, 8).oriented().bytes + data), write("said.mha", smallMeta(patientAxes) + data)}) {
        EXPECT_NE(reason(file, options).find("it says itself where its axes run"), std::string::npos);
    }
    EXPECT_TRUE(importLabels(write("rai.mha", smallMeta("AnatomicalOrientation = RAI\n") + data)).warnings.empty());
}

// A rotation has a quaternion of length one, of which three parts are stored.
TEST_F(ReadingRules, AQuaternionLongerThanOneIsNoRotation)
{
    const auto turned = [&](float b, float c) {
        NiftiFields nifti(2, 8);
        nifti.put(252, std::int16_t{1}).put(256, b).put(260, c);
        return write("q.nii", nifti.bytes + bytesOf(smallRamp<std::uint8_t>()));
    };
    const float half = std::sqrt(0.5F);
    EXPECT_NEAR(importLabels(turned(half, half)).image.affine.voxelVolume(), 6e-9, 1e-14);
    EXPECT_NEAR(importLabels(turned(1.00005F * half, half)).image.affine.voxelVolume(), 6e-9, 1e-14) << "rounding";
    EXPECT_NE(reason(turned(1, 1)).find("is longer than one"), std::string::npos);
    EXPECT_NE(reason(turned(std::nanf(""), 0)).find("is longer than one"), std::string::npos);
}

TEST_F(ReadingRules, AnSformOfZerosGivesWayToAGoodQform)
{
    const std::string data = bytesOf(smallRamp<std::uint8_t>());
    NiftiFields header(2, 8);
    header.put<std::int16_t>(254, 1).put<std::int16_t>(252, 1).put(268, 5.0F);
    const ImportedLabels labels = importLabels(write("a.nii", header.bytes + data));
    EXPECT_TRUE(warns(labels, "its sform is all zero, though it has a code: the qform is used"));
    EXPECT_NEAR(glm::length(labels.image.affine.origin - Vec3(-5e-3, 0, 0)), 0, 1e-9);
    EXPECT_NEAR(labels.image.affine.voxelVolume(), 6e-9, 1e-15);
    // An edge has no sign, and readers differ in what they make of one.
    NiftiFields negative = header;
    negative.put(80, -1.0F);
    EXPECT_NE(reason(write("a.nii", negative.bytes + data)).find("pixdim[1] = -1: it is not known which way"),
              std::string::npos);
    // Without a qform nothing is left to use.
    header.put<std::int16_t>(252, 0);
    EXPECT_NE(reason(write("a.nii", header.bytes + data)).find("the spacing in its header is wrong"), std::string::npos);
}

TEST_F(ReadingRules, AnOriginThatIsNoPlaceIsSaidToBeThat)
{
    NiftiFields header(2, 8);
    header.put<std::int16_t>(254, 1).put(280, 1.0F).put(300, 1.0F).put(320, 1.0F);
    const std::string data = bytesOf(smallRamp<std::uint8_t>());
    EXPECT_EQ(reason(write("a.nii", header.bytes + data)), "");
    header.put(292, std::numeric_limits<float>::quiet_NaN());
    const std::string why = reason(write("a.nii", header.bytes + data));
    EXPECT_NE(why.find(", 0, 0 mm: the origin in its header is wrong"), std::string::npos) << why;
    EXPECT_EQ(why.find("spacing"), std::string::npos) << why;
}

// A fourth side of 1 is no side; volume N of several is what it would be alone.
TEST_F(ReadingRules, OneVolumeOfFourDimensionsIsReadAndOneOfManyIsChosen)
{
    const std::string once = bytesOf(smallRamp<std::uint8_t>()), thrice = bytesOf(smallRamp<std::uint8_t>(3));
    const auto meta4 = [](int volumes) {
        return fmt::format(
            "NDims = 4\nDimSize = 2 3 4 {}\nElementSpacing = 1 2 3 1\nOffset = 10 20 30 0\nTransformMatrix = 0 1 0 0 "
            "1 0 0 0 0 0 1 0 0 0 0 1\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n",
            volumes);
    };
    const ImportedLabels one = importLabels(write("one.mha", meta4(1) + once));
    EXPECT_EQ(one.image.values, smallRamp<std::uint16_t>());
    EXPECT_NEAR(glm::length(one.image.affine.linear[0] - Vec3(0, 1e-3, 0)), 0, 1e-12);
    EXPECT_NEAR(glm::length(one.image.affine.origin - Vec3(10e-3, 20e-3, 30e-3)), 0, 1e-12);
    std::string interleaved;
    for (std::size_t i = 0; i < 24; ++i) {
        for (std::size_t v = 0; v < 3; ++v) {
            interleaved += thrice[24 * v + i];
        }
    }
    const std::string nrrd =
        "NRRD0004\ntype: uchar\ndimension: 4\nspace: LPS\nencoding: raw\nsizes: 3 2 3 4\nkinds: {} domain domain domain\n"
        "space directions: none (1,0,0) (0,2,0) (0,0,3)\n\n";
    const fs::path files[] = {
        write("many.mha", meta4(3) + thrice),
        write("many.nii", NiftiFields(2, 8).oriented().sizes({4, 2, 3, 4, 3}).bytes + thrice),
        write("many.nrrd", fmt::format(fmt::runtime(nrrd), "vector") + interleaved),
        write("layers.nrrd", fmt::format(fmt::runtime(nrrd), "list") + interleaved),
    };
    for (const fs::path& file : files) {
        SCOPED_TRACE(file.filename());
        const bool layers = file.stem() == "layers";
        EXPECT_EQ(reason(file).find("holds 3 volumes") != std::string::npos, !layers);
        for (int n = 1; n <= 3; ++n) {
            ImportOptions options;
            options.volume = n;
            std::vector<std::uint16_t> expected(24);
            for (int i = 0; i < 24; ++i) {
                expected[static_cast<std::size_t>(i)] = static_cast<std::uint16_t>((i + n - 1) % 5);
            }
            EXPECT_EQ(importLabels(file, options).image.values, expected) << n;
            const ImportedImage image = importImage(file, options);
            EXPECT_TRUE(std::equal(image.values.begin(), image.values.end(), expected.begin(), expected.end()));
        }
        ImportOptions options;
        options.volume = 4;
        EXPECT_NE(reason(file, options).find("--volume 4: it holds 3 volumes"), std::string::npos);
    }
    ImportOptions options;
    options.volume = 2;
    EXPECT_NE(reason(folder / "one.mha", options).find("--volume 2: it holds one volume"), std::string::npos);
}

TEST_F(ReadingRules, LabelsBeyondTheRangeAreRenumberedOnlyForWhoSaysSo)
{
    std::vector<std::int32_t> values(24, 0);
    values[1] = 70000;
    values[2] = 5;
    values[3] = -3;
    values[4] = 70000;
    values[5] = 1;
    const fs::path file = write("a.nii", NiftiFields(8, 32).oriented().bytes + bytesOf(values));
    EXPECT_NE(
        reason(file).find("voxel (1, 0, 0) is 70000: a label is a whole number from 0 to 65535; if this is a label map, "
                          "--renumber gives such labels free values"),
        std::string::npos)
        << reason(file);
    ImportOptions options;
    options.renumber = true;
    const ImportedLabels labels = importLabels(file, options);
    // In rising order: -3 takes 2, 70000 takes 3; 1 and 5 stay.
    EXPECT_EQ((std::vector<std::uint16_t>(labels.image.values.begin(), labels.image.values.begin() + 6)),
              (std::vector<std::uint16_t>{0, 3, 5, 2, 3, 1}));
    ASSERT_EQ(labels.renumbered.size(), 2U);
    EXPECT_EQ(labels.renumbered[0].original, -3);
    EXPECT_EQ(labels.renumbered[1].value, 3);
    EXPECT_TRUE(warns(labels, "2 labels are renumbered: -3 is 2, 70000 is 3"));

    // Over 1024 different values it is an image, and that is the reason.
    std::vector<std::int32_t> many(2000);
    std::iota(many.begin(), many.end(), -1000);
    const fs::path image = write("i.nii", NiftiFields(8, 32).oriented().sizes({3, 20, 10, 10, 1}).bytes + bytesOf(many));
    EXPECT_NE(reason(image).find("so this is not a label map but an image"), std::string::npos);
    EXPECT_NE(reason(image, options).find("has 2000 different values, so it is not a label map"), std::string::npos);
    // Over 2^53 two numbers may look like one.
    std::vector<std::int64_t> huge(24, 1);
    huge[0] = std::int64_t{1} << 60;
    const fs::path beyond = write("h.nii", NiftiFields(1024, 64).oriented().bytes + bytesOf(huge));
    EXPECT_NE(reason(beyond, options).find("whole numbers from 2^53 on cannot be told apart"), std::string::npos);
    huge[0] = (std::int64_t{1} << 53) + 1;  // 2^53 as a double
    const fs::path next = write("n.nii", NiftiFields(1024, 64).oriented().bytes + bytesOf(huge));
    EXPECT_NE(reason(next, options).find("from 2^53 on cannot be told apart"), std::string::npos);
    huge[0] = (std::int64_t{1} << 53) - 1;
    EXPECT_EQ(reason(write("n.nii", NiftiFields(1024, 64).oriented().bytes + bytesOf(huge)), options), "");
}

// value = slope * stored + offset, as in the other formats.
TEST_F(ReadingRules, TheSlopeOfAMetaImageIsAppliedAndNothingIsSaidTwice)
{
    const std::string slope = "ElementToIntensityFunctionSlope = 2\n", offset = "ElementToIntensityFunctionOffset = 1\n";
    const std::string voxels = bytesOf(smallRamp<std::uint8_t>());
    const fs::path file = write("s.mha", smallMeta(patientAxes + slope + offset) + voxels);
    const std::vector<std::uint16_t> labels = importLabels(file).image.values;
    const std::vector<float> image = importImage(file).values;
    ASSERT_EQ(labels.size(), 24U);
    for (std::size_t i = 0; i < 24; ++i) {
        EXPECT_EQ(labels[i], 2 * (i % 5) + 1);
        EXPECT_EQ(image[i], static_cast<float>(2 * (i % 5) + 1));
    }
    EXPECT_NE(reason(write("s.mha", smallMeta("ElementToIntensityFunctionSlope = 0\n") + voxels)).find("Slope = 0"),
              std::string::npos);
    const std::string twice = slope + "ElementToIntensityFunctionSlope = 3\n";
    EXPECT_NE(reason(write("s.mha", smallMeta(twice) + voxels)).find("gives 'ElementToIntensityFunctionSlope' twice"),
              std::string::npos);
    EXPECT_EQ(reason(write("s.mha", smallMeta(patientAxes + slope + slope) + voxels)), "")
        << "VICTRE's headers repeat a line";
}

TEST_F(ReadingRules, NearlyWholeLabelsAreRoundedOnlyForWhoSaysSo)
{
    std::vector<float> values(24, 0.99999994F);
    values[0] = 2;
    const fs::path file = write("a.nii", NiftiFields(16, 32).oriented().bytes + bytesOf(values));
    EXPECT_NE(reason(file).find(
                  "voxel (1, 0, 0) is 0.99999994, and 23 voxels like it are up to 6e-08 off a whole number: --round "
                  "takes the whole number"),
              std::string::npos)
        << reason(file);
    ImportOptions options;
    options.round = true;
    const ImportedLabels labels = importLabels(file, options);
    EXPECT_EQ(labels.image.values[1], 1);
    EXPECT_TRUE(warns(labels, "23 voxels are rounded to whole numbers"));
    // A probability is none that is nearly whole.
    values[5] = 0.4F;
    const fs::path soft = write("s.nii", NiftiFields(16, 32).oriented().bytes + bytesOf(values));
    EXPECT_NE(reason(soft).find("an image or a probability"), std::string::npos) << reason(soft);
    EXPECT_NE(reason(soft, options).find("voxel (1, 2, 0) is 0.4"), std::string::npos) << reason(soft, options);
}

// A value that is no label is no inside either: a probability of 0.05, or the -1 that is written for nothing.
TEST_F(ReadingRules, AMaskOfAFolderHoldsALabel)
{
    fs::create_directories(folder / "masks");
    const auto masked = [&](float inside) {
        std::vector<float> values(24, 0.0F);
        values[4] = values[9] = inside;
        write("masks/liver.nii", NiftiFields(16, 32).oriented().bytes + bytesOf(values));
        return folder / "masks";
    };
    for (const float inside : {1.0F, 255.0F, 0.99999994F}) {
        const ImportedLabels labels = importLabels(masked(inside));
        EXPECT_EQ(std::accumulate(labels.image.values.begin(), labels.image.values.end(), 0), 2) << inside;
    }
    EXPECT_NE(reason(masked(0.05F)).find("voxel 4 is 0.05"), std::string::npos) << reason(folder / "masks");
    EXPECT_NE(reason(masked(-1.0F)).find("voxel 4 is -1"), std::string::npos) << reason(folder / "masks");
    EXPECT_NE(reason(masked(NAN)).find("voxel 4 is not a number"), std::string::npos) << reason(folder / "masks");
}

// Two bytes without a byte order: little endian, and said.
TEST_F(ReadingRules, ANrrdOfTwoBytesThatDoesNotSayItsByteOrderIsTakenWithAWarning)
{
    const std::string head =
        "NRRD0004\ntype: {}\ndimension: 3\nspace: LPS\nsizes: 2 3 4\nspace directions: (1,0,0) (0,2,0) (0,0,3)\nencoding: "
        "raw\n\n";
    const ImportedLabels two =
        importLabels(write("a.nrrd", fmt::format(fmt::runtime(head), "short") + bytesOf(smallRamp<std::uint16_t>())));
    EXPECT_EQ(two.image.values, smallRamp<std::uint16_t>());
    EXPECT_TRUE(warns(two, "does not say endian: little is assumed"));
    EXPECT_TRUE(importLabels(write("b.nrrd", fmt::format(fmt::runtime(head), "uchar") + bytesOf(smallRamp<std::uint8_t>())))
                    .warnings.empty());
}

// What is no file is said to be what it is, and nothing waits for a pipe.
TEST_F(ReadingRules, WhatIsNoFileIsCalledWhatItIs)
{
    fs::create_symlink("loop.nii", folder / "loop.nii");
    fs::create_symlink("gone.nii", folder / "broken.nii");
    ASSERT_EQ(::mkfifo((folder / "pipe.nii").c_str(), 0600), 0);
    write("raw.mhd", smallMeta(patientAxes, "pipe.nii"));
    const std::pair<fs::path, const char*> all[] = {
        {folder / "loop.nii", "is a symbolic link that leads back to itself"},
        {folder / "broken.nii", "is a symbolic link to a file that is not there"},
        {folder / "pipe.nii", "is a named pipe, not a file"},
        {"/dev/null", "is a device, not a file"},
        {folder / "none.nii", "there is no such file: check the name"},
        {folder / "raw.mhd", "its data file pipe.nii is a named pipe, not a file"},
    };
    for (const auto& [file, words] : all) {
        EXPECT_NE(reason(file).find(words), std::string::npos) << reason(file);
        EXPECT_NE(tests::errorOf([&, f = file] { importImage(f); }).find(words), std::string::npos);
        EXPECT_EQ(reason(file).rfind(file.string() + ": ", 0), 0U);
    }
    EXPECT_NE(tests::errorOf([&] { Tissue::load(folder / "pipe.nii"); }).find("is a named pipe"), std::string::npos);
}

// Voxels of 10 um, whose volume is 1e-15 m3, become tissue and come back from a file as they were; 0.1 um are a wrong unit.
TEST_F(ReadingRules, VoxelsOfTenMicrometresBecomeTissue)
{
    LabelImage image{{8, 9, 10}, {Mat3(1e-5), Vec3(0.1, 0.2, 0.3)}, std::vector<std::uint16_t>(720, 1)};
    const Tissue tissue = Tissue::fromLabels(image, bodies::table(), bodies::names(), {});
    tissue.save(folder / "v.vdb");
    const Tissue back = Tissue::load(folder / "v.vdb");
    EXPECT_EQ(back.affine().linear, image.affine.linear);
    EXPECT_EQ(back.affine().origin, image.affine.origin);
    const Tissue::Reader reader(back);
    EXPECT_EQ(reader.label(image.affine.toPatient({3, 4, 5})), 1);
    EXPECT_EQ(reader.label(image.affine.toPatient({30, 4, 5})), 0);
    const std::string data = bytesOf(smallRamp<std::uint8_t>());
    const std::string small =
        "NDims = 3\nDimSize = 2 3 4\nElementSpacing = {0} {0} {0}\nTransformMatrix = 1 0 0 0 1 0 0 0 1\n"
        "ElementType = MET_UCHAR\nElementDataFile = LOCAL\n";
    EXPECT_EQ(reason(write("a.mha", fmt::format(fmt::runtime(small), "0.01") + data)), "");
    EXPECT_NE(reason(write("a.mha", fmt::format(fmt::runtime(small), "0.0001") + data)).find("check the units"),
              std::string::npos);
}

}  // namespace
}  // namespace palpate::volume
