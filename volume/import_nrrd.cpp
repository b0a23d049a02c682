#include <volume/import_source.h>
#include <volume/unpack.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <sstream>

namespace palpate::volume {

namespace {

struct NrrdHeader {
    std::map<std::string, std::string> fields;  // "field: value"
    std::map<std::string, std::string> pairs;   // "key:=value"
    std::uint64_t end = 0;                      // first byte behind the empty line

    std::string field(const std::string& name, const std::string& fallback = "") const
    {
        const auto found = fields.find(name);
        return found == fields.end() ? fallback : found->second;
    }
};

std::string trimmed(const std::string& text)
{
    const auto first = text.find_first_not_of(" \t\r");
    return first == std::string::npos ? "" : text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

NrrdHeader readHeader(const std::filesystem::path& file)
{
    std::ifstream in(file, std::ios::binary);
    NrrdHeader header;
    std::string line;
    std::getline(in, line);
    if (line.rfind("NRRD000", 0) != 0) {
        refuse(file, "is not a NRRD file: it does not begin with NRRD000");
    }
    header.end = line.size() + 1;
    bool open = true;
    while (open && std::getline(in, line) && header.fields.size() < 1000) {
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
            header.fields[text.substr(0, colon)] = trimmed(text.substr(colon + 2));
        }
    }
    return header;
}

Component componentNamed(const std::filesystem::path& file, const std::string& type)
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
                                                           {"int64", Component::i64},
                                                           {"int64_t", Component::i64},
                                                           {"ulonglong", Component::u64},
                                                           {"unsigned long long", Component::u64},
                                                           {"uint64", Component::u64},
                                                           {"uint64_t", Component::u64},
                                                           {"float", Component::f32},
                                                           {"double", Component::f64}};
    const auto found = types.find(type);
    if (found == types.end()) {
        refuse(file, fmt::format("type: {}: a label map has one integer per voxel", type));
    }
    return found->second;
}

std::int64_t integer(const std::filesystem::path& file, const std::string& name, const std::string& text)
{
    std::istringstream in(text);
    std::int64_t value = 0;
    if (!(in >> value)) {
        refuse(file, fmt::format("{}: {} is not a number", name, text));
    }
    return value;
}

Index3 sizeOf(const std::filesystem::path& file, const NrrdHeader& header)
{
    std::istringstream in(header.field("sizes"));
    std::vector<std::int64_t> sizes;
    for (std::int64_t n = 0; in >> n;) {
        sizes.push_back(n);
    }
    const std::int64_t dimensions = integer(file, "dimension", header.field("dimension"));
    if (dimensions != static_cast<std::int64_t>(sizes.size())) {
        refuse(file, fmt::format("dimension: {} but sizes: {}: its header contradicts itself", dimensions,
                                 header.field("sizes")));
    }
    const std::string kinds = header.field("kinds");
    if (sizes.size() == 4 && kinds.rfind("list", 0) == 0) {
        refuse(file, fmt::format("has {} layers of overlapping segments: export it as a label map, one layer", sizes[0]));
    }
    if (sizes.size() == 3 && !kinds.empty() &&
        (kinds.find("list") != std::string::npos || kinds.find("vector") != std::string::npos ||
         kinds.find("color") != std::string::npos)) {
        refuse(file, fmt::format("kinds: {}: has several values per voxel; a label map has one", kinds));
    }
    return checkedSize(file, sizes);
}

void checkGeometry(const std::filesystem::path& file, const NrrdHeader& header, std::vector<std::string>& warnings)
{
    std::string units = header.field("space units");
    std::erase(units, '"');
    std::istringstream in(units);
    for (std::string unit; in >> unit;) {
        if (unit != "mm" && unit != "millimeter" && unit != "millimeters") {
            refuse(file, fmt::format("space units: {}: only mm is understood", header.field("space units")));
        }
    }
    const std::string space = header.field("space");
    if (space.empty()) {
        warnings.emplace_back("its header names no space: the axes are taken as left, posterior, superior");
    } else if (space != "left-posterior-superior" && space != "LPS" && space != "right-anterior-superior" &&
               space != "RAS" && space != "left-anterior-superior" && space != "LAS") {
        warnings.push_back(
            fmt::format("space: {} is not a patient frame: the axes are taken as left, posterior, superior", space));
    }
    if (header.field("space directions").empty() && header.field("spacings").empty()) {
        warnings.emplace_back("its header gives no spacing: voxels of 1 mm are assumed");
    }
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
    source.data = name.empty() ? source.header : source.header.parent_path() / name;
    source.offset = name.empty() ? header.end : 0;
    if (name.rfind("LIST", 0) == 0 || name.find('%') != std::string::npos) {
        refuse(source.header, "its slices lie in one file each: save it as one file");
    }
    if (!std::filesystem::is_regular_file(source.data)) {
        refuse(source.header, fmt::format("its data file {} is not there: put it beside the header", name));
    }
    const std::string encoding = header.field("encoding");
    source.packed = encoding == "gzip" || encoding == "gz";
    if (!source.packed && encoding != "raw") {
        refuse(source.header, fmt::format("encoding: {} is not read: save it with gzip or raw encoding", encoding));
    }
    const std::int64_t lines =
        integer(source.header, "line skip", header.field("line skip", header.field("lineskip", "0")));
    source.offset = skipLines(source.data, source.offset, lines);
    const std::int64_t bytes =
        integer(source.header, "byte skip", header.field("byte skip", header.field("byteskip", "0")));
    if (bytes < -1 || lines < 0) {
        refuse(source.header, fmt::format("byte skip: {}, line skip: {}: only -1 or more is allowed", bytes, lines));
    }
    source.fromEnd = bytes == -1;
    source.skip = bytes > 0 ? static_cast<std::uint64_t>(bytes) : 0;
    if (source.packed != looksPacked(source.data, source.offset)) {
        if (source.packed) {
            refuse(source.header, "encoding: gzip, but the data are not compressed: its header is wrong, save it again");
        }
        source.packed = unpackedSize(source.data, source.offset, false) < source.voxels() * bytesOf(source.component);
        source.ours = source.packed;
    }
}

// Segment names as 3D Slicer writes them into .seg.nrrd.
std::vector<LabelName> segmentNames(const NrrdHeader& header)
{
    std::vector<LabelName> names;
    for (int i = 0;; ++i) {
        const std::string segment = fmt::format("Segment{}_", i);
        const auto value = header.pairs.find(segment + "LabelValue");
        const auto name = header.pairs.find(segment + "Name");
        if (value == header.pairs.end() || name == header.pairs.end()) {
            return names;
        }
        int label = 0;
        if (std::istringstream(value->second) >> label && label >= 0 && label <= 65535) {
            names.push_back({static_cast<std::uint16_t>(label), name->second, ""});
        }
    }
}

}  // namespace

Source readNrrd(const std::filesystem::path& file)
{
    const NrrdHeader header = readHeader(file);
    Source source;
    source.format = Format::nrrd;
    source.header = file;
    source.size = sizeOf(file, header);
    source.component = componentNamed(file, header.field("type"));
    source.bigEndian = header.field("endian") == "big";
    checkGeometry(file, header, source.warnings);
    locateData(header, source);
    if (source.ours) {
        source.warnings.emplace_back("its header says encoding: raw, but the data are compressed: read as they are");
    }
    source.names = segmentNames(header);
    return source;
}

}  // namespace palpate::volume
