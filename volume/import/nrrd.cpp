#include <volume/import/header_text.h>
#include <volume/import/nrrd.h>

#include <algorithm>
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
    refuseIf(line.rfind("NRRD000", 0) != 0, file, "is not a NRRD file, it does not begin with NRRD000: save it again");
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
            refuseIf(!header.fields.emplace(name, trimmed(text.substr(colon + 2))).second, file,
                     "its header gives '{}' twice: save it again", name);
        }
        // Data files can be listed behind this field; none of that is read.
        open = open && !(header.field("data file", header.field("datafile")).rfind("LIST", 0) == 0);
    }
    return header;
}

Component nrrdComponent(const std::filesystem::path& file, const std::string& type)
{
    static const std::vector<std::pair<Component, std::vector<std::string>>> types{
        {Component::i8, {"signed char", "int8", "int8_t"}},
        {Component::u8, {"uchar", "unsigned char", "uint8", "uint8_t"}},
        {Component::i16, {"short", "short int", "signed short", "signed short int", "int16", "int16_t"}},
        {Component::u16, {"ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"}},
        {Component::i32, {"int", "signed int", "int32", "int32_t"}},
        {Component::u32, {"uint", "unsigned int", "uint32", "uint32_t"}},
        {Component::i64,
         {"longlong", "long long", "long long int", "signed long long", "signed long long int", "int64", "int64_t"}},
        {Component::u64, {"ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"}},
        {Component::f32, {"float"}},
        {Component::f64, {"double"}}};
    const std::string name = lowerCase(type);
    const auto found = std::ranges::find_if(types, [&](const auto& t) { return std::ranges::count(t.second, name) > 0; });
    refuseIf(found == types.end(), file, "type: '{}' is not read: save it with whole or floating-point numbers", type);
    return found->first;
}

Encoding encodingNamed(const std::filesystem::path& file, const std::string& name)
{
    static const std::map<std::string, Encoding> encodings = {
        {"raw", Encoding::raw},     {"gzip", Encoding::deflate}, {"gz", Encoding::deflate},
        {"bzip2", Encoding::bzip2}, {"bz2", Encoding::bzip2},    {"ascii", Encoding::text},
        {"text", Encoding::text},   {"txt", Encoding::text},     {"hex", Encoding::hex}};
    const auto found = encodings.find(lowerCase(name));
    refuseIf(found == encodings.end(), file, "encoding: '{}' is not read: save it with raw or gzip encoding", name);
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
    refuseIf(name.rfind("LIST", 0) == 0 || name.find('%') != std::string::npos, source.header,
             "its slices lie in one file each: save it as one file");
    source.data = name.empty() ? source.header : besides(source.header, name, source.warnings);
    source.offset = name.empty() ? header.end : 0;
    source.encoding = encodingNamed(source.header, header.field("encoding"));
    const std::int64_t lines =
        integer(source.header, "line skip", header.field("line skip", header.field("lineskip", "0")));
    const std::int64_t bytes =
        integer(source.header, "byte skip", header.field("byte skip", header.field("byteskip", "0")));
    refuseIf(bytes < -1 || lines < 0, source.header,
             "byte skip: {}, line skip: {}: only -1 or more is allowed, save it again", bytes, lines);
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
    refuseIf(packed(source.encoding), source.header,
             "encoding: {}, but the data are not compressed in that way: its header is wrong, save it again",
             source.encoding == Encoding::deflate ? "gzip" : "bzip2");
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
