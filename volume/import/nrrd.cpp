#include <volume/import/header_text.h>
#include <volume/import/nrrd.h>

#include <cmath>
#include <fstream>

namespace palpate::volume {

namespace {

NrrdHeader readNrrdHeader(const std::filesystem::path& file)
{
    constexpr std::uint64_t longest = std::uint64_t{16} << 20;
    std::ifstream in(file, std::ios::binary);
    NrrdHeader header;
    header.file = file;
    std::string line;
    std::getline(in, line);
    if (line.rfind("NRRD000", 0) != 0) {
        refuse(file, "is not a NRRD file, it does not begin with NRRD000: save it again");
    }
    header.end = line.size() + 1;
    bool open = true;
    while (open && std::getline(in, line) && header.end < longest) {
        header.end += line.size() + 1;
        const std::string text = trimmed(line);
        open = !text.empty();
        const auto pair = text.find(":=");
        const auto colon = text.find(": ");
        if (text.empty() || text[0] == '#') {
            continue;
        }
        if (pair != std::string::npos && (colon == std::string::npos || pair < colon)) {
            header.pairs[text.substr(0, pair)] = text.substr(pair + 2);
        } else if (colon != std::string::npos) {
            const std::string name = lowerCase(text.substr(0, colon));
            if (!header.fields.emplace(name, trimmed(text.substr(colon + 2))).second) {
                refuse(file, fmt::format("its header gives '{}' twice: save it again", name));
            }
        }
        // Data files can be listed behind this field; none of that is read.
        open = open && !(header.field("data file", header.field("datafile")).rfind("LIST", 0) == 0);
    }
    return header;
}

Component nrrdComponent(const std::filesystem::path& file, const std::string& type)
{
    static const std::map<std::string, Component> types = {{"signed char", Component::i8},
                                                           {"int8", Component::i8},
                                                           {"int8_t", Component::i8},
                                                           {"uchar", Component::u8},
                                                           {"unsigned char", Component::u8},
                                                           {"uint8", Component::u8},
                                                           {"uint8_t", Component::u8},
                                                           {"short", Component::i16},
                                                           {"short int", Component::i16},
                                                           {"signed short", Component::i16},
                                                           {"signed short int", Component::i16},
                                                           {"int16", Component::i16},
                                                           {"int16_t", Component::i16},
                                                           {"ushort", Component::u16},
                                                           {"unsigned short", Component::u16},
                                                           {"unsigned short int", Component::u16},
                                                           {"uint16", Component::u16},
                                                           {"uint16_t", Component::u16},
                                                           {"int", Component::i32},
                                                           {"signed int", Component::i32},
                                                           {"int32", Component::i32},
                                                           {"int32_t", Component::i32},
                                                           {"uint", Component::u32},
                                                           {"unsigned int", Component::u32},
                                                           {"uint32", Component::u32},
                                                           {"uint32_t", Component::u32},
                                                           {"longlong", Component::i64},
                                                           {"long long", Component::i64},
                                                           {"long long int", Component::i64},
                                                           {"signed long long", Component::i64},
                                                           {"signed long long int", Component::i64},
                                                           {"int64", Component::i64},
                                                           {"int64_t", Component::i64},
                                                           {"ulonglong", Component::u64},
                                                           {"unsigned long long", Component::u64},
                                                           {"unsigned long long int", Component::u64},
                                                           {"uint64", Component::u64},
                                                           {"uint64_t", Component::u64},
                                                           {"float", Component::f32},
                                                           {"double", Component::f64}};
    const auto found = types.find(lowerCase(type));
    if (found == types.end()) {
        refuse(file, fmt::format("type: '{}' is not read: save it with whole or floating-point numbers", type));
    }
    return found->second;
}

Encoding encodingNamed(const std::filesystem::path& file, const std::string& name)
{
    static const std::map<std::string, Encoding> encodings = {
        {"raw", Encoding::raw},     {"gzip", Encoding::deflate}, {"gz", Encoding::deflate},
        {"bzip2", Encoding::bzip2}, {"bz2", Encoding::bzip2},    {"ascii", Encoding::text},
        {"text", Encoding::text},   {"txt", Encoding::text},     {"hex", Encoding::hex}};
    const auto found = encodings.find(lowerCase(name));
    if (found == encodings.end()) {
        refuse(file, fmt::format("encoding: '{}' is not read: save it with raw or gzip encoding", name));
    }
    return found->second;
}

// Skips text lines in front of the data.
std::uint64_t skipLines(const std::filesystem::path& file, std::uint64_t offset, std::int64_t lines)
{
    std::ifstream in(file, std::ios::binary);
    in.seekg(static_cast<std::streamoff>(offset));
    std::string line;
    for (std::int64_t i = 0; i < lines && std::getline(in, line); ++i) {
        offset += line.size() + 1;
    }
    return offset;
}

void locateData(const NrrdHeader& header, Source& source)
{
    const std::string name = header.field("data file", header.field("datafile"));
    if (name.rfind("LIST", 0) == 0 || name.find('%') != std::string::npos) {
        refuse(source.header, "its slices lie in one file each: save it as one file");
    }
    source.data = name.empty() ? source.header : besides(source.header, name, source.warnings);
    source.offset = name.empty() ? header.end : 0;
    source.encoding = encodingNamed(source.header, header.field("encoding"));
    const std::int64_t lines =
        integer(source.header, "line skip", header.field("line skip", header.field("lineskip", "0")));
    const std::int64_t bytes =
        integer(source.header, "byte skip", header.field("byte skip", header.field("byteskip", "0")));
    if (bytes < -1 || lines < 0) {
        refuse(source.header,
               fmt::format("byte skip: {}, line skip: {}: only -1 or more is allowed, save it again", bytes, lines));
    }
    source.offset = skipLines(source.data, source.offset, lines);
    source.fromEnd = bytes == -1;
    // In packed data the bytes are those of what is unpacked.
    const bool packed = source.encoding == Encoding::deflate || source.encoding == Encoding::bzip2;
    (packed ? source.skip : source.offset) += bytes > 0 ? static_cast<std::uint64_t>(bytes) : 0;
}

// Headers lie about what their data are: the data are believed.
void judgePacking(Source& source)
{
    const auto packed = [](Encoding e) { return e == Encoding::deflate || e == Encoding::bzip2; };
    const Encoding there = looksLike(source.data, source.offset);
    if (source.encoding == there || (!packed(source.encoding) && !packed(there))) {
        return;
    }
    if (packed(source.encoding)) {
        refuse(source.header,
               fmt::format("encoding: {}, but the data are not compressed in that way: its header is wrong, save it again",
                           source.encoding == Encoding::deflate ? "gzip" : "bzip2"));
    }
    const std::uint64_t wanted = source.elements() * bytesOf(source.component);
    if (source.encoding == Encoding::raw && there == Encoding::deflate && source.data.extension() == ".gz") {
        source.encoding = there;
        source.warnings.emplace_back("its header says encoding: raw, but the data are compressed: read as they are");
        return;
    }
    if (source.encoding == Encoding::raw && unpackedSize(source.data, source.offset, Encoding::raw, 0) < wanted) {
        source.encoding = there;
        source.warnings.emplace_back("its header says encoding: raw, but the data are compressed: read as they are");
    }
}

}  // namespace

Source readNrrd(const std::filesystem::path& file)
{
    const NrrdHeader header = readNrrdHeader(file);
    Source source;
    source.header = file;
    source.segments = slicerSegments(header);
    placeNrrd(header, source);
    source.component = nrrdComponent(file, header.field("type"));
    locateData(header, source);
    judgePacking(source);
    const std::string endian = lowerCase(header.field("endian"));
    source.bigEndian = endian == "big";
    if (endian.empty() && bytesOf(source.component) > 1 && source.encoding != Encoding::text) {
        source.warnings.emplace_back("its header does not say endian: little is assumed");
    }
    source.label = !source.segments.empty();
    return source;
}

}  // namespace palpate::volume
