#include <base/mapped.h>
#include <volume/import/header_text.h>
#include <volume/import/source.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <optional>
#include <sstream>

namespace palpate::volume {

namespace {

/// A NRRD header as text. Format: https://teem.sourceforge.net/nrrd/format.html
struct NrrdHeader {
    std::filesystem::path file;
    std::map<std::string, std::string> fields;  // "field: value", names in lower case
    std::map<std::string, std::string> pairs;   // "key:=value"
    std::uint64_t end = 0;                      // first byte behind the empty line

    std::string field(const std::string& name, const std::string& fallback = "") const
    {
        const auto found = fields.find(name);
        return found == fields.end() ? fallback : found->second;
    }
    std::optional<std::string> pair(const std::string& name) const
    {
        const auto found = pairs.find(name);
        return found == pairs.end() ? std::nullopt : std::optional(found->second);
    }
};

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

/// What the header says about one axis.
struct Axis {
    std::int64_t size = 0;
    std::string kind;               // "domain", "list", ... ; empty where the header does not say
    std::optional<Vec3> direction;  // "none" and absent: empty
    bool none = false;              // the header says that it is not in space
    double spacing = unknown;
};

// Words, or (x,y,z) without the spaces that some writers put into them.
std::vector<std::string> entries(const std::string& text)
{
    std::vector<std::string> out;
    std::string entry;
    int open = 0;
    for (const char c : text + ' ') {
        open += (c == '(') - (c == ')');
        if (c != ' ' && c != '\t') {
            entry += c;
        } else if (open <= 0 && !entry.empty()) {
            out.push_back(entry);
            entry.clear();
        }
    }
    return out;
}

Vec3 vector3(const std::filesystem::path& file, const std::string& what, const std::string& entry)
{
    std::string inside = entry;
    std::replace_if(
        inside.begin(), inside.end(), [](char c) { return c == '(' || c == ')' || c == ','; }, ' ');
    const std::vector<double> v = numbers(file, what, inside);
    refuseIf(v.size() != 3, file, "{}: {} has {} numbers, but space has 3: its header is wrong, save it again", what,
             entry.substr(0, 60), v.size());
    return {v[0], v[1], v[2]};
}

// One entry for each axis, or none at all.
std::vector<std::string> perAxis(const NrrdHeader& header, const std::string& name, std::size_t axes)
{
    const std::vector<std::string> found = entries(header.field(name));
    refuseIf(!found.empty() && found.size() != axes, header.file,
             "{}: has {} entries for {} axes: its header contradicts itself, save it again", name, found.size(), axes);
    return found;
}

std::vector<Axis> axesOf(const NrrdHeader& header)
{
    const std::vector<std::int64_t> sizes = integers(header.file, "sizes", header.field("sizes"));
    refuseIf(integer(header.file, "dimension", header.field("dimension")) != static_cast<std::int64_t>(sizes.size()),
             header.file, "dimension: {} but sizes: {}: its header contradicts itself, save it again",
             header.field("dimension"), header.field("sizes"));
    const auto kinds = perAxis(header, "kinds", sizes.size());
    const auto directions = perAxis(header, "space directions", sizes.size());
    const auto spacings = perAxis(header, "spacings", sizes.size());
    std::vector<Axis> axes(sizes.size());
    for (std::size_t i = 0; i < axes.size(); ++i) {
        axes[i].size = sizes[i];
        axes[i].kind = kinds.empty() ? "" : lowerCase(kinds[i]);
        if (!directions.empty()) {
            axes[i].none = lowerCase(directions[i]) == "none";
            if (!axes[i].none) {
                axes[i].direction = vector3(header.file, "space directions", directions[i]);
            }
        }
        if (!spacings.empty() && lowerCase(spacings[i]) != "nan") {
            axes[i].spacing = numbers(header.file, "spacings", spacings[i]).at(0);
        }
    }
    return axes;
}

bool isLayerKind(const std::string& kind)
{
    return kind == "list" || kind.empty() || kind == "???" || kind == "none";
}

// Which of the axes are space: those with a direction, else those of the kinds of space, else the last three.
std::vector<std::size_t> spaceAxes(const std::vector<Axis>& axes)
{
    const bool directed = std::any_of(axes.begin(), axes.end(), [](const Axis& a) { return a.direction || a.none; });
    const bool kinded = std::any_of(axes.begin(), axes.end(), [](const Axis& a) { return !isLayerKind(a.kind); });
    std::vector<std::size_t> space;
    for (std::size_t i = 0; i < axes.size(); ++i) {
        const bool plain = axes[i].kind == "domain" || axes[i].kind == "space";
        const bool last = i + 3 >= axes.size() && axes[i].kind != "list";
        if (directed ? axes[i].direction.has_value() : kinded ? plain : last) {
            space.push_back(i);
        }
    }
    return space;
}

double unitOf(const NrrdHeader& header)
{
    static const std::map<std::string, double> known = {{"mm", 1e-3}, {"millimeter", 1e-3}, {"millimeters", 1e-3},
                                                        {"um", 1e-6}, {"m", 1.0},           {"meter", 1.0},
                                                        {"cm", 1e-2}, {"micron", 1e-6}};
    std::string units = header.field("space units");
    std::erase(units, '"');
    std::istringstream in(units);
    double all = 0;
    for (std::string unit; in >> unit;) {
        const auto found = known.find(unit);
        refuseIf(found == known.end() || (all > 0 && all != found->second), header.file,
                 "space units: {}: only one of mm, um, cm and m for all axes is understood, save it in mm",
                 header.field("space units").substr(0, 60));
        all = found->second;
    }
    return all > 0 ? all : 1e-3;
}

// The sign of each axis of the header's space in LPS; `oriented` is false where it names no patient frame.
Vec3 flipOf(const NrrdHeader& header, bool& oriented)
{
    const std::string space = lowerCase(header.field("space"));
    if (space == "right-anterior-superior" || space == "ras") {
        return {-1, -1, 1};
    }
    if (space == "left-anterior-superior" || space == "las") {
        return {1, -1, 1};
    }
    oriented = space == "left-posterior-superior" || space == "lps";
    return Vec3(1.0);
}

void findLayers(const NrrdHeader& header, const std::vector<Axis>& axes, const std::vector<std::size_t>& space,
                Source& source)
{
    std::uint64_t inner = 1;
    for (std::size_t i = 0; i < axes.size(); ++i) {
        const bool isSpace = std::find(space.begin(), space.end(), i) != space.end();
        if (isSpace) {
            inner *= static_cast<std::uint64_t>(axes[i].size);
            continue;
        }
        if (axes[i].size == 1) {
            continue;
        }
        refuseIf(axes[i].size < 1 || axes[i].size > 32767 || source.layers > 1 || source.volumes > 1, header.file,
                 "sizes: {} (kinds: {}): one axis beside those of space is read, of at most 32767 volumes: "
                 "save one volume of it",
                 header.field("sizes"), header.field("kinds", "not given").substr(0, 80));
        refuseIf(axes[i].kind.ends_with("-color") || axes[i].kind == "complex", header.file,
                 "kinds: {}: has colours or complex numbers as voxels: save it with one number per voxel",
                 header.field("kinds").substr(0, 80));
        source.dimensions =
            fmt::format("sizes: {}; kinds: {}", header.field("sizes"), header.field("kinds", "not given").substr(0, 80));
        const bool list = isLayerKind(axes[i].kind) && axes[i].size <= 4096;
        (list ? source.layers : source.volumes) = static_cast<std::uint64_t>(axes[i].size);
        (list ? source.inner : source.volumeInner) = inner;
    }
}

// Sets size, affine and layers: which axes are space, which one holds layers of segments.
void placeNrrd(const NrrdHeader& header, Source& source)
{
    const std::vector<Axis> axes = axesOf(header);
    const std::vector<std::size_t> space = spaceAxes(axes);
    const auto sizes = base::mapped<std::int64_t>(space, [&](const std::size_t i) { return axes[i].size; });
    source.size = checkedSize(header.file, sizes);
    findLayers(header, axes, space, source);

    const double unit = unitOf(header);
    const Vec3 flip = unit * flipOf(header, source.oriented);
    std::string without;
    for (int k = 0; k < 3; ++k) {
        const Axis& axis = axes[space[static_cast<std::size_t>(k)]];
        Vec3 step(0.0);
        step[k] = std::isnan(axis.spacing) ? 1.0 : axis.spacing;  // a negative one turns the axis round, as ITK has it
        if (!axis.direction && std::isnan(axis.spacing)) {
            without += fmt::format("{}{}", without.empty() ? "" : " and ", "xyz"[k]);
        }
        source.affine.linear[k] = flip * axis.direction.value_or(step);
    }
    if (!without.empty()) {
        source.warnings.push_back(without == "x and y and z"
                                      ? "its header gives no spacing: voxels of 1 mm are assumed"
                                      : fmt::format("its header gives no spacing along {}: 1 mm is assumed", without));
    }
    const std::string origin = header.field("space origin");
    if (!origin.empty()) {
        source.affine.origin = flip * vector3(header.file, "space origin", origin);
    } else if (!header.field("axis mins", header.field("axismins")).empty()) {
        source.warnings.emplace_back("its axis mins are not used: the first voxel is put at the origin");
    }
}

// Segments as 3D Slicer names them in a .seg.nrrd.
std::vector<SegmentName> slicerSegments(const NrrdHeader& header, std::uint64_t layers)
{
    std::vector<SegmentName> segments;
    for (std::uint64_t i = 0; i < 65535; ++i) {
        const std::string key = fmt::format("Segment{}_", i);
        const auto name = header.pair(key + "Name");
        const auto id = header.pair(key + "ID");
        if (!name && !id) {
            break;
        }
        // Before version 4.11 each segment was a layer of its own, of value 1. A file of one layer needs not name it.
        const auto whole = [&](const char* what, std::int64_t fallback) {
            const auto text = header.pair(key + what);
            const std::int64_t value = text ? integer(header.file, key + what, *text) : fallback;
            refuseIf(value < 0 || value > 65535, header.file, "{}{} = {}: it must be 0 to 65535, save it again", key, what,
                     value);
            return value;
        };
        SegmentName segment;
        segment.label.value = static_cast<std::uint16_t>(whole("LabelValue", 1));
        segment.layer = static_cast<std::uint64_t>(whole("Layer", layers > 1 ? static_cast<std::int64_t>(i) : 0));
        segment.label.name = name.value_or(id.value_or(""));
        if (const auto colour = header.pair(key + "Color")) {
            const std::vector<double> rgb = numbers(header.file, key + "Color", *colour);
            if (rgb.size() == 3) {
                const auto byte = [](double v) {
                    return static_cast<std::uint8_t>(std::lround(255 * std::clamp(v, 0.0, 1.0)));
                };
                segment.label.colour = {byte(rgb[0]), byte(rgb[1]), byte(rgb[2])};
            }
        }
        const std::string tags = header.pair(key + "Tags").value_or("");
        const std::string entry = "TerminologyEntry:";
        if (const auto at = tags.find(entry); at != std::string::npos) {
            const auto start = at + entry.size();
            segment.label.terminology = tags.substr(start, tags.find('|', start) - start);
        }
        segments.push_back(std::move(segment));
    }
    return segments;
}

// A layer and a value are one segment.
void checkSegments(const Source& source)
{
    std::map<std::pair<std::uint64_t, std::uint16_t>, std::string> known;
    for (const SegmentName& s : source.segments) {
        refuseIf(s.layer >= source.layers, source.header,
                 "segment '{}' is said to be in layer {}, but there {}: save it again", s.label.name, s.layer,
                 source.layers == 1 ? "is one layer" : fmt::format("are {} layers", source.layers));
        const auto [there, added] = known.emplace(std::pair(s.layer, s.label.value), s.label.name);
        refuseIf(!added, source.header,
                 "segments '{}' and '{}' both have value {} of layer {}, so one of them has no voxels of its own: save it "
                 "again",
                 there->second, s.label.name, s.label.value, s.layer);
    }
}

// The two characters that the format escapes in the value of a key.
std::string withoutEscapes(const std::string& text)
{
    std::string out;
    for (std::size_t i = 0; i < text.size(); ++i) {
        const char next = text[i] == '\\' && i + 1 < text.size() ? text[i + 1] : '\0';
        const bool escaped = next == '\\' || next == 'n';
        out += !escaped ? text[i] : next == 'n' ? '\n' : '\\';
        i += escaped ? 1 : 0;
    }
    return out;
}

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
            header.pairs[text.substr(0, pair)] = withoutEscapes(text.substr(pair + 2));
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
    placeNrrd(header, source);
    source.segments = slicerSegments(header, source.layers);
    checkSegments(source);
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
