#include <volume/import/dicom_file.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::volume {

namespace {

constexpr double sameDirection = 1e-4;  // of unit vectors

struct Slice {
    const DicomObject* object = nullptr;
    const DicomFrame* frame = nullptr;
    double height = 0;  // along the normal [m]
};

std::string lengthText(double metres)
{
    return fmt::format("{:.4g} mm", 1e3 * metres);
}

std::string nameOf(const Slice& slice)
{
    const std::string file = slice.frame->file.filename().string();
    return slice.object->frames.size() > 1 ? fmt::format("{} frame {}", file, slice.frame->index + 1) : file;
}

// All slices have one size, one spacing and one direction.
void checkAlike(const std::filesystem::path& path, const std::vector<Slice>& slices)
{
    const DicomFrame& first = *slices[0].frame;
    for (const Slice& slice : slices) {
        const DicomFrame& f = *slice.frame;
        refuseIf(!f.placed, path,
                 "{} does not say where its slice is (position, orientation or pixel spacing is missing): "
                 "export it again, or leave the file out",
                 nameOf(slice));
        refuseIf(slice.object->columns != slices[0].object->columns || slice.object->rows != slices[0].object->rows, path,
                 "its slices have different sizes: {} x {} in {}, {} x {} in {}: put each series into a folder "
                 "of its own",
                 slices[0].object->columns, slices[0].object->rows, nameOf(slices[0]), slice.object->columns,
                 slice.object->rows, nameOf(slice));
        if (glm::length(f.alongRow - first.alongRow) > sameDirection ||
            glm::length(f.alongColumn - first.alongColumn) > sameDirection) {
            refuse(path,
                   "its slices lie in different directions ({} and {}; a localiser among them?): put each "
                   "direction into a folder of its own",
                   nameOf(slices[0]), nameOf(slice));
        }
        if (std::abs(f.rowSpacing - first.rowSpacing) > 1e-3 * first.rowSpacing ||
            std::abs(f.columnSpacing - first.columnSpacing) > 1e-3 * first.columnSpacing) {
            refuse(path,
                   "its slices have different pixel spacings ({} and {}): put each series into a folder of its "
                   "own",
                   nameOf(slices[0]), nameOf(slice));
        }
    }
}

// A file that is there twice is taken once; two different slices in one place are not ours to choose from.
void dropDoubles(const std::filesystem::path& path, std::vector<Slice>& slices, std::vector<std::string>& warnings)
{
    std::vector<Slice> kept;
    std::size_t dropped = 0;
    for (const Slice& slice : slices) {
        if (kept.empty() || slice.height - kept.back().height > samePlace) {
            kept.push_back(slice);
            continue;
        }
        const Slice& there = kept.back();
        const bool same = slice.object != there.object && slice.object->instance == there.object->instance &&
                          !slice.object->instance.empty() && slice.frame->index == there.frame->index;
        refuseIf(!same, path,
                 "has two slices in one place ({} and {}: several time points, or a series exported twice): "
                 "keep one of them",
                 nameOf(there), nameOf(slice));
        ++dropped;
    }
    if (dropped > 0) {
        warnings.push_back(fmt::format("{} slices are there twice: each is taken once", dropped));
    }
    slices = std::move(kept);
}

// The step from slice to slice [m]; refuses slices that are missing or uneven.
Vec3 stepOf(const std::filesystem::path& path, const std::vector<Slice>& slices, const Vec3& normal)
{
    const DicomObject& object = *slices[0].object;
    if (slices.size() == 1) {
        const double thickness = object.betweenSlices > 0 ? object.betweenSlices : object.thickness;
        refuseIf(!(thickness > 0), path, "is one slice and does not say how thick: name the folder that holds its series");
        return thickness * normal;
    }
    std::vector<double> gaps;
    for (std::size_t i = 1; i < slices.size(); ++i) {
        gaps.push_back(slices[i].height - slices[i - 1].height);
    }
    std::vector<double> sorted = gaps;
    std::sort(sorted.begin(), sorted.end());
    const double usual = sorted[(sorted.size() - 1) / 2];
    for (std::size_t i = 0; i < gaps.size(); ++i) {
        const double steps = gaps[i] / usual;
        if (steps > 1.5 && std::abs(steps - std::round(steps)) < 0.1) {
            const double missing = std::round(steps) - 1;
            refuse(path, "{} missing between {} and {}, they are {} apart, others {}: get the whole series",
                   missing == 1 ? "a slice is" : fmt::format("{:.0f} slices are", missing), nameOf(slices[i]),
                   nameOf(slices[i + 1]), lengthText(gaps[i]), lengthText(usual));
        }
    }
    const Vec3 step =
        (slices.back().frame->position - slices.front().frame->position) / static_cast<double>(slices.size() - 1);
    const double tolerance = std::max(2e-5, 0.05 * usual);
    for (std::size_t i = 0; i < slices.size(); ++i) {
        const Vec3 expected = slices.front().frame->position + static_cast<double>(i) * step;
        refuseIf(glm::length(slices[i].frame->position - expected) > tolerance, path,
                 "its slices are uneven: from {} to {} apart, {} is {} off: resample it to even slices first",
                 lengthText(sorted.front()), lengthText(sorted.back()), nameOf(slices[i]),
                 lengthText(glm::length(slices[i].frame->position - expected)));
    }
    return step;
}

std::vector<Slice> slicesOf(const std::vector<DicomObject>& objects)
{
    std::vector<Slice> slices;
    for (const DicomObject& object : objects) {
        for (const DicomFrame& frame : object.frames) {
            slices.push_back({&object, &frame, 0});
        }
    }
    return slices;
}

void readPixels(const std::vector<Slice>& slices, const std::function<void(double)>& progress, std::vector<float>& values)
{
    const DicomObject* open = nullptr;
    std::unique_ptr<DicomPixels> pixels;
    for (std::size_t i = 0; i < slices.size(); ++i) {
        if (slices[i].object != open) {
            open = slices[i].object;
            pixels = std::make_unique<DicomPixels>(*open);
        }
        const DicomFrame& frame = *slices[i].frame;
        const auto stored = pixels->frame(frame.index);
        if (i == 0) {
            values.reserve(slices.size() * stored.size());
        }
        for (const std::int32_t v : stored) {
            values.push_back(static_cast<float>(frame.slope * v + frame.intercept));
        }
        if (progress) {
            progress(static_cast<double>(i + 1) / static_cast<double>(slices.size()));
        }
    }
}

}  // namespace

DicomVolume readSeries(const std::filesystem::path& path, const std::vector<DicomObject>& objects, bool sheared,
                       const std::function<void(double)>& progress)
{
    std::vector<Slice> slices = slicesOf(objects);
    checkAlike(path, slices);
    DicomVolume volume;
    const DicomFrame& any = *slices[0].frame;
    const Vec3 normal = glm::cross(any.alongRow, any.alongColumn);
    for (Slice& slice : slices) {
        slice.height = glm::dot(normal, slice.frame->position);
    }
    std::stable_sort(slices.begin(), slices.end(), [](const Slice& a, const Slice& b) { return a.height < b.height; });
    dropDoubles(path, slices, volume.warnings);
    const Vec3 step = stepOf(path, slices, normal);
    const DicomFrame& first = *slices[0].frame;
    const DicomObject& object = *slices[0].object;
    volume.size = checkedSize(path, {object.columns, object.rows, static_cast<std::int64_t>(slices.size())});
    volume.affine.linear = Mat3(first.alongRow * first.columnSpacing, first.alongColumn * first.rowSpacing, step);
    volume.affine.origin = first.position;
    if (slices.size() == 1) {
        volume.warnings.emplace_back("is one slice only: name a folder for a whole series");
    }
    checkAffine(path, volume.affine, sheared, volume.warnings);
    readPixels(slices, progress, volume.values);
    volume.hounsfield = object.modality == "CT" && (object.rescaleType.empty() || object.rescaleType == "HU");
    return volume;
}

}  // namespace palpate::volume
