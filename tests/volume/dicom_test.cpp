// DICOM series and segmentations made here with DCMTK, slice by slice.
#include <base/inputs.h>
#include <tests/volume/files.h>
#include <volume/import.h>

#include <dcmtk/config/osconfig.h>

#include <dcmtk/dcmdata/dcrleerg.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmjpeg/djencode.h>
#include <dcmtk/dcmjpeg/djrplol.h>
#include <dcmtk/dcmjpls/djencode.h>
#include <dcmtk/dcmjpls/djrparam.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <initializer_list>
#include <numeric>
#include <random>

namespace palpate::volume {

void loadDicomDictionary()
{
    dcmDataDict.rdlock();
    dcmDataDict.rdunlock();
}

namespace {

namespace fs = std::filesystem;

constexpr int columns = 7;
constexpr int rows = 5;

/// A slice to be written. Lengths in mm, as in the file.
struct Slice {
    Vec3 position{0.0};
    Vec3 alongRow{1, 0, 0};
    Vec3 alongColumn{0, 1, 0};
    std::string series = "1.2.3";
    std::string instance = {};  // of its own where empty
    int index = 0;              // voxel (i, j) holds i + 10 j + 100 index - 50
    std::function<void(DcmDataset&)> change = {};
    E_TransferSyntax syntax = EXS_LittleEndianExplicit;
    Uint16 bits = 12;  // stored
};

class Dicom : public ::testing::Test {
protected:
    void SetUp() override { fs::create_directories(folder); }
    void TearDown() override { fs::remove_all(folder); }

    void write(const std::string& name, const Slice& slice) const
    {
        DcmFileFormat file;
        DcmDataset& data = *file.getDataset();
        const auto put = [&](const DcmTagKey& tag, const std::string& value) {
            data.putAndInsertString(tag, value.c_str());
        };
        put(DCM_SOPClassUID, UID_CTImageStorage);
        put(DCM_SOPInstanceUID, slice.instance.empty() ? "1.2.3.4." + std::to_string(slice.index + 1) : slice.instance);
        put(DCM_SeriesInstanceUID, slice.series);
        put(DCM_Modality, "CT");
        put(DCM_PhotometricInterpretation, "MONOCHROME2");
        put(DCM_PixelSpacing, "2\\0.5");  // rows 2 mm apart, columns 0.5 mm
        put(DCM_SliceThickness, "9");
        put(DCM_ImagePositionPatient, dicomVector(slice.position));
        put(DCM_ImageOrientationPatient, dicomVector(slice.alongRow) + "\\" + dicomVector(slice.alongColumn));
        put(DCM_RescaleSlope, "2");
        put(DCM_RescaleIntercept, "-1000");
        data.putAndInsertUint16(DCM_SamplesPerPixel, 1);
        data.putAndInsertUint16(DCM_Rows, rows);
        data.putAndInsertUint16(DCM_Columns, columns);
        data.putAndInsertUint16(DCM_BitsAllocated, 16);
        data.putAndInsertUint16(DCM_BitsStored, slice.bits);
        data.putAndInsertUint16(DCM_HighBit, static_cast<Uint16>(slice.bits - 1));
        data.putAndInsertUint16(DCM_PixelRepresentation, 1);
        std::vector<Uint16> pixels;
        for (int j = 0; j < rows; ++j) {
            for (int i = 0; i < columns; ++i) {
                pixels.push_back(static_cast<Uint16>((i + 10 * j + 100 * slice.index - 50) & ((1 << slice.bits) - 1)));
            }
        }
        data.putAndInsertUint16Array(DCM_PixelData, pixels.data(), pixels.size());
        if (slice.change) {
            slice.change(data);
        }
        compress(data, slice.syntax);
        const OFCondition saved = file.saveFile((folder / name).c_str(), slice.syntax);
        ASSERT_TRUE(saved.good()) << saved.text();
    }

    // Five slices along the normal, `gap` mm apart, `drift` mm to the side with each.
    void writeSeries(const Vec3& x, const Vec3& y, double gap, const Vec3& drift = Vec3(0.0)) const
    {
        const Vec3 n = glm::cross(x, y);
        const std::array<const char*, 5> names = {"c", "e", "a", "d", "b"};  // not in the order of the slices
        for (int k = 0; k < 5; ++k) {
            write(names[static_cast<std::size_t>(k)],
                  {Vec3(10, 20, 30) + static_cast<double>(k) * (gap * n + drift), x, y, "1.2.3", "", k, {}});
        }
    }

    // Slice `k` of a series along z.
    void writePacked(const std::string& name, int k, E_TransferSyntax syntax) const
    {
        const Uint16 bits = syntax == EXS_JPEGLSLossless ? 16 : 12;
        write(name, {Vec3(0, 0, 2 * k), {1, 0, 0}, {0, 1, 0}, "1.2.3", "", k, {}, syntax, bits});
    }

    std::string reason(const ImportOptions& options = {}) const
    {
        try {
            importImage(folder, options);
            return "";
        } catch (const std::runtime_error& e) {
            EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
            return e.what();
        }
    }

    static void compress(DcmDataset& data, E_TransferSyntax syntax)
    {
        DcmRLEEncoderRegistration::registerCodecs();
        DJEncoderRegistration::registerCodecs();
        DJLSEncoderRegistration::registerCodecs();
        const DJ_RPLossless jpeg;
        const DJLSRepresentationParameter jpegLs(0, OFTrue);
        const DcmRepresentationParameter* parameter = syntax == EXS_JPEGProcess14SV1 ? &jpeg
                                                      : syntax == EXS_JPEGLSLossless
                                                          ? &jpegLs
                                                          : static_cast<const DcmRepresentationParameter*>(nullptr);
        ASSERT_TRUE(data.chooseRepresentation(syntax, parameter).good());
    }

    fs::path folder = fs::temp_directory_path() / fmt::format("palpate-dicom-{}", ::getpid());
};

// value = 2 (i + 10 j + 100 k - 50) - 1000, at position + 0.5 i x + 2 j y + gap k n.
void expectValues(const ImportedImage& image)
{
    ASSERT_EQ(image.size, Index3(columns, rows, 5));
    for (int k = 0; k < 5; ++k) {
        for (int j = 0; j < rows; ++j) {
            for (int i = 0; i < columns; ++i) {
                const auto at = static_cast<std::size_t>((k * rows + j) * columns + i);
                ASSERT_EQ(image.values[at], static_cast<float>(2 * (i + 10 * j + 100 * k - 50) - 1000));
            }
        }
    }
}

TEST_F(Dicom, SlicesAreSortedByTheirPlaceAlongAnyNormal)
{
    const Vec3 x = glm::normalize(Vec3(1, 2, -1)), y = glm::normalize(glm::cross(Vec3(0, 0, 1), x));
    writeSeries(x, y, 3);
    const ImportedImage image = importImage(folder);
    expectValues(image);
    EXPECT_EQ(image.what, "HU");
    EXPECT_TRUE(image.warnings.empty());
    const Vec3 expected = 1e-3 * (Vec3(10, 20, 30) + 1.5 * x + 4.0 * y + 12.0 * glm::cross(x, y));
    EXPECT_NEAR(glm::length(image.affine.toPatient({3, 2, 4}) - expected), 0, 1e-9);
}

TEST_F(Dicom, CompressedSyntaxesHoldTheSamePixels)
{
    for (const E_TransferSyntax syntax : {EXS_LittleEndianImplicit, EXS_BigEndianExplicit, EXS_DeflatedLittleEndianExplicit,
                                          EXS_RLELossless, EXS_JPEGProcess14SV1, EXS_JPEGLSLossless}) {
        for (int k = 0; k < 5; ++k) {
            writePacked(std::to_string(k), k, syntax);
        }
        SCOPED_TRACE(DcmXfer(syntax).getXferName());
        ASSERT_EQ(reason(), "");
        expectValues(importImage(folder));
    }
}

// DCMTK's decoder of RLE follows damaged offsets out of its buffer; CharLS, that of JPEG-LS, has its assertions armed.
TEST_F(Dicom, DamagedCompressedPixelsAreTakenOrRefused)
{
    for (const E_TransferSyntax syntax : {EXS_RLELossless, EXS_JPEGProcess14SV1, EXS_JPEGLSLossless}) {
        SCOPED_TRACE(DcmXfer(syntax).getXferName());
        writePacked("a", 0, syntax);
        ASSERT_EQ(reason(), "");
        const std::string whole = base::contentOf(folder / "a").value();
        std::size_t refused = 0;
        const std::size_t pixels = whole.rfind("\xe0\x7f\x10");
        ASSERT_NE(pixels, std::string::npos);
        const auto damageAt = [&](std::initializer_list<std::size_t> places) {
            std::string bytes = whole;
            for (const std::size_t at : places) {
                bytes[at] = static_cast<char>(~bytes[at]);
            }
            std::ofstream(folder / "a", std::ios::binary) << bytes;
            refused += reason().empty() ? 0 : 1;
        };
        std::mt19937 random(1);
        for (std::size_t at = pixels + 20; at < whole.size(); ++at) {
            damageAt({at});
            damageAt({at, pixels + 20 + random() % (whole.size() - pixels - 20)});
        }
        EXPECT_GT(refused, 5U);
    }
}

TEST_F(Dicom, MissingUnevenAndDoubledSlicesAreRefused)
{
    writeSeries({1, 0, 0}, {0, 1, 0}, 3);
    fs::copy_file(folder / "a", folder / "copy");  // the same slice twice is no harm
    const ImportedImage twice = importImage(folder);
    expectValues(twice);
    ASSERT_EQ(twice.warnings.size(), 1U);
    write("copy", {Vec3(10, 20, 36), {1, 0, 0}, {0, 1, 0}, "1.2.3", "1.2.3.99", 3, {}});
    EXPECT_NE(reason().find("two slices in one place"), std::string::npos) << reason();
    fs::remove(folder / "copy");
    fs::remove(folder / "a");
    EXPECT_NE(reason().find("a slice is missing between e and d"), std::string::npos) << reason();
    write("a", {Vec3(10, 20, 37), {1, 0, 0}, {0, 1, 0}, "1.2.3", "", 2, {}});
    EXPECT_NE(reason().find("uneven"), std::string::npos) << reason();
}

TEST_F(Dicom, WhatDoesNotBelongTogetherIsRefused)
{
    writeSeries({1, 0, 0}, {0, 1, 0}, 3);
    const auto odd = [&](Slice slice, const std::string& word) {
        slice.instance = "1.2.3.77";
        write("odd", slice);
        EXPECT_NE(reason().find(word), std::string::npos) << reason();
        fs::remove(folder / "odd");
    };
    odd({Vec3(10, 20, 45), {0, 1, 0}, {0, 0, 1}}, "different directions");
    odd({Vec3(10, 20, 45), {1, 0, 0}, {0, 1, 0}, "9.9"}, "2 series: say which with --image-series");
    odd({Vec3(10, 20, 45),
         {1, 0, 0},
         {0, 1, 0},
         "1.2.3",
         "",
         5,
         [](DcmDataset& d) { d.putAndInsertString(DCM_PixelSpacing, "2\\0.6"); }},
        "different pixel spacings");
    odd({Vec3(10, 20, 45),
         {1, 0, 0},
         {0, 1, 0},
         "1.2.3",
         "",
         5,
         [](DcmDataset& d) { d.findAndDeleteElement(DCM_ImagePositionPatient); }},
        "does not say where its slice is");
    odd({Vec3(10, 20, 45), {1, 0, 0}, {0, 1, 0}, "1.2.3", "", 5, [](DcmDataset& d) { d.putAndInsertUint16(DCM_Rows, 4); }},
        "different sizes");
    odd({Vec3(10, 20, 45),
         {1, 0, 0},
         {0, 1, 0},
         "1.2.3",
         "",
         5,
         [](DcmDataset& d) { d.putAndInsertString(DCM_ImageOrientationPatient, "1\\0\\0\\0.5\\1\\0"); }},
        "not two unit vectors");
    odd({Vec3(10, 20, 45),
         {1, 0, 0},
         {0, 1, 0},
         "1.2.3",
         "",
         5,
         [](DcmDataset& d) { d.putAndInsertUint16(DCM_SamplesPerPixel, 3); }},
        "colours");
    ASSERT_EQ(reason(), "");
    write("other", {Vec3(10, 20, 45), {1, 0, 0}, {0, 1, 0}, "9.9"});
    ImportOptions options;
    options.series = "1.2.3";
    EXPECT_EQ(reason(options), "");
    options.series = "4.4";
    EXPECT_NE(reason(options).find("--image-series 4.4 is not there: name one of these: 1.2.3"), std::string::npos)
        << reason(options);
    fs::remove(folder / "other");
    for (const char* name : {"a", "b", "c", "d", "e"}) {
        write(name, {Vec3(10, 20, name[0]), {1, 0, 0}, {0, 1, 0}, "1.2.3", "", name[0] - 'a', [](DcmDataset& d) {
                         d.putAndInsertUint16(DCM_Rows, 500);
                     }});
    }
    EXPECT_NE(reason().find("promises 7 x 500 x 1 pixels"), std::string::npos) << reason();
}

// CT, another CT and a segmentation lie in one folder.
TEST_F(Dicom, TheSeriesOfTheLabelsIsTakenAndSegmentationsAreNoImages)
{
    writeSeries({1, 0, 0}, {0, 1, 0}, 3);
    write("seg", {Vec3(0), {1, 0, 0}, {0, 1, 0}, "6.6", "", 0, [](DcmDataset& d) {
                      DcmItem* item = nullptr;
                      d.putAndInsertString(DCM_Modality, "SEG");
                      d.putAndInsertString(DCM_SegmentationType, "BINARY");
                      d.findOrCreateSequenceItem(DCM_SegmentSequence, item);
                  }});
    expectValues(importImage(folder));
    ImportOptions options;
    options.series = "6.6";
    EXPECT_NE(reason(options).find("--image-series 6.6 is not there"), std::string::npos) << reason(options);
    write("other", {Vec3(10, 20, 45), {1, 0, 0}, {0, 1, 0}, "9.9"});
    options.series = "";
    options.seriesOfLabels = {"5.5", "1.2.3"};
    const ImportedImage image = importImage(folder, options);
    expectValues(image);
    ASSERT_EQ(image.warnings.size(), 1U);
    EXPECT_NE(image.warnings[0].find("1.2.3 is taken: the labels were made of it"), std::string::npos);
    options.seriesOfLabels = {"9.9", "1.2.3"};
    EXPECT_NE(reason(options).find("2 series: say which with --image-series"), std::string::npos) << reason(options);
    options.series = "9.9";
    EXPECT_EQ(importImage(folder / "a", options).values.size(), 35U) << "a file is what it is";
}

// The first or last slice would be missing without a word.
TEST_F(Dicom, DamagedFilesOfAFolderAreRefusedByName)
{
    writeSeries({1, 0, 0}, {0, 1, 0}, 3);
    const auto refused = [&](const std::string& name, const std::string& bytes, const std::string& words) {
        std::ofstream(folder / name, std::ios::binary) << bytes;
        EXPECT_NE(reason().find("/" + name + ": " + words), std::string::npos) << reason();
        fs::remove(folder / name);
    };
    refused("f", "", "is empty, where a DICOM file belongs");
    refused("e.dcm", std::string(500, '\0'), "does not begin as DICOM does");
    const auto last = [&](const std::string& series, const std::vector<DcmTagKey>& lost) {
        write("b", {Vec3(10, 20, 42), {1, 0, 0}, {0, 1, 0}, series, "", 4, [&lost](DcmDataset& d) {
                        for (const DcmTagKey& tag : lost) {
                            d.findAndDeleteElement(tag);
                        }
                    }});
    };
    last("1.2.3", {DCM_PixelData, DCM_SeriesInstanceUID, DCM_Rows});
    EXPECT_NE(reason().find("/b: is DICOM that belongs to no series"), std::string::npos) << reason();
    last("1.2.3", {DCM_PixelData, DCM_Rows});
    EXPECT_NE(reason().find("/b: is a DICOM image without its pixels"), std::string::npos) << reason();
    last("9.9", {DCM_PixelData});
    EXPECT_NE(reason().find("/b: is a DICOM image without its pixels"), std::string::npos) << reason();
    ImportOptions options;
    options.series = "1.2.3";
    EXPECT_EQ(reason(options), "") << "the other series was not asked for";
    std::ofstream(folder / "readme.txt") << "";
    EXPECT_EQ(reason(options), "");
}

// What gives values their unit is read, or the file is not.
TEST_F(Dicom, AScaleThatIsNoNumberAndATableOfValuesAreRefused)
{
    const auto with = [&](const std::function<void(DcmDataset&)>& change) {
        write("a", {Vec3(0), {1, 0, 0}, {0, 1, 0}, "1.2.3", "", 0, change});
        return reason();
    };
    const std::string slope = with([](DcmDataset& d) { d.putAndInsertString(DCM_RescaleSlope, "nan"); });
    EXPECT_NE(slope.find("its rescale slope or intercept is 'nan', which is no number"), std::string::npos) << slope;
    const std::string table = with([](DcmDataset& d) {
        DcmItem* item = nullptr;
        d.findOrCreateSequenceItem(DCM_ModalityLUTSequence, item);
    });
    EXPECT_NE(table.find("has a Modality LUT"), std::string::npos) << table;
    EXPECT_EQ(with([](DcmDataset& d) { d.putAndInsertString(DCM_RescaleSlope, ""); }), "");
}

TEST_F(Dicom, SlicesOfTwoFramesOfReferenceAreRefused)
{
    const auto inFrame = [&](const char* name, int k, const char* frame) {
        write(name, {Vec3(0, 0, k), {1, 0, 0}, {0, 1, 0}, "1.2.3", "", k, [frame](DcmDataset& d) {
                         d.putAndInsertString(DCM_FrameOfReferenceUID, frame);
                     }});
    };
    inFrame("a", 0, "7.1");
    inFrame("b", 1, "7.1");
    inFrame("c", 2, "");
    EXPECT_EQ(importImage(folder).frame, "7.1");
    inFrame("c", 2, "7.2");
    EXPECT_NE(reason().find("different frames of reference (7.1 in a, 7.2 in c)"), std::string::npos) << reason();
}

// A gantry tilted by 14 degrees: slices stay upright and shift, so the grid is sheared by that angle.
TEST_F(Dicom, ATiltedGantryIsASheardGrid)
{
    writeSeries({1, 0, 0}, {0, 1, 0}, 4, {0, 4 * std::tan(14 * 3.14159265358979 / 180), 0});
    const ImportedImage image = importImage(folder);
    expectValues(image);
    ASSERT_EQ(image.warnings.size(), 1U);
    EXPECT_NE(image.warnings[0].find("sheared by 14.0 degrees"), std::string::npos);
    EXPECT_NEAR(shearOf(image.affine), 14 * 3.14159265358979 / 180, 1e-6);
    EXPECT_NEAR(image.affine.toPatient({0, 0, 4}).z, 46e-3, 1e-9);
    EXPECT_THROW(importLabels(folder), std::runtime_error);
}

}  // namespace
}  // namespace palpate::volume
