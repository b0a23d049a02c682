#include <base/mapped.h>
#include <volume/import/dicom_file.h>
#include <volume/import/segments.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::volume {

namespace {

/// A frame and the slice of the volume that it is.
struct Placed {
    const DicomFrame* frame = nullptr;
    std::int64_t slice = 0;
};

/// The grid that holds all frames; frames without a voxel may be absent.
struct Grid {
    Index3 size{0};
    Affine affine;
    std::vector<Placed> frames;  // by slice
};

void checkFrames(const DicomObject& object)
{
    refuseIf(object.frames.empty(), object.file,
             "has no frames, so no voxel is set: give a segmentation that holds something");
    const DicomFrame& first = object.frames[0];
    for (const DicomFrame& f : object.frames) {
        refuseIf(!f.placed, object.file, "frame {} does not say where it is: export it again", f.index + 1);
        refuseIf(
            glm::length(f.alongRow - first.alongRow) + glm::length(f.alongColumn - first.alongColumn) > 1e-4 ||
                std::abs(f.rowSpacing - first.rowSpacing) + std::abs(f.columnSpacing - first.columnSpacing) > samePlace,
            object.file,
            "frames 1 and {} lie in different directions or have different pixels: export it "
            "again on one grid",
            f.index + 1);
    }
}

// Distance between slices [m]: what file or user say where all frames agree with it, else the smallest gap. Where nobody
// says it, a gap of several thicknesses is either the distance or has slices without a frame in it.
double spacingOf(const DicomObject& object, const std::vector<double>& heights, double asked)
{
    refuseIf(asked > 0 && object.betweenSlices > 0, object.file,
             "--slice-spacing {:g}: it says itself that its slices are {:g} mm apart: leave --slice-spacing out",
             1e3 * asked, 1e3 * object.betweenSlices);
    double smallest = 0;
    for (std::size_t i = 1; i < heights.size(); ++i) {
        const double gap = heights[i] - heights[i - 1];
        smallest = gap > samePlace && (smallest == 0 || gap < smallest) ? gap : smallest;
    }
    const bool certain = object.betweenSlices > 0 || asked > 0;
    const double said = asked > 0 ? asked : object.betweenSlices > 0 ? object.betweenSlices : object.thickness;
    if (smallest == 0) {
        refuseIf(!(said > 0), object.file, "is one slice and does not say how thick: export it again");
        return said;
    }
    const double steps = smallest / said;
    const bool multiple = said > 0 && steps > 0.95 && std::abs(steps - std::round(steps)) < 0.02 * std::round(steps);
    refuseIf(asked > 0 && !multiple, object.file,
             "--slice-spacing {:g}: its frames are {:.4g} mm apart, which is no multiple of it: give the distance of the "
             "image's slices",
             1e3 * asked, 1e3 * smallest);
    refuseIf(!certain && multiple && steps > 1.5, object.file,
             "its frames are {:.4g} mm apart and {:.4g} mm thick, and it does not say how far apart slices are: give the "
             "distance of the image's slices with --slice-spacing MM, for those without a frame lie between",
             1e3 * smallest, 1e3 * object.thickness);
    return multiple && certain ? smallest / std::round(steps) : smallest;
}

Grid gridOf(const DicomObject& object, double askedSpacing)
{
    checkFrames(object);
    const DicomFrame& any = object.frames[0];
    const Vec3 normal = glm::cross(any.alongRow, any.alongColumn);
    Grid grid;
    grid.frames = base::mapped<Placed>(object.frames, [](const DicomFrame& f) { return Placed{&f, 0}; });
    const auto height = [&](const Placed& p) { return glm::dot(normal, p.frame->position); };
    std::stable_sort(grid.frames.begin(), grid.frames.end(),
                     [&](const Placed& a, const Placed& b) { return height(a) < height(b); });
    const auto heights = base::mapped<double>(grid.frames, [&](const Placed& p) { return height(p); });
    const double spacing = spacingOf(object, heights, askedSpacing);
    const Vec3 origin = grid.frames[0].frame->position;
    for (Placed& p : grid.frames) {
        const double steps = (height(p) - heights[0]) / spacing;
        refuseIf(!(steps < 32767), object.file,
                 "its frames are up to {:.4g} mm apart: the positions are wrong, export it again",
                 1e3 * (heights.back() - heights[0]));
        p.slice = std::llround(steps);
        const Vec3 expected = origin + static_cast<double>(p.slice) * spacing * normal;
        refuseIf(glm::length(p.frame->position - expected) > std::max(2e-5, 0.05 * spacing), object.file,
                 "frame {} is {:.3g} mm off the grid of the others: export it again on one grid", p.frame->index + 1,
                 1e3 * glm::length(p.frame->position - expected));
    }
    const std::int64_t slices = grid.frames.back().slice + 1;
    refuseIf(slices > 64 * (static_cast<std::int64_t>(object.frames.size()) + 16), object.file,
             "has {} frames spread over {} slices: the positions are wrong, export it again", object.frames.size(), slices);
    grid.size = checkedSize(object.file, {object.columns, object.rows, slices});
    grid.affine.linear = Mat3(any.alongRow * any.columnSpacing, any.alongColumn * any.rowSpacing, normal * spacing);
    grid.affine.origin = origin;
    return grid;
}

LabelName nameOf(const DicomObject& object, std::uint16_t value)
{
    const auto found =
        std::find_if(object.segments.begin(), object.segments.end(), [&](const LabelName& n) { return n.value == value; });
    refuseIf(found == object.segments.end(), object.file,
             "has voxels of segment {}, which its list does not hold: export it again", value);
    return *found;
}

// One frame is one slice of one segment. Values above the threshold are in.
std::vector<Segment> separateSegments(const DicomObject& object, const Grid& grid, const ImportOptions& options,
                                      std::vector<std::string>& warnings)
{
    auto segments = base::mapped<Segment>(object.segments, [&](const LabelName& name) { return Segment{name, {}, 0}; });
    const bool fractional = object.segmentationType == "FRACTIONAL";
    const float lowest = options.fractionalThreshold.value_or(0.5F);
    const double threshold = fractional ? static_cast<double>(lowest) * object.maxFractional : 0.5;
    std::uint64_t between = 0;
    DicomPixels pixels(object);
    std::map<std::pair<std::uint16_t, std::int64_t>, std::size_t> seen;
    double done = 0;
    for (const Placed& placed : grid.frames) {
        const LabelName name = nameOf(object, placed.frame->segment);
        refuseIf(!seen.emplace(std::pair(name.value, placed.slice), placed.frame->index).second, object.file,
                 "has two frames of segment {} ('{}') in one place: export it again", name.value, name.name);
        Segment& segment =
            *std::find_if(segments.begin(), segments.end(), [&](const Segment& s) { return s.label.value == name.value; });
        const auto values = pixels.frame(placed.frame->index);
        const auto first = static_cast<std::uint32_t>(static_cast<std::uint64_t>(placed.slice) * values.size());
        for (std::size_t i = 0; i < values.size(); ++i) {
            if (values[i] > 0 && values[i] >= threshold) {
                segment.add(first + static_cast<std::uint32_t>(i));
            }
            between += values[i] > 0 && values[i] < object.maxFractional ? 1 : 0;
        }
        done += 1;
        if (options.progress) {
            options.progress(done / static_cast<double>(grid.frames.size()));
        }
    }
    if (fractional && between > 0) {
        warnings.push_back(
            fmt::format("{} voxels have a probability between 0 and 1: from {} on they are taken as set", between, lowest));
    }
    return segments;
}

// LABELMAP: one frame is one slice of all segments.
void labelMap(const DicomObject& object, const Grid& grid, const ImportOptions& options, ImportedLabels& out)
{
    LabelImage& image = out.image;
    image.values.assign(image.offset({0, 0, image.size.z}), 0);
    DicomPixels pixels(object);
    std::vector<bool> seen(65536, false);
    std::int64_t last = -1;
    for (std::size_t n = 0; n < grid.frames.size(); ++n) {
        const Placed& placed = grid.frames[n];
        refuseIf(placed.slice == last, object.file, "has two frames in one place: export it again");
        last = placed.slice;
        const auto values = pixels.frame(placed.frame->index);
        const std::size_t first = static_cast<std::size_t>(placed.slice) * values.size();
        for (std::size_t i = 0; i < values.size(); ++i) {
            const auto v = static_cast<std::uint16_t>(values[i] == object.padding ? 0 : values[i]);
            image.values[first + i] = v;
            seen[v] = true;
        }
        if (options.progress) {
            options.progress(static_cast<double>(n + 1) / static_cast<double>(grid.frames.size()));
        }
    }
    refuseIf(std::count(seen.begin() + 1, seen.end(), true) == 0, object.file,
             "no voxel is set in any of its segments: give a segmentation that holds something");
    for (std::size_t v = 1; v < seen.size(); ++v) {
        if (seen[v]) {
            out.names.push_back(nameOf(object, static_cast<std::uint16_t>(v)));
        }
    }
}

}  // namespace

ImportedLabels readSegmentation(const DicomObject& object, const ImportOptions& options)
{
    const std::string& type = object.segmentationType;
    const bool bits = object.bitsAllocated == 1;
    refuseIf(type != "BINARY" && type != "FRACTIONAL" && type != "LABELMAP", object.file,
             "its type of segmentation, '{}', is not BINARY, FRACTIONAL or LABELMAP: export it again", type);
    refuseIf((type == "BINARY") != bits, object.file,
             "is a DICOM SEG of type {}, but has {} bits per voxel: export it again", type, object.bitsAllocated);
    if (type != "FRACTIONAL") {
        refuseThreshold(object.file, options);
    }
    const Grid grid = gridOf(object, options.sliceSpacing);
    ImportedLabels out;
    out.image.size = grid.size;
    out.image.affine = grid.affine;
    checkAffine(object.file, grid.affine, options.sheared, out.warnings);
    if (type == "LABELMAP") {
        labelMap(object, grid, options, out);
    } else {
        flatten(object.file, separateSegments(object, grid, options, out.warnings), options, out);
    }
    std::vector<std::int64_t> there;
    for (const Placed& p : grid.frames) {
        if (there.empty() || there.back() != p.slice) {
            there.push_back(p.slice);
        }
    }
    if (static_cast<int>(there.size()) < grid.size.z) {
        out.warnings.push_back(fmt::format("{} of {} slices have no frame: they are empty",
                                           grid.size.z - static_cast<int>(there.size()), grid.size.z));
    }
    return out;
}

}  // namespace palpate::volume
