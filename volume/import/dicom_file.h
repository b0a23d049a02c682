#pragma once

#include <volume/import/dicom.h>

#include <memory>

// Inside volume/import/ only: DCMTK is hidden behind these.
namespace palpate::volume {

/// Slices and pixels that are nearer to each other are at the same place [m].
inline constexpr double samePlace = 1e-5;

/// One image of a DICOM file. Patient frame LPS [m].
struct DicomFrame {
    std::filesystem::path file;
    std::size_t index = 0;      // in its file
    Vec3 position{0.0};         // centre of its first pixel
    Vec3 alongRow{1, 0, 0};     // unit vector from pixel to pixel in a row
    Vec3 alongColumn{0, 1, 0};  // and from row to row
    double rowSpacing = 0;      // between rows [m]
    double columnSpacing = 0;   // between columns [m]
    bool placed = false;        // position, directions and spacing are there
    double slope = 1;
    double intercept = 0;
    std::uint16_t segment = 0;  // of a DICOM SEG
};

/// What a DICOM file says besides its pixels.
struct DicomObject {
    std::filesystem::path file;
    std::string sopClass, instance, series, frame, description, modality, syntax;  // frame: Frame of Reference UID
    bool directory = false;                                                        // a DICOMDIR
    bool pixels = false;                                                           // of whole numbers
    bool bare = false;  // it has rows, but no pixels of any kind: they are lost
    int columns = 0;
    int rows = 0;
    int samples = 1;
    int bitsAllocated = 0;
    int bitsStored = 0;
    int highBit = 0;
    bool isSigned = false;
    std::string rescaleType;
    double thickness = 0;      // [m], 0 where it is not there
    double betweenSlices = 0;  // [m], 0 where it is not there
    std::vector<DicomFrame> frames;

    // A DICOM SEG.
    std::string segmentationType;  // BINARY, FRACTIONAL or LABELMAP; empty for an image
    int maxFractional = 255;
    int padding = -1;  // a value that means background, -1 for none
    std::vector<LabelName> segments;
    std::vector<std::string> madeOf;  // series that it refers to

    std::size_t pixelsPerFrame() const { return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows); }
};

/// Without white space at its end and without control characters.
std::string trimmedText(const char* text);

/// Reads all but the pixels.
DicomObject readDicom(const std::filesystem::path& file);

/// Decodes the frames of one file, one after another, as stored: no slope, sign applied.
class DicomPixels {
public:
    explicit DicomPixels(const DicomObject& object);
    ~DicomPixels();

    /// rows x columns values, x fastest. The span is good until the next call.
    std::span<const std::int32_t> frame(std::size_t index);

private:
    struct Data;
    std::unique_ptr<Data> data_;
};

/// A series or a multi-frame image as one volume.
struct DicomVolume {
    Index3 size{0};
    Affine affine;
    std::vector<float> values;
    bool hounsfield = false;
    std::vector<std::string> warnings;
};

DicomVolume readSeries(const std::filesystem::path& path, const std::vector<DicomObject>& objects, bool sheared,
                       const std::function<void(double)>& progress);

ImportedLabels readSegmentation(const DicomObject& object, const ImportOptions& options);

/// A JPEG 2000 code stream: `columns` x `rows` values. Throws std::runtime_error with a reason.
std::vector<std::int32_t> decodeJpeg2000(std::span<const std::byte> stream, int columns, int rows);

}  // namespace palpate::volume
