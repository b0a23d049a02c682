// DICOM segmentations made here with DCMTK: sparse, overlapping, packed frames.
#include <base/inputs.h>
#include <tests/error_of.h>
#include <tests/folder.h>
#include <tests/volume/files.h>
#include <volume/import.h>

#include <dcmtk/config/osconfig.h>

#include <dcmtk/dcmdata/dcpixel.h>
#include <dcmtk/dcmdata/dcpixseq.h>
#include <dcmtk/dcmdata/dcpxitem.h>
#include <dcmtk/dcmdata/dctk.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <openjpeg-2.5/openjpeg.h>  // not the one that ITK brings
#include <zlib.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <numeric>

namespace palpate::volume {
namespace {

namespace fs = std::filesystem;

constexpr int segColumns = 7;
constexpr int segRows = 5;

/// The bytes of one compressed frame from its pixels.
using Pack = std::function<std::vector<Uint8>(const std::vector<int>&)>;

/// A segmentation to be written: `inside(segment, i, j, k)` gives the stored value; frames that hold none are left out.
struct Segmentation {
    std::string type = "BINARY";
    int bits = 1;
    int segments = 2;
    int slices = 6;
    std::function<int(int, int, int, int)> inside;
    const char* between = "3";  // SpacingBetweenSlices [mm]; empty: not there
};

class DicomSeg : public ::testing::Test {
protected:
    fs::path write(const Segmentation& s, E_TransferSyntax syntax = EXS_LittleEndianExplicit, const Pack& pack = {}) const
    {
        DcmFileFormat file;
        DcmDataset& data = *file.getDataset();
        data.putAndInsertString(DCM_SOPClassUID, UID_SegmentationStorage);
        data.putAndInsertString(DCM_SOPInstanceUID, "1.2.9");
        data.putAndInsertString(DCM_SeriesInstanceUID, "1.2.8");
        data.putAndInsertString(DCM_Modality, "SEG");
        data.putAndInsertString(DCM_SegmentationType, s.type.c_str());
        data.putAndInsertString(DCM_PhotometricInterpretation, "MONOCHROME2");
        data.putAndInsertUint16(DCM_MaximumFractionalValue, 200);
        data.putAndInsertUint16(DCM_SamplesPerPixel, 1);
        data.putAndInsertUint16(DCM_Rows, segRows);
        data.putAndInsertUint16(DCM_Columns, segColumns);
        data.putAndInsertUint16(DCM_BitsAllocated, static_cast<Uint16>(s.bits));
        data.putAndInsertUint16(DCM_BitsStored, static_cast<Uint16>(s.bits));
        data.putAndInsertUint16(DCM_HighBit, static_cast<Uint16>(s.bits - 1));
        data.putAndInsertUint16(DCM_PixelRepresentation, 0);
        for (int n = 1; n <= s.segments; ++n) {
            DcmItem* item = nullptr;
            data.findOrCreateSequenceItem(DCM_SegmentSequence, item, -2);
            item->putAndInsertUint16(DCM_SegmentNumber, static_cast<Uint16>(n));
            item->putAndInsertString(DCM_SegmentLabel, fmt::format("part {}", n).c_str());
            code(*item, DCM_SegmentedPropertyCategoryCodeSequence, "123037004", "Anatomical Structure");
            code(*code(*item, DCM_SegmentedPropertyTypeCodeSequence, "64033007", "Kid~ney"),
                 DCM_SegmentedPropertyTypeModifierCodeSequence, "7771000", "Left");
            const Uint16 white[3] = {65535, 32896, 32896};
            item->putAndInsertUint16Array(DCM_RecommendedDisplayCIELabValue, white, 3);
        }
        DcmItem *shared = nullptr, *measures = nullptr, *direction = nullptr;
        data.findOrCreateSequenceItem(DCM_SharedFunctionalGroupsSequence, shared);
        shared->findOrCreateSequenceItem(DCM_PixelMeasuresSequence, measures);
        measures->putAndInsertString(DCM_PixelSpacing, "2\\0.5");
        measures->putAndInsertString(DCM_SliceThickness, "3");
        if (*s.between != '\0') {
            measures->putAndInsertString(DCM_SpacingBetweenSlices, s.between);
        }
        DcmItem* series = nullptr;
        data.findOrCreateSequenceItem(DCM_ReferencedSeriesSequence, series);
        series->putAndInsertString(DCM_SeriesInstanceUID, "1.2.3");
        data.putAndInsertString(DCM_FrameOfReferenceUID, "1.2.7");
        shared->findOrCreateSequenceItem(DCM_PlaneOrientationSequence, direction);
        direction->putAndInsertString(DCM_ImageOrientationPatient, "1\\0\\0\\0\\1\\0");
        std::vector<int> values;
        int frames = 0;
        for (int n = 1; n <= (s.type == "LABELMAP" ? 1 : s.segments); ++n) {
            for (int k = 0; k < s.slices; ++k) {
                frames += addFrame(data, s, n, k, values) ? 1 : 0;
            }
        }
        data.putAndInsertString(DCM_NumberOfFrames, std::to_string(frames).c_str());
        std::vector<Uint8> bytes(values.size() * static_cast<std::size_t>(s.bits) / 8 + 2, 0);
        for (std::size_t i = 0; i < values.size(); ++i) {
            const auto v = static_cast<unsigned>(values[i]);
            if (s.bits == 1) {
                bytes[i / 8] = static_cast<Uint8>(bytes[i / 8] | (v << (i % 8)));
            } else {
                bytes[i] = static_cast<Uint8>(v);
            }
        }
        if (pack) {
            insertFrames(data, values, syntax, pack);
        } else {
            data.putAndInsertUint8Array(DCM_PixelData, bytes.data(), bytes.size() / 2 * 2);
        }
        const OFCondition saved = file.saveFile((folder / "seg.dcm").c_str(), syntax);
        EXPECT_TRUE(saved.good()) << saved.text();
        return folder / "seg.dcm";
    }

    std::string reason() const
    {
        return tests::errorOf([&] { importLabels(folder / "seg.dcm"); });
    }

    const tests::Folder folder;

private:
    // Each frame an item of its own, as `pack` makes it.
    static void insertFrames(DcmDataset& data, const std::vector<int>& values, E_TransferSyntax syntax, const Pack& pack)
    {
        auto* frames = new DcmPixelSequence(DCM_PixelSequenceTag);
        frames->insert(new DcmPixelItem(DCM_PixelItemTag));  // no table of offsets
        constexpr std::size_t size = std::size_t{segColumns} * segRows;
        for (std::size_t at = 0; at < values.size(); at += size) {
            std::vector<Uint8> bytes = pack({values.begin() + static_cast<std::ptrdiff_t>(at),
                                             values.begin() + static_cast<std::ptrdiff_t>(at + size)});
            bytes.resize((bytes.size() + 1) / 2 * 2, 0);
            auto* item = new DcmPixelItem(DCM_PixelItemTag);
            item->putUint8Array(bytes.data(), bytes.size());
            frames->insert(item);
        }
        auto* pixels = new DcmPixelData(DCM_PixelData);
        pixels->putOriginalRepresentation(syntax, nullptr, frames);
        data.insert(pixels, OFTrue);
    }

    static DcmItem* code(DcmItem& parent, const DcmTagKey& tag, const char* value, const char* meaning)
    {
        DcmItem* item = nullptr;
        parent.findOrCreateSequenceItem(tag, item);
        item->putAndInsertString(DCM_CodingSchemeDesignator, "SCT");
        item->putAndInsertString(DCM_CodeValue, value);
        item->putAndInsertString(DCM_CodeMeaning, meaning);
        return item;
    }

    static bool addFrame(DcmDataset& data, const Segmentation& s, int segment, int k, std::vector<int>& values)
    {
        std::vector<int> frame;
        for (int j = 0; j < segRows; ++j) {
            for (int i = 0; i < segColumns; ++i) {
                frame.push_back(s.inside(segment, i, j, k));
            }
        }
        if (std::accumulate(frame.begin(), frame.end(), 0) == 0) {
            return false;
        }
        values.insert(values.end(), frame.begin(), frame.end());
        DcmItem *item = nullptr, *position = nullptr, *which = nullptr;
        data.findOrCreateSequenceItem(DCM_PerFrameFunctionalGroupsSequence, item, -2);
        item->findOrCreateSequenceItem(DCM_PlanePositionSequence, position);
        position->putAndInsertString(DCM_ImagePositionPatient, dicomVector(Vec3(10, 20, 30 + 3 * k)).c_str());
        if (s.type != "LABELMAP") {
            item->findOrCreateSequenceItem(DCM_SegmentIdentificationSequence, which);
            which->putAndInsertUint16(DCM_ReferencedSegmentNumber, static_cast<Uint16>(segment));
        }
        return true;
    }
};

// Part 1 fills slices 0 and 4 but for a column, part 2 is a block in slice 4: slices 1 to 3 have no frame, and a frame of
// 35 bits begins within a byte.
TEST_F(DicomSeg, BinaryFramesAreSparseOverlapAndBeginWithinBytes)
{
    const Segmentation s{"BINARY", 1, 2, 6, [](int segment, int i, int j, int k) {
                             const bool one = (k == 0 || k == 4) && i != 3;
                             const bool two = k == 4 && i >= 2 && i <= 4 && j >= 1 && j <= 2;
                             return segment == 1 ? one : two;
                         }};
    const ImportedLabels labels = importLabels(write(s));
    ASSERT_EQ(labels.image.size, Index3(segColumns, segRows, 5));
    forEachIndex(Index3(0), labels.image.size - 1, [&](Index3 n) {
        const int expected = s.inside(2, n.x, n.y, n.z) != 0 ? 2 : s.inside(1, n.x, n.y, n.z);
        ASSERT_EQ(labels.image.values[labels.image.offset(n)], expected);
    });
    ASSERT_EQ(labels.overlaps.size(), 1U);
    EXPECT_EQ(labels.overlaps[0].kept, 2);
    EXPECT_EQ(labels.overlaps[0].lost, 1);
    EXPECT_EQ(labels.overlaps[0].voxels, 4U);
    EXPECT_NEAR(glm::length(labels.image.affine.toPatient({2, 1, 4}) - Vec3(11e-3, 22e-3, 42e-3)), 0, 1e-12);
    ASSERT_EQ(labels.names.size(), 2U);
    EXPECT_EQ(labels.names[1].name, "part 2");
    EXPECT_EQ(labels.names[1].terminology,
              "Segmentation category and type - DICOM master list~SCT^123037004^Anatomical Structure~SCT^64033007^Kid ney~"
              "SCT^7771000^Left~Anatomic codes - DICOM master list~^^~^^");
    ASSERT_TRUE(labels.names[1].colour);
    for (const std::uint8_t c : *labels.names[1].colour) {
        EXPECT_NEAR(c, 255, 1);  // CIELab 100, 0, 0 is white
    }
}

// 0 to 200 stands for 0 to 1.
TEST_F(DicomSeg, FractionalVoxelsCountFromTheThreshold)
{
    const fs::path file =
        write({"FRACTIONAL", 8, 1, 2, [](int, int i, int j, int k) { return i + segColumns * j + 100 * k; }});
    for (const float threshold : {0.0F, 0.1F, 0.5F, 0.6F}) {
        ImportOptions options;
        options.fractionalThreshold = threshold;
        const ImportedLabels labels = importLabels(file, options);
        std::size_t expected = 0;
        for (int v = 1; v < 135; ++v) {
            const bool stored = v < 35 || v >= 100;
            expected += stored && static_cast<double>(v) >= 200 * static_cast<double>(threshold) ? 1U : 0U;
        }
        EXPECT_EQ(static_cast<std::size_t>(std::count(labels.image.values.begin(), labels.image.values.end(), 1)), expected)
            << threshold;
        EXPECT_FALSE(labels.warnings.empty());
    }
}

TEST_F(DicomSeg, LabelMapsComeInAndUnknownSegmentsAreRefused)
{
    Segmentation s{"LABELMAP", 8, 3, 4, [](int, int i, int j, int k) { return (i + j + k) % 4; }};
    const ImportedLabels labels = importLabels(write(s));
    forEachIndex(Index3(0), labels.image.size - 1,
                 [&](Index3 n) { ASSERT_EQ(labels.image.values[labels.image.offset(n)], (n.x + n.y + n.z) % 4); });
    EXPECT_EQ(labels.names.size(), 3U);
    s.segments = 2;
    try {
        importLabels(write(s));
        FAIL();
    } catch (const std::runtime_error& e) {
        EXPECT_NE(std::string(e.what()).find("segment 3, which its list does not hold"), std::string::npos) << e.what();
    }
}

TEST_F(DicomSeg, SaysItsFrameOfReferenceAndWhatItWasMadeOf)
{
    const ImportedLabels labels = importLabels(write({"BINARY", 1, 1, 2, [](int, int, int, int) { return 1; }}));
    EXPECT_EQ(labels.frame, "1.2.7");
    EXPECT_EQ(labels.madeOf, std::vector<std::string>{"1.2.3"});
}

// Frames in slices 0, 2 and 4 of 3 mm: 6 mm is the distance of slices with gaps, or has slices without a frame in it.
TEST_F(DicomSeg, ADistanceThatNobodySaysIsNotGuessed)
{
    Segmentation s{"BINARY", 1, 1, 5, [](int, int, int, int k) { return k % 2 == 0 ? 1 : 0; }};
    EXPECT_EQ(importLabels(write(s)).image.size.z, 5);
    ImportOptions options;
    options.sliceSpacing = 3e-3;
    EXPECT_NE(tests::errorOf([&] { importLabels(folder / "seg.dcm", options); }).find("leave --slice-spacing out"),
              std::string::npos);
    s.between = "";
    write(s);
    EXPECT_NE(reason().find("its frames are 6 mm apart and 3 mm thick"), std::string::npos) << reason();
    const ImportedLabels labels = importLabels(folder / "seg.dcm", options);
    EXPECT_EQ(labels.image.size.z, 5);
    EXPECT_NEAR(labels.image.affine.spacing().z, 3e-3, 1e-12);
    options.sliceSpacing = 6e-3;
    EXPECT_EQ(importLabels(folder / "seg.dcm", options).image.size.z, 3);
    options.sliceSpacing = 4e-3;
    EXPECT_NE(tests::errorOf([&] { importLabels(folder / "seg.dcm", options); }).find("which is no multiple of it"),
              std::string::npos);
    s.inside = [](int, int, int, int k) { return k == 0 || k > 2 ? 1 : 0; };
    EXPECT_EQ(importLabels(write(s)).image.size.z, 5) << "two frames side by side say it";
}

// Eight pixels to a byte, the first in the lowest bit; each frame begins with a byte of its own.
std::vector<Uint8> packedBits(const std::vector<int>& pixels)
{
    std::vector<Uint8> bytes((pixels.size() + 7) / 8, 0);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
        bytes[i / 8] = static_cast<Uint8>(bytes[i / 8] | (pixels[i] << (i % 8)));
    }
    return bytes;
}

// One segment of literal runs, or of runs of one byte each repeated (PS3.5, G.3).
std::vector<Uint8> rle(const std::vector<int>& pixels)
{
    std::vector<Uint8> frame(64, 0);
    frame[0] = 1;
    frame[4] = 64;
    const std::vector<Uint8> bytes = packedBits(pixels);
    for (std::size_t i = 0; i < bytes.size();) {
        std::size_t same = 1;
        while (i + same < bytes.size() && bytes[i + same] == bytes[i]) {
            ++same;
        }
        frame.push_back(same > 1 ? static_cast<Uint8>(257 - same) : 0);
        frame.push_back(bytes[i]);
        i += same;
    }
    return frame;
}

std::vector<Uint8> deflated(const std::vector<int>& pixels)
{
    std::vector<Uint8> bytes = packedBits(pixels);
    std::vector<Uint8> out(100);
    z_stream z{};
    deflateInit2(&z, 9, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY);
    z.next_in = bytes.data();
    z.avail_in = static_cast<uInt>(bytes.size());
    z.next_out = out.data();
    z.avail_out = static_cast<uInt>(out.size());
    deflate(&z, Z_FINISH);
    out.erase(out.end() - z.avail_out, out.end());
    deflateEnd(&z);
    return out;
}

// A code stream of pixels of one bit, by way of a file: OpenJPEG writes no memory.
std::vector<Uint8> jpeg2000(const fs::path& file, const std::vector<int>& pixels)
{
    opj_image_cmptparm_t shape{};
    shape.dx = shape.dy = 1;
    shape.w = segColumns;
    shape.h = segRows;
    shape.prec = 1;
    opj_image_t* image = opj_image_create(1, &shape, OPJ_CLRSPC_GRAY);
    image->x1 = segColumns;
    image->y1 = segRows;
    std::copy(pixels.begin(), pixels.end(), image->comps[0].data);
    opj_cparameters_t parameters;
    opj_set_default_encoder_parameters(&parameters);
    parameters.numresolution = 1;
    opj_codec_t* codec = opj_create_compress(OPJ_CODEC_J2K);
    EXPECT_TRUE(opj_setup_encoder(codec, &parameters, image));
    opj_stream_t* stream = opj_stream_create_default_file_stream(file.c_str(), OPJ_FALSE);
    EXPECT_TRUE(opj_start_compress(codec, image, stream) && opj_encode(codec, stream) && opj_end_compress(codec, stream));
    opj_stream_destroy(stream);
    opj_destroy_codec(codec);
    opj_image_destroy(image);
    const std::string bytes = base::contentOf(file).value();
    return {bytes.begin(), bytes.end()};
}

void replaceIn(const fs::path& file, const std::string& from, const std::string& to)
{
    std::string bytes = base::contentOf(file).value();
    ASSERT_EQ(from.size(), to.size());
    ASSERT_NE(bytes.find(from), std::string::npos);
    bytes.replace(bytes.find(from), from.size(), to);
    std::ofstream(file, std::ios::binary) << bytes;
}

// Frames of single bits in RLE, JPEG 2000 and deflate are the same labels as those without compression.
TEST_F(DicomSeg, CompressedFramesOfSingleBitsAreTheSameLabels)
{
    const Segmentation s{"BINARY", 1, 2, 6, [](int segment, int i, int j, int k) {
                             return segment == 1 ? (i * j + k) % 3 == 0 : k == 4 && i >= 2 && j >= 1;
                         }};
    const ImportedLabels plain = importLabels(write(s));
    const Pack j2k = [&](const std::vector<int>& pixels) { return jpeg2000(folder / "frame.j2k", pixels); };
    const std::pair<E_TransferSyntax, Pack> kinds[] = {{EXS_RLELossless, rle}, {EXS_JPEG2000LosslessOnly, j2k}};
    for (const auto& [syntax, pack] : kinds) {
        const ImportedLabels labels = importLabels(write(s, syntax, pack));
        EXPECT_EQ(labels.image.values, plain.image.values) << syntax;
        EXPECT_EQ(labels.names.size(), 2U);
    }
    write(s, EXS_JPEGProcess1, deflated);
    EXPECT_NE(reason().find("(1.2.840.10008.1.2.4.50), which is not read: decompress it"), std::string::npos) << reason();
    const std::string deflatedFrames = std::string("1.2.840.10008.1.2.8.1") + '\0';
    replaceIn(folder / "seg.dcm", "1.2.840.10008.1.2.4.50", deflatedFrames);
    EXPECT_EQ(importLabels(folder / "seg.dcm").image.values, plain.image.values);
}

TEST_F(DicomSeg, DamagedFramesAndUnknownTransferSyntaxesAreRefusedByName)
{
    const Segmentation s{"BINARY", 1, 1, 2, [](int, int i, int j, int k) { return (i + j + k) % 2; }};
    write(s, EXS_RLELossless, [](const std::vector<int>& pixels) {
        std::vector<Uint8> frame = rle(pixels);
        frame.resize(66);
        return frame;
    });
    EXPECT_NE(reason().find("frame 1 has 4 bytes of pixels of one bit, but needs 5"), std::string::npos) << reason();
    write(s, EXS_JPEGProcess1, deflated);
    replaceIn(folder / "seg.dcm", "1.2.840.10008.1.2.4.50", std::string("1.2.840.10008.1.2.4.201").substr(0, 22));
    EXPECT_NE(reason().find("1.2.840.10008.1.2.4.20 is not read: decompress it"), std::string::npos) << reason();
}

}  // namespace
}  // namespace palpate::volume
