#include <volume/import/dicom_file.h>
#include <volume/import/dicom_load.h>

#include <dcmtk/config/osconfig.h>

#include <dcmtk/dcmdata/dcpixel.h>
#include <dcmtk/dcmdata/dcpixseq.h>
#include <dcmtk/dcmdata/dcpxitem.h>
#include <dcmtk/dcmdata/dcrledrg.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmjpeg/djdecode.h>
#include <dcmtk/dcmjpls/djdecode.h>

#include <algorithm>
#include <cstring>
#include <mutex>
#include <utility>

namespace palpate::volume {

namespace {

void registerCodecs()
{
    static std::once_flag once;
    std::call_once(once, [] {
        DcmRLEDecoderRegistration::registerCodecs();
        DJDecoderRegistration::registerCodecs();
        DJLSDecoderRegistration::registerCodecs();
    });
}

bool isJpeg2000(E_TransferSyntax syntax)
{
    return syntax == EXS_JPEG2000LosslessOnly || syntax == EXS_JPEG2000;
}

}  // namespace

struct DicomPixels::Data {
    const DicomObject& object;
    DcmFileFormat format;
    DcmPixelData* pixels = nullptr;
    DcmPixelSequence* fragments = nullptr;  // where the pixels are compressed
    E_TransferSyntax syntax = EXS_Unknown;
    std::vector<Uint8> buffer;
    std::vector<std::int32_t> values;

    explicit Data(const DicomObject& o) : object(o) {}

    template <typename... Values>
    void failIf(bool wrong, fmt::format_string<Values...> why, Values&&... values) const
    {
        if (wrong) {
            refuse(object.file, "{}: get the file again", fmt::format(why, std::forward<Values>(values)...));
        }
    }

    std::uint64_t frameBits() const { return object.pixelsPerFrame() * static_cast<std::uint64_t>(object.bitsAllocated); }

    void open();
    void checkSize() const;
    std::vector<std::byte> codeStream(std::size_t index) const;
    void checkRle(std::size_t index) const;
    void readPlain(std::size_t index);
    void readBits(std::size_t index);
    void unpackBits(const std::byte* bytes, std::uint64_t first);
    void readCompressedBits(std::size_t index);
    void readDeflated(std::size_t index);
    std::vector<std::int32_t> jpeg2000(std::span<const std::byte> stream) const;
    void normalise();
};

void DicomPixels::Data::open()
{
    registerCodecs();
    loadDicom(object.file, format);
    DcmElement* element = nullptr;
    failIf(format.getDataset()->findAndGetElement(DCM_PixelData, element).bad() ||
               (pixels = dynamic_cast<DcmPixelData*>(element)) == nullptr,
           "it has no pixels");
    const DcmRepresentationParameter* parameter = nullptr;
    pixels->getOriginalRepresentationKey(syntax, parameter);
    failIf(DcmXfer(syntax).isEncapsulated() && pixels->getEncapsulatedRepresentation(syntax, parameter, fragments).bad(),
           "its compressed pixels cannot be found");
    checkSize();
    values.resize(object.pixelsPerFrame());
}

// What the header promises against what is there, before anything is decoded.
void DicomPixels::Data::checkSize() const
{
    if (fragments != nullptr) {
        // The first item is the table of offsets.
        const std::size_t there = fragments->card() > 0 ? fragments->card() - 1 : 0;
        failIf(there < object.frames.size(), "its header promises {} frames, but there are {} compressed ones",
               object.frames.size(), there);
        return;
    }
    const std::uint64_t wanted = (frameBits() * object.frames.size() + 7) / 8;
    const std::uint64_t there = pixels->getLengthField();
    failIf(there < wanted, "its header promises {} x {} x {} pixels of {} bits, {} bytes in all, but there are {}",
           object.columns, object.rows, object.frames.size(), object.bitsAllocated, wanted, there);
}

// The bytes of one compressed frame: one fragment, or all of a single frame's.
std::vector<std::byte> DicomPixels::Data::codeStream(std::size_t index) const
{
    const std::size_t there = fragments->card() - 1;
    const bool single = object.frames.size() == 1;
    failIf(!single && there != object.frames.size(), "its compressed frames are in several pieces each, which is not read");
    std::vector<std::byte> stream;
    for (std::size_t i = single ? 0 : index; i < (single ? there : index + 1); ++i) {
        DcmPixelItem* item = nullptr;
        Uint8* bytes = nullptr;
        failIf(fragments->getItem(item, static_cast<unsigned long>(i + 1)).bad() || item->getUint8Array(bytes).bad() ||
                   bytes == nullptr,
               "its compressed pixels cannot be read");
        const auto* first = reinterpret_cast<const std::byte*>(bytes);
        stream.insert(stream.end(), first, first + item->getLength());
    }
    return stream;
}

// An RLE frame begins with the number of its segments, one for each byte of a pixel, and 15 offsets to them (DICOM PS3.5,
// G.5). DCMTK follows these wherever they lead.
void DicomPixels::Data::checkRle(std::size_t index) const
{
    constexpr std::size_t headerBytes = 64;
    const std::vector<std::byte> stream = codeStream(index);
    const auto number = [&](std::size_t i) {
        std::uint32_t value = 0;
        for (std::size_t k = 4; k-- > 0;) {
            value = value << 8 | std::to_integer<std::uint32_t>(stream[4 * i + k]);
        }
        return value;
    };
    const auto segments = std::max<std::size_t>(1, static_cast<std::size_t>(object.bitsAllocated) / 8);
    bool sound = stream.size() > headerBytes && number(0) == segments && number(1) == headerBytes;
    for (std::size_t i = 2; sound && i <= segments; ++i) {
        sound = number(i) > number(i - 1) && number(i) < stream.size();
    }
    failIf(!sound, "its RLE data are damaged, their segments lie outside of them");
}

void DicomPixels::Data::readPlain(std::size_t index)
{
    if (fragments != nullptr && syntax == EXS_RLELossless) {
        checkRle(index);
    }
    const std::size_t width = static_cast<std::size_t>(object.bitsAllocated) / 8;
    buffer.resize(values.size() * width + values.size() * width % 2);
    Uint32 fragment = 0;
    OFString colours;
    const auto read = pixels->getUncompressedFrame(format.getDataset(), static_cast<Uint32>(index), fragment, buffer.data(),
                                                   static_cast<Uint32>(buffer.size()), colours);
    failIf(read.bad() && fragments != nullptr, "its pixels ({}) cannot be decoded", DcmXfer(syntax).getXferName());
    failIf(read.bad(), "its pixels cannot be read");
    for (std::size_t i = 0; i < values.size(); ++i) {
        Uint16 two = buffer[i * width];
        if (width == 2) {
            std::memcpy(&two, buffer.data() + 2 * i, 2);
        }
        values[i] = two >> (object.highBit + 1 - object.bitsStored);
    }
}

std::vector<std::int32_t> DicomPixels::Data::jpeg2000(std::span<const std::byte> stream) const
{
    try {
        return decodeJpeg2000(stream, object.columns, object.rows);
    } catch (const std::runtime_error& e) {
        refuse(object.file, "{}", e.what());
    }
}

// Pixels of whole bytes in a deflated frame, little endian.
void DicomPixels::Data::readDeflated(std::size_t index)
{
    const std::size_t width = static_cast<std::size_t>(object.bitsAllocated) / 8;
    const std::vector<std::byte> bytes = inflated(codeStream(index), values.size() * width);
    failIf(bytes.size() < values.size() * width, "the deflated data of frame {} are damaged", index + 1);
    for (std::size_t i = 0; i < values.size(); ++i) {
        const auto byte = [&](std::size_t k) { return std::to_integer<std::int32_t>(bytes[i * width + k]); };
        values[i] = (byte(0) | (width == 2 ? byte(1) << 8 : 0)) >> (object.highBit + 1 - object.bitsStored);
    }
}

// Eight pixels to a byte, the first in the lowest bit.
void DicomPixels::Data::unpackBits(const std::byte* bytes, std::uint64_t first)
{
    for (std::size_t i = 0; i < values.size(); ++i) {
        const std::uint64_t bit = first + i;
        values[i] = (std::to_integer<int>(bytes[bit / 8]) >> (bit % 8)) & 1;
    }
}

// A compressed frame of single bits begins with a byte of its own. RLE and deflate hold the bytes of the packed bits, JPEG
// 2000 pixels of one bit (PS3.5, 8.2 and G.2, as CP 2301 and Supplement 244 have it).
void DicomPixels::Data::readCompressedBits(std::size_t index)
{
    const std::vector<std::byte> stream = codeStream(index);
    const std::size_t wanted = (values.size() + 7) / 8;
    std::vector<std::byte> packed;
    if (object.syntax == deflatedFrames) {
        packed = inflated(stream, wanted);
    } else if (syntax == EXS_RLELossless) {
        checkRle(index);
        packed = unpackedRle(stream, wanted);
    } else if (isJpeg2000(syntax)) {
        values = jpeg2000(stream);
        std::transform(values.begin(), values.end(), values.begin(), [](std::int32_t v) { return v != 0 ? 1 : 0; });
        return;
    } else {
        refuse(object.file, "its pixels of one bit are compressed as {} ({}), which is not read: decompress it",
               DcmXfer(syntax).getXferName(), object.syntax);
    }
    failIf(packed.size() < wanted, "frame {} has {} bytes of pixels of one bit, but needs {}", index + 1, packed.size(),
           wanted);
    unpackBits(packed.data(), 0);
}

// Frames of single bits follow each other without a gap.
void DicomPixels::Data::readBits(std::size_t index)
{
    if (fragments != nullptr) {
        readCompressedBits(index);
        return;
    }
    Uint8* bytes = nullptr;
    failIf(pixels->getUint8Array(bytes).bad() || bytes == nullptr, "its pixels cannot be read");
    unpackBits(reinterpret_cast<const std::byte*>(bytes), index * values.size());
}

void DicomPixels::Data::normalise()
{
    const int spare = 32 - object.bitsStored;
    for (std::int32_t& v : values) {
        const std::uint32_t bits = static_cast<std::uint32_t>(v) << spare;
        v = object.isSigned ? static_cast<std::int32_t>(bits) >> spare : static_cast<std::int32_t>(bits >> spare);
    }
}

DicomPixels::DicomPixels(const DicomObject& object) : data_(std::make_unique<Data>(object))
{
    data_->open();
}

DicomPixels::~DicomPixels() = default;

std::span<const std::int32_t> DicomPixels::frame(std::size_t index)
{
    const DicomObject& object = data_->object;
    if (object.bitsAllocated == 1) {
        data_->readBits(index);
        return data_->values;
    }
    if (data_->fragments != nullptr && isJpeg2000(data_->syntax)) {
        data_->values = data_->jpeg2000(data_->codeStream(index));
    } else if (object.syntax == deflatedFrames) {
        data_->readDeflated(index);
    } else {
        data_->readPlain(index);
    }
    data_->normalise();
    return data_->values;
}

}  // namespace palpate::volume
