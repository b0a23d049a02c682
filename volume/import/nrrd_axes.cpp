#include <base/mapped.h>
#include <volume/import/header_text.h>
#include <volume/import/nrrd.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

namespace palpate::volume {

namespace {

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
    if (integer(header.file, "dimension", header.field("dimension")) != static_cast<std::int64_t>(sizes.size())) {
        refuse(header.file, "dimension: {} but sizes: {}: its header contradicts itself, save it again",
               header.field("dimension"), header.field("sizes"));
    }
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
        if (found == known.end() || (all > 0 && all != found->second)) {
            refuse(header.file, "space units: {}: only one of mm, um, cm and m for all axes is understood, save it in mm",
                   header.field("space units").substr(0, 60));
        }
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
        if (axes[i].size < 1 || axes[i].size > 32767 || source.layers > 1 || source.volumes > 1) {
            refuse(header.file,
                   "sizes: {} (kinds: {}): one axis beside those of space is read, of at most 32767 volumes: "
                   "save one volume of it",
                   header.field("sizes"), header.field("kinds", "not given").substr(0, 80));
        }
        source.dimensions =
            fmt::format("sizes: {}; kinds: {}", header.field("sizes"), header.field("kinds", "not given").substr(0, 80));
        const bool list = isLayerKind(axes[i].kind) && axes[i].size <= 4096;
        (list ? source.layers : source.volumes) = static_cast<std::uint64_t>(axes[i].size);
        (list ? source.inner : source.volumeInner) = inner;
    }
}

}  // namespace

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

std::vector<SegmentName> slicerSegments(const NrrdHeader& header)
{
    std::vector<SegmentName> segments;
    for (std::uint64_t i = 0; i < 65535; ++i) {
        const std::string key = fmt::format("Segment{}_", i);
        const auto name = header.pair(key + "Name");
        const auto id = header.pair(key + "ID");
        if (!name && !id) {
            break;
        }
        // Before version 4.11 each segment was a layer of its own, of value 1.
        const auto whole = [&](const char* what, std::int64_t fallback) {
            const auto text = header.pair(key + what);
            const std::int64_t value = text ? integer(header.file, key + what, *text) : fallback;
            refuseIf(value < 0 || value > 65535, header.file, "{}{} = {}: it must be 0 to 65535, save it again", key, what,
                     value);
            return value;
        };
        SegmentName segment;
        segment.label.value = static_cast<std::uint16_t>(whole("LabelValue", 1));
        segment.layer = static_cast<std::uint64_t>(whole("Layer", static_cast<std::int64_t>(i)));
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

}  // namespace palpate::volume
