#include <volume/import/dicom_file.h>
#include <volume/import/dicom_load.h>

#include <dcmtk/config/osconfig.h>

#include <dcmtk/dcmdata/dctk.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <mutex>

namespace palpate::volume {

namespace {

// DCMTK writes what it finds to the terminal; ours is the one line that is thrown.
void quieten()
{
    static std::once_flag once;
    std::call_once(once, [] { OFLog::configure(OFLogger::OFF_LOG_LEVEL); });
}

std::string text(DcmItem& item, const DcmTagKey& tag)
{
    OFString value;
    item.findAndGetOFString(tag, value);
    return trimmedText(value.c_str());
}

double number(DcmItem& item, const DcmTagKey& tag, double fallback, unsigned long at = 0)
{
    Float64 value = 0;
    return item.findAndGetFloat64(tag, value, at).good() && std::isfinite(value) ? value : fallback;
}

int whole(DcmItem& item, const DcmTagKey& tag, int fallback)
{
    Uint16 value = 0;
    return item.findAndGetUint16(tag, value).good() ? value : fallback;
}

bool vector3(DcmItem& item, const DcmTagKey& tag, unsigned long first, Vec3& out)
{
    Vec3 v(0.0);
    for (int i = 0; i < 3; ++i) {
        v[i] = number(item, tag, std::nan(""), first + static_cast<unsigned long>(i));
    }
    const bool there = std::isfinite(v.x + v.y + v.z);
    out = there ? v : out;
    return there;
}

// Of what gives values their unit a wrong text is not passed over.
double scale(DcmItem& item, const DcmTagKey& tag, double fallback, const DicomObject& object)
{
    const std::string said = text(item, tag);
    const double value = said.empty() ? fallback : number(item, tag, std::nan(""));
    refuseIf(!std::isfinite(value), object.file,
             "its rescale slope or intercept is '{}', which is no number: get the file again", said.substr(0, 30));
    return value;
}

// What one place of the file says about where frames are; later places say more. The parts that are there so far.
struct Placing {
    DicomFrame frame;
    bool position = false;
    bool directions = false;
    bool spacing = false;
};

void readPlace(DcmItem& item, Placing& place, DicomObject& object)
{
    DicomFrame& frame = place.frame;
    if (vector3(item, DCM_ImagePositionPatient, 0, frame.position)) {
        frame.position *= 1e-3;
        place.position = true;
    }
    if (vector3(item, DCM_ImageOrientationPatient, 0, frame.alongRow) &&
        vector3(item, DCM_ImageOrientationPatient, 3, frame.alongColumn)) {
        place.directions = true;
    }
    const double rows = number(item, DCM_PixelSpacing, 0, 0);
    const double columns = number(item, DCM_PixelSpacing, 0, 1);
    if (rows > 0 && columns > 0) {
        frame.rowSpacing = 1e-3 * rows;
        frame.columnSpacing = 1e-3 * columns;
        place.spacing = true;
    }
    object.thickness = number(item, DCM_SliceThickness, 1e3 * object.thickness) * 1e-3;
    object.betweenSlices = number(item, DCM_SpacingBetweenSlices, 1e3 * object.betweenSlices) * 1e-3;
    frame.slope = scale(item, DCM_RescaleSlope, frame.slope, object);
    frame.intercept = scale(item, DCM_RescaleIntercept, frame.intercept, object);
    if (object.rescaleType.empty()) {
        object.rescaleType = text(item, DCM_RescaleType);
    }
}

// One item of the shared or per-frame functional groups.
void readGroups(DcmItem& groups, Placing& place, DicomObject& object)
{
    for (const DcmTagKey& tag : {DCM_PixelMeasuresSequence, DCM_PlaneOrientationSequence, DCM_PlanePositionSequence,
                                 DCM_PixelValueTransformationSequence}) {
        DcmItem* item = nullptr;
        if (groups.findAndGetSequenceItem(tag, item, 0).good() && item != nullptr) {
            readPlace(*item, place, object);
        }
    }
    DcmItem* segment = nullptr;
    if (groups.findAndGetSequenceItem(DCM_SegmentIdentificationSequence, segment, 0).good() && segment != nullptr) {
        place.frame.segment = static_cast<std::uint16_t>(whole(*segment, DCM_ReferencedSegmentNumber, 0));
    }
}

void addFrame(Placing place, DicomObject& object)
{
    DicomFrame& frame = place.frame;
    const double a = glm::length(frame.alongRow);
    const double b = glm::length(frame.alongColumn);
    frame.placed = place.position && place.directions && place.spacing;
    refuseIf(frame.placed && (!(std::abs(a - 1) < 0.01) || !(std::abs(b - 1) < 0.01) ||
                              !(std::abs(glm::dot(frame.alongRow, frame.alongColumn)) < 0.01)),
             object.file, "its ImageOrientationPatient is not two unit vectors at a right angle: get the file again");
    frame.alongRow /= a > 0 ? a : 1;
    frame.alongColumn /= b > 0 ? b : 1;
    frame.file = object.file;
    frame.index = object.frames.size();
    object.frames.push_back(std::move(frame));
}

void readFrames(DcmDataset& data, DicomObject& object)
{
    Placing common;
    readPlace(data, common, object);
    DcmItem* shared = nullptr;
    if (data.findAndGetSequenceItem(DCM_SharedFunctionalGroupsSequence, shared, 0).good() && shared != nullptr) {
        readGroups(*shared, common, object);
    }
    Sint32 frames = 1;
    if (data.findAndGetSint32(DCM_NumberOfFrames, frames).bad()) {
        frames = 1;
    }
    DcmSequenceOfItems* each = nullptr;
    data.findAndGetSequence(DCM_PerFrameFunctionalGroupsSequence, each);
    const auto described = each == nullptr ? 0 : static_cast<Sint32>(each->card());
    refuseIf(frames < 1 || (described != 0 && described != frames) || (described == 0 && frames > 1), object.file,
             "has {} frames, but says of {} where they are: export it again, or as one file per slice", frames, described);
    if (described == 0) {
        addFrame(common, object);
        return;
    }
    for (DcmObject* item = each->nextInContainer(nullptr); item != nullptr; item = each->nextInContainer(item)) {
        Placing place = common;
        readGroups(dynamic_cast<DcmItem&>(*item), place, object);
        addFrame(std::move(place), object);
    }
}

DcmItem* firstItem(DcmItem* parent, const DcmTagKey& tag)
{
    DcmItem* item = nullptr;
    return parent != nullptr && parent->findAndGetSequenceItem(tag, item, 0).good() ? item : nullptr;
}

// scheme^value^meaning of a code, "^^" where there is none; ~, ^ and | part the entries of a terminology.
std::string codeText(DcmItem* code)
{
    const auto part = [&](const DcmTagKey& tag) {
        std::string out = code == nullptr ? "" : text(*code, tag);
        std::replace_if(
            out.begin(), out.end(), [](char c) { return c == '~' || c == '^' || c == '|'; }, ' ');
        return out;
    };
    return fmt::format("{}^{}^{}", part(DCM_CodingSchemeDesignator), part(DCM_CodeValue), part(DCM_CodeMeaning));
}

// As 3D Slicer writes it: context, category, type, its modifier, context, region, its modifier.
std::string terminologyOf(DcmItem& segment)
{
    DcmItem* type = firstItem(&segment, DCM_SegmentedPropertyTypeCodeSequence);
    DcmItem* region = firstItem(&segment, DCM_AnatomicRegionSequence);
    if (type == nullptr) {
        return "";
    }
    return fmt::format(
        "Segmentation category and type - DICOM master list~{}~{}~{}~Anatomic codes - DICOM master list~{}~{}",
        codeText(firstItem(&segment, DCM_SegmentedPropertyCategoryCodeSequence)), codeText(type),
        codeText(firstItem(type, DCM_SegmentedPropertyTypeModifierCodeSequence)), codeText(region),
        codeText(firstItem(region, DCM_AnatomicRegionModifierSequence)));
}

// CIELab of the white point D50, as DICOM writes it (PS3.3 C.10.7.1.1), to sRGB.
std::array<std::uint8_t, 3> rgb(double l, double a, double b)
{
    const double y = (l / 65535.0 * 100.0 + 16.0) / 116.0;
    const double x = y + (a / 65535.0 * 255.0 - 128.0) / 500.0;
    const double z = y - (b / 65535.0 * 255.0 - 128.0) / 200.0;
    const auto cube = [](double t) {
        return t > 6.0 / 29.0 ? t * t * t : 3 * (6.0 / 29.0) * (6.0 / 29.0) * (t - 4.0 / 29.0);
    };
    const Vec3 xyz(0.9642 * cube(x), cube(y), 0.8249 * cube(z));
    // Bradford's adaptation from D50 to D65 and the primaries of sRGB in one (B. Lindbloom, brucelindbloom.com).
    const Mat3 linear(3.1338561, -0.9787684, 0.0719453, -1.6168667, 1.9161415, -0.2289914, -0.4906146, 0.0334540,
                      1.4052427);
    const Vec3 light = linear * xyz;
    std::array<std::uint8_t, 3> out{};
    for (int i = 0; i < 3; ++i) {
        const double v = std::clamp(light[i], 0.0, 1.0);
        const double encoded = v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
        out[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(std::lround(255 * encoded));
    }
    return out;
}

// The series that a segmentation was made of.
std::vector<std::string> referencedSeries(DcmDataset& data)
{
    std::vector<std::string> out;
    DcmSequenceOfItems* sequence = nullptr;
    if (data.findAndGetSequence(DCM_ReferencedSeriesSequence, sequence).bad() || sequence == nullptr) {
        return out;
    }
    for (DcmObject* entry = sequence->nextInContainer(nullptr); entry != nullptr;
         entry = sequence->nextInContainer(entry)) {
        out.push_back(text(dynamic_cast<DcmItem&>(*entry), DCM_SeriesInstanceUID));
    }
    return out;
}

void readSegments(DcmDataset& data, DicomObject& object)
{
    object.madeOf = referencedSeries(data);
    object.segmentationType = text(data, DCM_SegmentationType);
    object.maxFractional = whole(data, DCM_MaximumFractionalValue, 255);
    object.padding = whole(data, DCM_PixelPaddingValue, -1);
    DcmSequenceOfItems* sequence = nullptr;
    refuseIf(data.findAndGetSequence(DCM_SegmentSequence, sequence).bad() || sequence == nullptr, object.file,
             "is a DICOM SEG without a list of segments: export it again");
    for (DcmObject* entry = sequence->nextInContainer(nullptr); entry != nullptr;
         entry = sequence->nextInContainer(entry)) {
        auto& item = dynamic_cast<DcmItem&>(*entry);
        LabelName name;
        name.value = static_cast<std::uint16_t>(whole(item, DCM_SegmentNumber, 0));
        name.name = text(item, DCM_SegmentLabel);
        name.terminology = terminologyOf(item);
        Uint16 lab[3] = {0, 0, 0};
        bool coloured = true;
        for (unsigned long i = 0; i < 3; ++i) {
            coloured = item.findAndGetUint16(DCM_RecommendedDisplayCIELabValue, lab[i], i).good() && coloured;
        }
        if (coloured) {
            name.colour = rgb(lab[0], lab[1], lab[2]);
        }
        object.segments.push_back(std::move(name));
    }
}

void checkPixelFormat(DicomObject& object)
{
    const bool known = object.bitsAllocated == 1 || object.bitsAllocated == 8 || object.bitsAllocated == 16;
    refuseIf(object.columns < 1 || object.rows < 1 || object.columns > 8192 || object.rows > 8192, object.file,
             "its slices are {} x {} pixels: each side must be 1 to 8192, export it again", object.columns, object.rows);
    refuseIf(!known || object.bitsStored < 1 || object.bitsStored > object.bitsAllocated ||
                 object.highBit + 1 < object.bitsStored || object.highBit >= object.bitsAllocated,
             object.file, "its pixels have {} bits, of which {} are used: only 1, 8 and 16 are read, export it again",
             object.bitsAllocated, object.bitsStored);
    refuseIf(object.samples != 1, object.file,
             "has {} values per pixel, so it is a picture in colours: give the original series", object.samples);
}

}  // namespace

std::string trimmedText(const char* text)
{
    std::string out = text == nullptr ? "" : text;
    out.erase(out.find_last_not_of(std::string(" \0", 2)) + 1);
    std::replace_if(
        out.begin(), out.end(), [](unsigned char c) { return c < 32; }, ' ');
    return out;
}

DicomObject readDicom(const std::filesystem::path& file)
{
    quieten();
    DcmFileFormat format;
    loadDicom(file, format);
    DcmDataset& data = *format.getDataset();
    data.convertToUTF8();
    DicomObject object;
    object.file = file;
    object.sopClass = text(data, DCM_SOPClassUID);
    object.instance = text(data, DCM_SOPInstanceUID);
    object.series = text(data, DCM_SeriesInstanceUID);
    object.frame = text(data, DCM_FrameOfReferenceUID);
    object.description = text(data, DCM_SeriesDescription);
    object.modality = text(data, DCM_Modality);
    const std::string syntax = transferSyntaxOf(file);
    object.syntax = syntax.empty() ? DcmXfer(data.getOriginalXfer()).getXferID() : syntax;
    object.directory = data.tagExists(DCM_DirectoryRecordSequence);
    object.pixels = data.tagExists(DCM_PixelData);
    object.bare = data.tagExists(DCM_Rows) && !object.pixels && !data.tagExists(DCM_FloatPixelData) &&
                  !data.tagExists(DCM_DoubleFloatPixelData);
    if (!object.pixels) {
        return object;
    }
    object.columns = whole(data, DCM_Columns, 0);
    object.rows = whole(data, DCM_Rows, 0);
    object.samples = whole(data, DCM_SamplesPerPixel, 1);
    object.bitsAllocated = whole(data, DCM_BitsAllocated, 0);
    object.bitsStored = whole(data, DCM_BitsStored, object.bitsAllocated);
    object.highBit = whole(data, DCM_HighBit, object.bitsStored - 1);
    object.isSigned = whole(data, DCM_PixelRepresentation, 0) == 1;
    checkPixelFormat(object);
    refuseIf(firstItem(&data, DCM_ModalityLUTSequence) != nullptr, file,
             "has a Modality LUT, a table of values, which is not read: export it with rescale slope and intercept");
    readFrames(data, object);
    if (object.modality == "SEG" || data.tagExists(DCM_SegmentSequence)) {
        readSegments(data, object);
    }
    return object;
}

}  // namespace palpate::volume
