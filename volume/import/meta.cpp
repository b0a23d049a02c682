#include <volume/import/header_text.h>
#include <volume/import/source.h>

#include <algorithm>
#include <fstream>

namespace palpate::volume {

namespace {

using Fields = std::map<std::string, std::string>;

// Reads "Key = value" lines up to ElementDataFile, the last one; `end` is where the bytes behind it begin.
Fields readFields(const std::filesystem::path& file, std::uint64_t& end)
{
    std::ifstream in(file, std::ios::binary);
    Fields fields;
    std::string line;
    while (fields.count("ElementDataFile") == 0 && fields.size() < 1000 && end < 1000000 && std::getline(in, line)) {
        end += line.size() + 1;
        const auto equals = line.find('=');
        if (equals == std::string::npos || line.size() > 10000) {
            break;
        }
        const std::string key = trimmed(line.substr(0, equals));
        const std::string value = trimmed(line.substr(equals + 1));
        refuseIf(fields.emplace(key, value).first->second != value, file,
                 "its header gives '{}' twice, and says something else each time: save it again", key.substr(0, 60));
    }
    refuseIf(fields.count("ElementDataFile") == 0 || fields.count("DimSize") == 0 || fields.count("ElementType") == 0, file,
             "is not a MetaImage, DimSize, ElementType or ElementDataFile is missing from its header: save it again");
    return fields;
}

bool isTrue(const Fields& fields, const std::string& key)
{
    const auto found = fields.find(key);
    return found != fields.end() && !found->second.empty() &&
           std::string("Tt1").find(found->second[0]) != std::string::npos;
}

// The first of several names of the same thing that is there.
std::string firstOf(const Fields& fields, std::initializer_list<const char*> keys)
{
    const auto there = std::ranges::find_if(keys, [&](const char* key) { return fields.contains(key); });
    return there == keys.end() ? "" : fields.at(*there);
}

Component metaComponent(const std::filesystem::path& file, const std::string& type)
{
    static const std::map<std::string, Component> types = {
        {"MET_UCHAR", Component::u8},       {"MET_CHAR", Component::i8},       {"MET_USHORT", Component::u16},
        {"MET_SHORT", Component::i16},      {"MET_UINT", Component::u32},      {"MET_INT", Component::i32},
        {"MET_ULONG_LONG", Component::u64}, {"MET_LONG_LONG", Component::i64}, {"MET_FLOAT", Component::f32},
        {"MET_DOUBLE", Component::f64}};
    const auto found = types.find(type);
    refuseIf(found == types.end(), file, "ElementType = {}: is not read, save it with one number of 8 to 64 bits per voxel",
             type.substr(0, 60));
    return found->second;
}

// The sizes without the last ones that are 1, and how many there are with them.
std::vector<std::int64_t> sizesOf(const std::filesystem::path& file, const Fields& fields, std::size_t& dimensions)
{
    std::vector<std::int64_t> sizes = integers(file, "DimSize", fields.at("DimSize"));
    const std::string said = firstOf(fields, {"NDims"});
    refuseIf(!said.empty() && integer(file, "NDims", said) != static_cast<std::int64_t>(sizes.size()), file,
             "NDims = {} but DimSize = {}: its header contradicts itself, save it again", said, fields.at("DimSize"));
    dimensions = std::max<std::size_t>(3, sizes.size());
    while (sizes.size() > 3 && sizes.back() == 1) {
        sizes.pop_back();
    }
    return sizes;
}

std::vector<double> someNumbers(const std::filesystem::path& file, const Fields& fields, const char* what,
                                std::initializer_list<const char*> keys, std::vector<double> fallback)
{
    const std::string text = firstOf(fields, keys);
    if (text.empty()) {
        return fallback;
    }
    std::vector<double> found = numbers(file, what, text);
    refuseIf(found.size() != fallback.size(), file, "{} = {}: must be {} numbers, save it again", what, text.substr(0, 100),
             fallback.size());
    return found;
}

// MetaImage writes the direction of one axis after the other, in LPS. Axes beyond the third are no space.
void place(const Fields& fields, std::size_t dimensions, Source& source)
{
    const std::filesystem::path& file = source.header;
    const std::string units = lowerCase(firstOf(fields, {"DistanceUnits"}));
    refuseIf(!units.empty() && units != "mm" && units != "?", file,
             "DistanceUnits = {}: only mm is understood, save it with mm", units.substr(0, 60));
    std::vector<double> straight(dimensions * dimensions, 0.0);
    for (std::size_t k = 0; k < dimensions; ++k) {
        straight[k * dimensions + k] = 1.0;
    }
    const auto direction =
        someNumbers(file, fields, "TransformMatrix", {"TransformMatrix", "Rotation", "Orientation"}, std::move(straight));
    const auto origin =
        someNumbers(file, fields, "Offset", {"Offset", "Position", "Origin"}, std::vector<double>(dimensions, 0.0));
    if (firstOf(fields, {"ElementSpacing", "ElementSize"}).empty()) {
        source.warnings.emplace_back("its header gives no ElementSpacing: voxels of 1 mm are assumed");
    }
    const auto spacing = someNumbers(file, fields, "ElementSpacing", {"ElementSpacing", "ElementSize"},
                                     std::vector<double>(dimensions, 1.0));
    // RAI: from right, anterior, inferior, which is what no TransformMatrix means to ITK.
    source.oriented = !firstOf(fields, {"TransformMatrix", "Rotation", "Orientation"}).empty() ||
                      firstOf(fields, {"AnatomicalOrientation"}) == "RAI";
    for (int k = 0; k < 3; ++k) {
        const auto at = static_cast<std::size_t>(k);
        const double* axis = direction.data() + at * dimensions;
        source.affine.origin[k] = 1e-3 * origin[at];
        // A negative spacing turns the axis round, as ITK has it, whose format this is.
        source.affine.linear[k] = 1e-3 * spacing[at] * Vec3(axis[0], axis[1], axis[2]);
    }
}

void readScale(const Fields& fields, Source& source)
{
    const char* const slopeKey = "ElementToIntensityFunctionSlope";
    const char* const offsetKey = "ElementToIntensityFunctionOffset";
    source.slope = someNumbers(source.header, fields, slopeKey, {slopeKey}, {1.0})[0];
    source.intercept = someNumbers(source.header, fields, offsetKey, {offsetKey}, {0.0})[0];
    refuseIf(source.slope == 0.0, source.header, "{} = 0: all its values would be one, save it again", slopeKey);
    source.scaled = source.slope != 1.0 || source.intercept != 0.0;
}

void locateData(const Fields& fields, std::uint64_t headerEnd, Source& source)
{
    const std::string& name = fields.at("ElementDataFile");
    refuseIf(name == "LIST" || name.rfind("LIST ", 0) == 0 || name.find('%') != std::string::npos, source.header,
             "its slices lie in one file each: save it as one file");
    const bool local = lowerCase(name) == "local";
    source.data = local ? source.header : besides(source.header, name, source.warnings);
    source.offset = local ? headerEnd : 0;
    const std::string given = firstOf(fields, {"HeaderSize"});
    const std::int64_t headerSize = given.empty() ? 0 : integer(source.header, "HeaderSize", given);
    refuseIf(headerSize < -1, source.header, "HeaderSize = {}: must be -1 or more, save it again", headerSize);
    source.fromEnd = headerSize == -1;
    source.offset += headerSize > 0 ? static_cast<std::uint64_t>(headerSize) : 0;
}

// VICTRE phantoms come with gzip data and CompressedData = False; other headers count fewer compressed bytes than there
// are.
void judgePacking(const Fields& fields, Source& source)
{
    const bool declared = isTrue(fields, "CompressedData");
    const std::uint64_t stored = unpackedSize(source.data, source.offset, Encoding::raw, 0);
    const bool exact = stored == source.elements() * bytesOf(source.component);
    const Encoding there = looksLike(source.data, source.offset);
    source.encoding = there == Encoding::deflate && (declared || !exact) ? there : Encoding::raw;
    const bool packed = source.encoding == Encoding::deflate;
    if (packed != declared) {
        source.warnings.push_back(fmt::format("its header says CompressedData = {}, but the data are {}: read as they are",
                                              declared ? "True" : "False", packed ? "compressed" : "not compressed"));
    }
    const std::string counted = firstOf(fields, {"CompressedDataSize"});
    if (declared && !counted.empty() && counted != std::to_string(stored)) {
        source.warnings.push_back(
            fmt::format("its header says CompressedDataSize = {}, but there are {} bytes: read to the end",
                        counted.substr(0, 30), stored));
    }
}

}  // namespace

Source readMeta(const std::filesystem::path& file)
{
    std::uint64_t headerEnd = 0;
    const Fields fields = readFields(file, headerEnd);
    Source source;
    source.header = file;
    std::size_t dimensions = 3;
    source.size = checkedVolumes(file, sizesOf(file, fields, dimensions), source);
    source.component = metaComponent(file, fields.at("ElementType"));
    source.bigEndian = isTrue(fields, "BinaryDataByteOrderMSB") || isTrue(fields, "ElementByteOrderMSB");
    const std::string channels = firstOf(fields, {"ElementNumberOfChannels"});
    refuseIf(!channels.empty() && channels != "1", file, "has {} values per voxel: save it with one",
             channels.substr(0, 30));
    place(fields, dimensions, source);
    readScale(fields, source);
    if (fields.count("BinaryData") != 0 && !isTrue(fields, "BinaryData")) {
        locateData(fields, headerEnd, source);
        source.encoding = Encoding::text;
        return source;
    }
    locateData(fields, headerEnd, source);
    judgePacking(fields, source);
    return source;
}

}  // namespace palpate::volume
