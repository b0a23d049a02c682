#include <volume/import/dicom_file.h>
#include <volume/import/dicom_load.h>

#include <base/inputs.h>

#include <dcmtk/dcmdata/dcistrmb.h>
#include <zlib.h>

#include <algorithm>
#include <map>

namespace palpate::volume {

namespace {

// The names of what DCMTK of Debian 12 does not know (PS3.6, table A-1).
std::string nameOf(const std::string& uid)
{
    static const std::map<std::string, std::string> names = {
        {"1.2.840.10008.1.2.4.110", "JPEG XL, lossless"},
        {"1.2.840.10008.1.2.4.111", "JPEG XL, JPEG recompression"},
        {"1.2.840.10008.1.2.4.112", "JPEG XL"},
        {"1.2.840.10008.1.2.4.201", "High-Throughput JPEG 2000, lossless"},
        {"1.2.840.10008.1.2.4.202", "High-Throughput JPEG 2000, RPCL"},
        {"1.2.840.10008.1.2.4.203", "High-Throughput JPEG 2000"},
        {"1.2.840.10008.1.2.1.98", "encapsulated uncompressed"}};
    const auto found = names.find(uid);
    return found == names.end() ? "" : " (" + found->second + ")";
}

// DCMTK reads the file when it takes it for JPEG: frames are bytes to it in both.
OFCondition loadAsJpeg(const std::filesystem::path& file, DcmFileFormat& format)
{
    constexpr std::size_t metaBytes = 4096;
    std::string bytes = base::contentOf(file).value_or("");
    const std::string own = std::string(deflatedFrames) + '\0';  // padded to an even length
    const std::string other = UID_JPEGProcess1TransferSyntax;
    const auto at = bytes.substr(0, metaBytes).find(own);
    if (at == std::string::npos || own.size() != other.size()) {
        return EC_UnsupportedEncoding;
    }
    bytes.replace(at, own.size(), other);
    DcmInputBufferStream stream;
    stream.setBuffer(bytes.data(), static_cast<offile_off_t>(bytes.size()));
    stream.setEos();
    format.transferInit();
    const OFCondition status = format.read(stream);
    format.transferEnd();
    return status.good() ? format.loadAllDataIntoMemory() : status;
}

}  // namespace

std::string transferSyntaxOf(const std::filesystem::path& file)
{
    DcmMetaInfo meta;
    OFString uid;
    if (meta.loadFile(file.c_str()).good()) {
        meta.findAndGetOFString(DCM_TransferSyntaxUID, uid);
    }
    return trimmedText(uid.c_str());
}

void loadDicom(const std::filesystem::path& file, DcmFileFormat& format)
{
    const std::string uid = transferSyntaxOf(file);
    if (uid == deflatedFrames) {
        refuseIf(loadAsJpeg(file, format).bad(), file,
                 "its DICOM with deflated frames cannot be read: get the file again, or decompress it");
        return;
    }
    refuseIf(!uid.empty() && DcmXfer(uid.c_str()).getXfer() == EXS_Unknown, file,
             "its transfer syntax {}{} is not read: decompress it", uid, nameOf(uid));
    const OFCondition status = format.loadFile(file.c_str());
    refuseIf(status.bad(), file, "its DICOM cannot be read ({}): get the file again", trimmedText(status.text()));
}

std::vector<std::byte> unpackedRle(std::span<const std::byte> frame, std::size_t wanted)
{
    constexpr std::size_t headerBytes = 64;
    std::vector<std::byte> out;
    std::size_t at = headerBytes;
    while (at + 1 < frame.size() && out.size() < wanted) {
        const int code = std::to_integer<signed char>(frame[at++]);
        const auto count = std::min(wanted - out.size(), static_cast<std::size_t>(code >= 0 ? code + 1 : 1 - code));
        if (code >= 0) {
            const std::size_t there = std::min(count, frame.size() - at);
            out.insert(out.end(), frame.begin() + static_cast<std::ptrdiff_t>(at),
                       frame.begin() + static_cast<std::ptrdiff_t>(at + there));
            at += there;
        } else if (code != -128) {
            out.insert(out.end(), count, frame[at++]);
        }
    }
    return out;
}

std::vector<std::byte> inflated(std::span<const std::byte> frame, std::size_t wanted)
{
    z_stream z{};
    if (inflateInit2(&z, -MAX_WBITS) != Z_OK) {
        return {};
    }
    std::vector<std::byte> out(wanted);
    z.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(frame.data()));
    z.avail_in = static_cast<uInt>(frame.size());
    z.next_out = reinterpret_cast<Bytef*>(out.data());
    z.avail_out = static_cast<uInt>(wanted);
    inflate(&z, Z_FINISH);
    out.resize(wanted - z.avail_out);
    inflateEnd(&z);
    return out;
}

}  // namespace palpate::volume
