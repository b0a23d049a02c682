#include <volume/import_source.h>
#include <volume/unpack.h>

#include <cmath>
#include <fstream>
#include <map>
#include <sstream>

namespace palpate::volume {

namespace {

using Fields = std::map<std::string, std::string>;

std::string trimmed(const std::string& text)
{
    const auto first = text.find_first_not_of(" \t\r");
    return first == std::string::npos ? "" : text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

// Reads "Key = value" lines up to ElementDataFile, the last one; `end` is where the bytes behind it begin.
Fields readFields(const std::filesystem::path& file, std::uint64_t& end)
{
    std::ifstream in(file, std::ios::binary);
    Fields fields;
    std::string line;
    while (fields.count("ElementDataFile") == 0 && fields.size() < 1000 && std::getline(in, line)) {
        end += line.size() + 1;
        const auto equals = line.find('=');
        if (equals == std::string::npos || line.size() > 10000) {
            break;
        }
        fields[trimmed(line.substr(0, equals))] = trimmed(line.substr(equals + 1));
    }
    if (fields.count("ElementDataFile") == 0 || fields.count("DimSize") == 0 || fields.count("ElementType") == 0) {
        refuse(file, "is not a MetaImage: DimSize, ElementType or ElementDataFile is missing from its header");
    }
    return fields;
}

bool isTrue(const Fields& fields, const std::string& key)
{
    const auto found = fields.find(key);
    return found != fields.end() && !found->second.empty() &&
           std::string("Tt1").find(found->second[0]) != std::string::npos;
}

std::optional<std::int64_t> integer(const Fields& fields, const std::string& key)
{
    const auto found = fields.find(key);
    std::int64_t value = 0;
    if (found == fields.end() || !(std::istringstream(found->second) >> value)) {
        return std::nullopt;
    }
    return value;
}

Component componentNamed(const std::filesystem::path& file, const std::string& type)
{
    static const std::map<std::string, Component> types = {
        {"MET_UCHAR", Component::u8},       {"MET_CHAR", Component::i8},       {"MET_USHORT", Component::u16},
        {"MET_SHORT", Component::i16},      {"MET_UINT", Component::u32},      {"MET_INT", Component::i32},
        {"MET_ULONG_LONG", Component::u64}, {"MET_LONG_LONG", Component::i64}, {"MET_FLOAT", Component::f32},
        {"MET_DOUBLE", Component::f64}};
    const auto found = types.find(type);
    if (found == types.end()) {
        refuse(file, fmt::format("ElementType = {}: a label map has one integer per voxel", type));
    }
    return found->second;
}

Index3 sizeOf(const std::filesystem::path& file, const Fields& fields)
{
    std::istringstream in(fields.at("DimSize"));
    std::vector<std::int64_t> sizes;
    for (std::int64_t n = 0; in >> n;) {
        sizes.push_back(n);
    }
    const auto dimensions = integer(fields, "NDims");
    if (dimensions && *dimensions != static_cast<std::int64_t>(sizes.size())) {
        refuse(file, fmt::format("NDims = {} but DimSize = {}: its header contradicts itself", *dimensions,
                                 fields.at("DimSize")));
    }
    return checkedSize(file, sizes);
}

// What is no number here makes ITK write to the terminal.
void checkNumbers(const std::filesystem::path& file, const Fields& fields)
{
    for (const char* key : {"TransformMatrix", "Rotation", "Orientation", "Offset", "Position", "Origin", "ElementSpacing",
                            "ElementSize", "CenterOfRotation"}) {
        const auto found = fields.find(key);
        std::istringstream in(found == fields.end() ? "" : found->second);
        for (double number = 0; in >> std::ws && !in.eof();) {
            if (!(in >> number) || !std::isfinite(number)) {
                refuse(file, fmt::format("{} = {}: is not all numbers", key, found->second));
            }
        }
    }
}

void locateData(const Fields& fields, std::uint64_t headerEnd, Source& source)
{
    const std::string& name = fields.at("ElementDataFile");
    if (name == "LOCAL") {
        source.data = source.header;
        source.offset = headerEnd;
    } else if (name == "LIST" || name.find('%') != std::string::npos) {
        refuse(source.header, "its slices lie in one file each: save it as one file");
    } else {
        source.data = source.header.parent_path() / name;
    }
    if (!std::filesystem::is_regular_file(source.data)) {
        refuse(source.header, fmt::format("its data file {} is not there: put it beside the header", name));
    }
    const auto headerSize = integer(fields, "HeaderSize").value_or(0);
    if (headerSize < -1) {
        refuse(source.header, fmt::format("HeaderSize = {} makes no sense", headerSize));
    }
    source.fromEnd = headerSize == -1;
    source.offset += headerSize > 0 ? static_cast<std::uint64_t>(headerSize) : 0;
}

// VICTRE phantoms come with gzip data and CompressedData = False; other headers count fewer compressed bytes than there
// are.
void judgePacking(const Fields& fields, Source& source)
{
    const bool declared = isTrue(fields, "CompressedData");
    const std::uint64_t stored = unpackedSize(source.data, source.offset, false);
    const bool exact = stored == source.voxels() * bytesOf(source.component);
    source.packed = looksPacked(source.data, source.offset) && (declared || !exact);
    if (source.packed != declared) {
        source.ours = true;
        source.warnings.push_back(fmt::format("its header says CompressedData = {}, but the data are {}: read as they are",
                                              declared ? "True" : "False",
                                              source.packed ? "compressed" : "not compressed"));
    }
    const auto counted = integer(fields, "CompressedDataSize");
    if (declared && counted && static_cast<std::uint64_t>(std::max<std::int64_t>(*counted, 0)) != stored) {
        source.ours = true;
        source.warnings.push_back(fmt::format(
            "its header says CompressedDataSize = {}, but there are {} bytes: read to the end", *counted, stored));
    }
}

}  // namespace

Source readMeta(const std::filesystem::path& file)
{
    std::uint64_t headerEnd = 0;
    const Fields fields = readFields(file, headerEnd);
    Source source;
    source.format = Format::meta;
    source.header = file;
    source.size = sizeOf(file, fields);
    source.component = componentNamed(file, fields.at("ElementType"));
    source.bigEndian = isTrue(fields, "BinaryDataByteOrderMSB") || isTrue(fields, "ElementByteOrderMSB");
    if (integer(fields, "ElementNumberOfChannels").value_or(1) != 1) {
        refuse(file, fmt::format("has {} values per voxel; a label map has one", fields.at("ElementNumberOfChannels")));
    }
    if (fields.count("BinaryData") != 0 && !isTrue(fields, "BinaryData")) {
        refuse(file, "holds its voxels as text: save it as binary");
    }
    if (fields.count("ElementSpacing") == 0 && fields.count("ElementSize") == 0) {
        source.warnings.emplace_back("its header gives no ElementSpacing: voxels of 1 mm are assumed");
    }
    checkNumbers(file, fields);
    locateData(fields, headerEnd, source);
    judgePacking(fields, source);
    return source;
}

}  // namespace palpate::volume
