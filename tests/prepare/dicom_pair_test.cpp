// Labels and image of one patient as DICOM: which series of a folder is which, and whether both are in one frame.
#include <datasets/tables.h>
#include <tests/error_of.h>
#include <tests/folder.h>
#include <volume/prepare/volume_import.h>
#include <volume/provenance.h>

#include <dcmtk/config/osconfig.h>

#include <dcmtk/dcmdata/dctk.h>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>

namespace palpate::prepare {
namespace {

namespace fs = std::filesystem;

class DicomPair : public ::testing::Test {
protected:
    // Two slices of 2 x 2 voxels of 1 mm, all of one value.
    void write(const fs::path& to, const char* series, const char* frame, Uint16 value) const
    {
        fs::create_directories(to);
        for (int k = 0; k < 2; ++k) {
            DcmFileFormat file;
            DcmDataset& data = *file.getDataset();
            const std::string instance = fmt::format("{}.{}", series, k), place = fmt::format("0\\0\\{}", k);
            const std::pair<DcmTagKey, const char*> texts[] = {{DCM_SOPClassUID, UID_CTImageStorage},
                                                               {DCM_SOPInstanceUID, instance.c_str()},
                                                               {DCM_SeriesInstanceUID, series},
                                                               {DCM_FrameOfReferenceUID, frame},
                                                               {DCM_Modality, "CT"},
                                                               {DCM_PhotometricInterpretation, "MONOCHROME2"},
                                                               {DCM_PixelSpacing, "1\\1"},
                                                               {DCM_SliceThickness, "1"},
                                                               {DCM_ImagePositionPatient, place.c_str()},
                                                               {DCM_ImageOrientationPatient, "1\\0\\0\\0\\1\\0"}};
            for (const auto& [tag, text] : texts) {
                data.putAndInsertString(tag, text);
            }
            const std::pair<DcmTagKey, Uint16> numbers[] = {{DCM_Rows, 2},           {DCM_Columns, 2},
                                                            {DCM_BitsAllocated, 16}, {DCM_BitsStored, 16},
                                                            {DCM_HighBit, 15},       {DCM_PixelRepresentation, 0},
                                                            {DCM_SamplesPerPixel, 1}};
            for (const auto& [tag, number] : numbers) {
                data.putAndInsertUint16(tag, number);
            }
            const std::vector<Uint16> pixels(4, value);
            data.putAndInsertUint16Array(DCM_PixelData, pixels.data(), pixels.size());
            ASSERT_TRUE(file.saveFile((to / instance).c_str(), EXS_LittleEndianExplicit).good());
        }
    }

    ImportRequest request() const
    {
        ImportRequest o;
        o.input = folder / "labels";
        o.image = folder / "image";
        o.reading.dicomLabels = true;
        o.mapping.defaultTissue = "fat";
        return o;
    }

    static ImportedVolume made(const ImportRequest& o)
    {
        return importVolume(o, datasets::defaultTissues(), [](const std::string&, std::optional<double>) {});
    }

    static std::string reason(const ImportRequest& o)
    {
        return tests::errorOf([&] { made(o); });
    }

    static float valueOf(const ImportRequest& o) { return made(o).tissue.companion()->values.at(0); }

    static bool warns(const ImportRequest& o, const std::string& words)
    {
        return std::ranges::any_of(made(o).tissue.provenance(), [&](const auto& entry) {
            return entry.first == volume::warningKey && entry.second.find(words) != std::string::npos;
        });
    }

    const tests::Folder folder;
};

TEST_F(DicomPair, TheImageHasASeriesOfItsOwn)
{
    write(folder / "labels", "1.1", "7.1", 1);
    write(folder / "labels", "1.2", "7.1", 2);
    write(folder / "image", "2.1", "7.1", 30);
    write(folder / "image", "2.2", "7.1", 40);
    ImportRequest o = request();
    EXPECT_NE(reason(o).find("labels: holds 2 series: say which with --series"), std::string::npos) << reason(o);
    o.reading.series = "1.1";
    EXPECT_NE(reason(o).find("image: holds 2 series: say which with --image-series"), std::string::npos) << reason(o);
    o.imageSeries = "2.2";
    EXPECT_EQ(valueOf(o), 40.0F);
    o.input = folder / "labels/1.1.0";
    o.reading.series = "1.1";
    EXPECT_NE(reason(o).find("--series: the labels are one file"), std::string::npos) << reason(o);
    o.reading.series = "";
    EXPECT_EQ(valueOf(o), 40.0F);
    o.reading.series = std::exchange(o.imageSeries, "");
    EXPECT_EQ(valueOf(o), 40.0F) << "--series is for the image where the labels are one file";
    o.imageSeries = o.reading.series;
    o.reading.series = "";
    o.image = folder / "image/2.2.0";
    EXPECT_NE(reason(o).find("the image is no folder of DICOM"), std::string::npos) << reason(o);
    o.image = "";
    EXPECT_NE(reason(o).find("--image-series: needs the image"), std::string::npos) << reason(o);
}

TEST_F(DicomPair, TwoFramesOfReferenceAreOneForWhoSaysSo)
{
    write(folder / "labels", "1.1", "7.1", 1);
    write(folder / "image", "2.1", "7.2", 30);
    ImportRequest o = request();
    EXPECT_NE(reason(o).find("frame of reference (7.2) is not that of labels (7.1)"), std::string::npos) << reason(o);
    o.ignoreFrame = true;
    EXPECT_EQ(valueOf(o), 30.0F);
    EXPECT_TRUE(warns(o, "(7.1 and 7.2)"));
    write(folder / "image", "2.1", "7.1", 30);
    EXPECT_TRUE(warns(o, "--ignore-frame-of-reference decides nothing"));
    o.ignoreFrame = false;
    EXPECT_EQ(reason(o), "");
    write(folder / "image", "2.1", "", 30);
    EXPECT_EQ(reason(o), "") << "a file that does not say it contradicts nothing";
}

}  // namespace
}  // namespace palpate::prepare
