#include "gzip.h"

// Files made here, byte by byte, that tell the truth and that lie.
#include <tests/folder.h>
#include <tests/volume/files.h>
#include <volume/import.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <vector>

namespace palpate::volume {
namespace {

namespace fs = std::filesystem;

class ImportFile : public ::testing::Test {
protected:
    fs::path write(const std::string& name, const std::string& bytes) const
    {
        std::ofstream(folder / name, std::ios::binary) << bytes;
        return folder / name;
    }
    // The reason for which a file is refused; empty when it is taken.
    static std::string reason(const fs::path& file)
    {
        try {
            importLabels(file);
            return "";
        } catch (const std::runtime_error& e) {
            EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
            EXPECT_EQ(std::string(e.what()).rfind(file.string(), 0), 0U) << e.what();
            return std::string(e.what()).substr(file.string().size());
        }
    }
    static void expectRefused(const fs::path& file, const std::string& word)
    {
        const std::string why = reason(file);
        EXPECT_NE(why, "") << file << " was taken";
        EXPECT_NE(why.find(word), std::string::npos) << why;
    }

    const tests::Folder folder;
};

// 4 x 5 x 6 voxels, values 0 to 6.
constexpr int voxels = 120;

template <typename T>
std::vector<T> ramp()
{
    std::vector<T> values(voxels);
    for (std::size_t i = 0; i < values.size(); ++i) {
        values[i] = static_cast<T>(i % 7);
    }
    return values;
}

std::string meta(const std::string& extra, const std::string& type = "MET_UCHAR", const std::string& size = "4 5 6",
                 const std::string& data = "LOCAL")
{
    return fmt::format(
        "ObjectType = Image\nNDims = 3\n{}DimSize = {}\nElementSpacing = 1 2 3\nOffset = 10 20 30\n"
        "ElementType = {}\nElementDataFile = {}\n",
        extra, size, type, data);
}

// A NIfTI-1 header with an identity sform of 1 mm, voxels from byte 352 on.
struct Nifti {
    std::string bytes = std::string(352, '\0');

    explicit Nifti(std::int16_t type = 2, std::int16_t bits = 8)
    {
        put<std::int32_t>(0, 348);
        const std::int16_t dim[8] = {3, 4, 5, 6, 1, 1, 1, 1};
        const float pixdim[4] = {1, 1, 1, 1};
        for (std::size_t i = 0; i < 8; ++i) {
            put(40 + 2 * i, dim[i]);
        }
        for (std::size_t i = 0; i < 4; ++i) {
            put(76 + 4 * i, pixdim[i]);
        }
        put(70, type);
        put(72, bits);
        put(108, 352.0F);
        put<std::int16_t>(254, 1);
        for (std::size_t row = 0; row < 3; ++row) {
            put(280 + 20 * row, 1.0F);
        }
        std::memcpy(bytes.data() + 344, "n+1", 4);
    }
    template <typename T>
    Nifti& put(std::size_t at, T value)
    {
        std::memcpy(bytes.data() + at, &value, sizeof value);
        return *this;
    }
};

// A NIfTI-2 header with the same meaning, in either byte order.
std::string nifti2(bool swapped)
{
    std::string bytes(544, '\0');
    const auto put = [&](std::size_t at, auto value) {
        char raw[sizeof value];
        std::memcpy(raw, &value, sizeof value);
        if (swapped) {
            std::reverse(raw, raw + sizeof value);
        }
        std::memcpy(bytes.data() + at, raw, sizeof value);
    };
    put(0, std::int32_t{540});
    std::memcpy(bytes.data() + 4, "n+2\0\r\n\032\n", 8);
    put(12, std::int16_t{4});
    put(14, std::int16_t{16});
    const std::int64_t dim[8] = {3, 4, 5, 6, 1, 1, 1, 1};
    for (std::size_t i = 0; i < 8; ++i) {
        put(16 + 8 * i, dim[i]);
        put(104 + 8 * i, 1.0);
    }
    put(168, std::int64_t{544});
    put(348, std::int32_t{1});
    put(400, 2.0);   // x to the right
    put(440, 3.0);   // y to the front
    put(480, 4.0);   // z to the head
    put(488, 50.0);  // and 50 mm up
    return bytes;
}

void expectRamp(const ImportedLabels& labels)
{
    EXPECT_EQ(labels.image.size, Index3(4, 5, 6));
    EXPECT_EQ(labels.image.values, ramp<std::uint16_t>());
}

TEST_F(ImportFile, MetaImageComesInWithItsGeometry)
{
    const auto labels =
        importLabels(write("a.mha", meta("TransformMatrix = 0 1 0 -1 0 0 0 0 1\n") + bytesOf(ramp<std::uint8_t>())));
    expectRamp(labels);
    EXPECT_TRUE(labels.warnings.empty());
    const Affine& a = labels.image.affine;
    EXPECT_NEAR(a.origin.z, 30e-3, 1e-12);
    EXPECT_NEAR(a.linear[0].y, 1e-3, 1e-12);   // first axis points to +y
    EXPECT_NEAR(a.linear[1].x, -2e-3, 1e-12);  // second to -x
}

// The four combinations of what the header says of the packing and what the data are: all are read as they are.
TEST_F(ImportFile, MetaImageThatLiesAboutItsPackingIsReadAsItIs)
{
    const std::string plain = bytesOf(ramp<std::uint16_t>());
    for (const bool declared : {false, true}) {
        for (const bool packed : {false, true}) {
            const std::string said =
                std::string(patientAxes) + (declared ? "CompressedData = True\n" : "CompressedData = False\n");
            write("v.raw", packed ? gzip(plain) : plain);
            const auto labels = importLabels(write("v.mhd", meta(said, "MET_USHORT", "4 5 6", "v.raw")));
            expectRamp(labels);
            EXPECT_EQ(labels.warnings.empty(), declared == packed);
        }
    }
    write("v.raw", gzip(plain));
    const std::string shorter = "CompressedData = True\nCompressedDataSize = 20\n";
    expectRamp(importLabels(write("v.mhd", meta(shorter, "MET_USHORT", "4 5 6", "v.raw"))));
}

TEST_F(ImportFile, BigEndianVoxelsOfAMisdeclaredFileAreTurned)
{
    std::string swapped = bytesOf(ramp<std::uint16_t>());
    for (std::size_t i = 0; i < swapped.size(); i += 2) {
        std::swap(swapped[i], swapped[i + 1]);
    }
    write("v.raw", gzip(swapped));
    expectRamp(importLabels(write("v.mhd", meta("BinaryDataByteOrderMSB = True\n", "MET_USHORT", "4 5 6", "v.raw"))));
}

TEST_F(ImportFile, SecondVersionOfNiftiComesInInBothByteOrders)
{
    std::string turned = bytesOf(ramp<std::int16_t>());
    for (std::size_t i = 0; i < turned.size(); i += 2) {
        std::swap(turned[i], turned[i + 1]);
    }
    for (const bool swapped : {false, true}) {
        const auto labels =
            importLabels(write("a.nii", nifti2(swapped) + (swapped ? turned : bytesOf(ramp<std::int16_t>()))));
        expectRamp(labels);
        EXPECT_NEAR(labels.image.affine.linear[0].x, -2e-3, 1e-15);
        EXPECT_NEAR(labels.image.affine.linear[1].y, -3e-3, 1e-15);
        EXPECT_NEAR(labels.image.affine.linear[2].z, 4e-3, 1e-15);
        EXPECT_NEAR(labels.image.affine.origin.z, 50e-3, 1e-15);
    }
    expectRefused(write("a.nii", nifti2(false)), "cut short");
}

// A slope makes an image of what is stored; the header and the voxels may lie in two files.
TEST_F(ImportFile, PairsOfFilesAndImagesComeIn)
{
    Nifti header(4, 16);
    header.put(112, 0.5F).put(116, -3.0F).put(108, 0.0F);
    std::memcpy(header.bytes.data() + 344, "ni1", 4);
    header.bytes.resize(348);
    write("pair.hdr", header.bytes);
    expectRefused(folder / "pair.hdr", "are not there");
    write("pair.img", bytesOf(ramp<std::int16_t>()));
    for (const char* name : {"pair.hdr", "pair.img"}) {
        const ImportedImage image = importImage(folder / name);
        ASSERT_EQ(image.values.size(), 120U);
        for (std::size_t i = 0; i < 120; ++i) {
            ASSERT_FLOAT_EQ(image.values[i], 0.5F * static_cast<float>(i % 7) - 3.0F);
        }
    }
    // Without NIfTI's magic it is Analyze, which has no factor; SPM's is refused.
    std::memset(header.bytes.data() + 344, 0, 4);
    expectRefused(write("pair.hdr", header.bytes), "a factor of 0.5 at the place where SPM puts one");
    write("pair.hdr", header.put(112, 0.0F).bytes);
    const ImportedLabels labels = importLabels(folder / "pair.hdr");
    expectRamp(labels);
    ASSERT_EQ(labels.warnings.size(), 1U);
    EXPECT_NE(labels.warnings[0].find("does not say which side is left"), std::string::npos);
    expectRefused(write("pair.nii", header.bytes + std::string(4, '\0')), "its magic is missing");
}

// The first two bytes of every zlib stream are also two labels.
TEST_F(ImportFile, AnUnpackedPairMayBeginLikeAPackedOne)
{
    Nifti header(2, 8);
    header.put(108, 0.0F);
    std::memcpy(header.bytes.data() + 344, "ni1", 4);
    header.bytes.resize(348);
    write("pair.hdr", header.bytes);
    for (const int second : {1, 94, 156, 218}) {
        auto labels = ramp<std::uint8_t>();
        labels[0] = 120;
        labels[1] = static_cast<std::uint8_t>(second);
        write("pair.img", bytesOf(labels));
        const ImportedLabels found = importLabels(folder / "pair.hdr");
        EXPECT_EQ(found.image.values[0], 120);
        EXPECT_EQ(found.image.values[1], second);
    }
}

TEST_F(ImportFile, VoxelsThatAreNotNumbersTakeTheSmallestOfAnImage)
{
    auto floats = ramp<float>();
    floats[0] = -5.0F;
    floats[3] = std::numeric_limits<float>::quiet_NaN();
    const ImportedImage image = importImage(write("a.nii", Nifti(16, 32).bytes + bytesOf(floats)));
    EXPECT_EQ(image.values[3], -5.0F);
    ASSERT_EQ(image.warnings.size(), 1U);
    EXPECT_NE(image.warnings[0].find("1 voxels are not numbers"), std::string::npos);
}

// Freesurfer: c is the centre at index size / 2; its axes are RAS.
TEST_F(ImportFile, FreeSurferVolumesComeIn)
{
    std::string bytes(284, '\0');
    const auto put = [&](std::size_t at, auto value) {
        char raw[sizeof value];
        std::memcpy(raw, &value, sizeof value);
        std::reverse(raw, raw + sizeof value);
        std::memcpy(bytes.data() + at, raw, sizeof value);
    };
    const std::int32_t head[7] = {1, 4, 5, 6, 1, 0, 0};
    for (std::size_t i = 0; i < 7; ++i) {
        put(4 * i, head[i]);
    }
    put(28, std::int16_t{1});
    const float numbers[15] = {1, 2, 3, -1, 0, 0, 0, 0, -1, 0, 1, 0, 10, 20, 30};  // spacing, x, y, z, centre
    for (std::size_t i = 0; i < 15; ++i) {
        put(30 + 4 * i, numbers[i]);
    }
    const auto labels = importLabels(write("a.mgz", gzip(bytes + bytesOf(ramp<std::uint8_t>()) + std::string(20, 'x'))));
    expectRamp(labels);
    const Affine& a = labels.image.affine;
    EXPECT_NEAR(glm::length(a.linear[0] - Vec3(1e-3, 0, 0)), 0, 1e-9);   // left
    EXPECT_NEAR(glm::length(a.linear[1] - Vec3(0, 0, -2e-3)), 0, 1e-9);  // down
    EXPECT_NEAR(glm::length(a.linear[2] - Vec3(0, -3e-3, 0)), 0, 1e-9);  // to the front
    EXPECT_NEAR(glm::length(a.toPatient({2, 2.5, 3}) - Vec3(-10e-3, -20e-3, 30e-3)), 0, 1e-9);

    // Without a place the program assumes one, and --axes goes before that.
    put(28, std::int16_t{0});
    const fs::path open = write("open.mgz", gzip(bytes + bytesOf(ramp<std::uint8_t>())));
    const auto assumed = importLabels(open);
    EXPECT_NEAR(glm::length(assumed.image.affine.linear[1] - Vec3(0, 0, -1e-3)), 0, 1e-9);
    ASSERT_EQ(assumed.warnings.size(), 1U);
    EXPECT_NE(assumed.warnings[0].find("FreeSurfer's coronal axes unless --axes says otherwise"), std::string::npos);
    ImportOptions options;
    options.axes = "RAS";
    EXPECT_NEAR(glm::length(importLabels(open, options).image.affine.linear[1] - Vec3(0, -1e-3, 0)), 0, 1e-9);
}

// An inflated stream whose end falls onto the end of a buffer is not a short one.
TEST_F(ImportFile, PackedDataOfEverySizeEndWhereTheyEnd)
{
    for (const int n : {1023, 1024, 1025, 2048}) {
        std::string plain(static_cast<std::size_t>(n) * 1024, '\0');
        plain[5] = 1;
        const std::string size = fmt::format("1024 {} 1", n);
        EXPECT_EQ(reason(write("a.mha", meta("CompressedData = True\n", "MET_UCHAR", size) + gzip(plain))), "") << n;
    }
}

TEST_F(ImportFile, SizesThatDoNotFitTheBytesAreRefused)
{
    const std::string data = bytesOf(ramp<std::uint8_t>());
    for (const char* size : {"4 5 7", "4 5 5", "4 4 6", "3 5 6", "40 50 60", "1000 2000 2000"}) {
        expectRefused(write("a.mha", meta("", "MET_UCHAR", size) + data), "bytes");
    }
    expectRefused(write("a.mha", meta("", "MET_UCHAR", "32767 32767 32767") + data), "more than");
    expectRefused(write("a.mha", meta("", "MET_USHORT") + data), "cut short");
    expectRefused(write("a.mha", meta("", "MET_UCHAR", "4 0 6") + data), "1 to 32767");
    expectRefused(write("a.mha", meta("", "MET_UCHAR", "-4 5 6") + data), "1 to 32767");
    expectRefused(write("a.mha", meta("", "MET_UCHAR", "4 5") + data), "contradicts");
    expectRefused(write("a.nii", Nifti().put<std::int16_t>(46, 7).bytes + data), "cut short");
    expectRefused(write("a.nii", Nifti().put<std::int16_t>(46, 5).bytes + data), "its header is wrong");
    expectRefused(write("a.nii", Nifti(4, 8).bytes + data), "contradicts");
    expectRefused(write("a.nii.gz", gzip(Nifti().put<std::int16_t>(46, 7).bytes + data)), "cut short");
}

TEST_F(ImportFile, DamagedCompressedDataAreRefused)
{
    std::string packed = gzip(Nifti().bytes + bytesOf(ramp<std::uint8_t>()));
    expectRamp(importLabels(write("good.nii.gz", packed)));
    expectRefused(write("short.nii.gz", packed.substr(0, packed.size() - 9)), "cut short");
    packed[packed.size() - 6] = static_cast<char>(packed[packed.size() - 6] ^ 1);  // the checksum of the whole
    expectRefused(write("flipped.nii.gz", packed), "damaged");
}

TEST_F(ImportFile, ValuesThatNoLabelMapHoldsAreNamedWithTheirPlace)
{
    auto floats = ramp<float>();
    expectRamp(importLabels(write("a.nii", Nifti(16, 32).bytes + bytesOf(floats))));
    floats[4 + 2] = 2.5F;
    expectRefused(write("a.nii", Nifti(16, 32).bytes + bytesOf(floats)), "voxel (2, 1, 0) is 2.5");
    floats[4 + 2] = std::numeric_limits<float>::quiet_NaN();
    expectRefused(write("a.nii", Nifti(16, 32).bytes + bytesOf(floats)), "voxel (2, 1, 0) is not a number");
    floats[4 + 2] = -1.0F;
    expectRefused(write("a.nii", Nifti(16, 32).bytes + bytesOf(floats)), "voxel (2, 1, 0) is -1");
    floats[4 + 2] = 70000.0F;
    expectRefused(write("a.nii", Nifti(16, 32).bytes + bytesOf(floats)), "voxel (2, 1, 0) is 70000");
    expectRefused(write("a.nii", Nifti().bytes + std::string(voxels, '\0')), "no voxel is set");
}

TEST_F(ImportFile, MoreThan1024ValuesAreAnImage)
{
    std::vector<std::uint16_t> values(40 * 50 * 2);
    for (std::size_t i = 0; i < values.size(); ++i) {
        values[i] = static_cast<std::uint16_t>(i % 1024);
    }
    EXPECT_EQ(reason(write("a.mha", meta("", "MET_USHORT", "40 50 2") + bytesOf(values))), "");
    values[7] = 2000;
    expectRefused(write("a.mha", meta("", "MET_USHORT", "40 50 2") + bytesOf(values)), "1025 different values");
}

// value = slope * stored + intercept.
TEST_F(ImportFile, ScaledNiftiIsTakenWhenTheResultsAreLabels)
{
    const auto labels =
        importLabels(write("a.nii", Nifti().put(112, 2.0F).put(116, 1.0F).bytes + bytesOf(ramp<std::uint8_t>())));
    EXPECT_EQ(labels.image.values[0], 1);
    EXPECT_EQ(labels.image.values[6], 13);
    expectRefused(write("a.nii", Nifti().put(112, 0.3F).bytes + bytesOf(ramp<std::uint8_t>())), "its slope is applied");
}

// RAS in the file, LPS here; the sform counts, and a qform that disagrees is worth a warning.
TEST_F(ImportFile, TheSformPlacesANifti)
{
    Nifti nifti;
    nifti.put(280, 0.0F).put(284, -2.0F).put(292, 5.0F).put(296, 1.0F).put(300, 0.0F).put(308, 7.0F);
    auto labels = importLabels(write("a.nii", nifti.bytes + bytesOf(ramp<std::uint8_t>())));
    EXPECT_NEAR(labels.image.affine.linear[0].y, -1e-3, 1e-9);
    EXPECT_NEAR(labels.image.affine.linear[1].x, 2e-3, 1e-9);
    EXPECT_NEAR(labels.image.affine.origin.x, -5e-3, 1e-9);
    EXPECT_NEAR(labels.image.affine.origin.y, -7e-3, 1e-9);
    EXPECT_TRUE(labels.warnings.empty());
    nifti.put<std::int16_t>(252, 1);
    labels = importLabels(write("a.nii", nifti.bytes + bytesOf(ramp<std::uint8_t>())));
    ASSERT_EQ(labels.warnings.size(), 1U);
    EXPECT_NE(labels.warnings[0].find("sform is used"), std::string::npos);
    EXPECT_NEAR(labels.image.affine.linear[1].x, 2e-3, 1e-9);
    nifti.put<std::int16_t>(254, 0);  // no sform any more: qform, the unit quaternion
    labels = importLabels(write("a.nii", nifti.bytes + bytesOf(ramp<std::uint8_t>())));
    EXPECT_NEAR(labels.image.affine.linear[0].x, -1e-3, 1e-9);
    EXPECT_NEAR(labels.image.affine.linear[1].y, -1e-3, 1e-9);
}

TEST_F(ImportFile, ShearedAndFlatGridsAreRefused)
{
    expectRefused(write("a.nii", Nifti().put(284, 0.2F).bytes + bytesOf(ramp<std::uint8_t>())), "sheared");
    expectRefused(write("a.nii", Nifti().put(280, 0.0F).bytes + bytesOf(ramp<std::uint8_t>())), "spacing");
    expectRefused(
        write("a.nii", Nifti().put(280, std::numeric_limits<float>::quiet_NaN()).bytes + bytesOf(ramp<std::uint8_t>())),
        "spacing");
}

TEST_F(ImportFile, NumbersThatAreNotFiniteInOtherHeadersAreRefused)
{
    const std::string data = bytesOf(ramp<std::uint8_t>());
    for (const char* bad : {"nan", "inf", "0", "-1e999"}) {
        EXPECT_NE(reason(write("a.mha", meta(fmt::format("TransformMatrix = {} 0 0 0 1 0 0 0 1\n", bad)) + data)), "")
            << bad;
        EXPECT_NE(reason(write("a.nrrd", fmt::format("NRRD0004\ntype: uchar\ndimension: 3\nspace: LPS\nsizes: 4 5 6\n"
                                                     "space directions: ({},0,0) (0,2,0) (0,0,3)\nencoding: raw\n\n",
                                                     bad) +
                                             data)),
                  "")
            << bad;
    }
}

TEST_F(ImportFile, ManyVolumesAndManyValuesPerVoxelAreRefused)
{
    const std::string twice = bytesOf(ramp<std::uint8_t>()) + bytesOf(ramp<std::uint8_t>());
    expectRefused(write("a.nii", Nifti().put<std::int16_t>(40, 4).put<std::int16_t>(48, 2).bytes + twice), "2 volumes");
    expectRefused(write("a.mha", meta("ElementNumberOfChannels = 2\n") + twice), "2 values per voxel");
    for (const char* kinds : {"vector domain domain domain", "time domain domain domain"}) {
        expectRefused(write("a.nrrd", fmt::format("NRRD0004\ntype: uchar\ndimension: 4\nsizes: 2 4 5 6\nkinds: {}\n"
                                                  "encoding: raw\n\n",
                                                  kinds) +
                                          twice),
                      "choose one with --volume N");
    }
}

TEST_F(ImportFile, NrrdComesInRawAndPackedAndIsRefusedWhenItLies)
{
    const std::string head =
        "NRRD0004\ntype: uchar\ndimension: 3\nspace: RAS\nsizes: 4 5 6\n"
        "space directions: (1,0,0) (0,2,0) (0,0,3)\nspace origin: (10,20,30)\n";
    const std::string data = bytesOf(ramp<std::uint8_t>());
    for (const bool packed : {false, true}) {
        const std::string encoding = packed ? "encoding: gzip\n\n" : "encoding: raw\n\n";
        const auto labels = importLabels(write("a.nrrd", head + encoding + (packed ? gzip(data) : data)));
        expectRamp(labels);
        EXPECT_NEAR(labels.image.affine.origin.x, -10e-3, 1e-9);
        EXPECT_NEAR(labels.image.affine.linear[1].y, -2e-3, 1e-9);
        EXPECT_NEAR(labels.image.affine.linear[2].z, 3e-3, 1e-9);
    }
    expectRefused(write("a.nrrd", head + "encoding: gzip\n\n" + data), "not compressed");
    expectRefused(write("a.nrrd", head + "encoding: raw\n\n" + data.substr(1)), "cut short");
    expectRefused(write("a.nrrd", head + "encoding: raw\n\n" + data + data), "its header is wrong");
    expectRefused(write("a.nhdr", head + "encoding: raw\ndata file: gone.raw\n\n"), "gone.raw is not there");
}

TEST_F(ImportFile, WhatIsNoLabelMapIsNamed)
{
    expectRefused(write("a.mha", "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 5\n"), "git-LFS");
    expectRefused(write("a.nii", ""), "empty");
    expectRefused(write("a.txt", "hello"), "no format");
    expectRefused(write("a.nii", "hello"), "ends after 5 bytes");
    expectRefused(write("a.nrrd", "hello"), "NRRD");
    expectRefused(write("a.mha", "hello"), "not a MetaImage");
    expectRefused(write("a.dcm", std::string(128, '\0') + "DICM"), "DICOM");
    expectRefused(folder.path(), "folder");
    expectRefused(folder / "missing.nii", "no such file");
}

}  // namespace
}  // namespace palpate::volume
