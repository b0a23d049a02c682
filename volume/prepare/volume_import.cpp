#include <volume/prepare/volume_import.h>

#include <base/build.h>
#include <base/error.h>
#include <base/fnv.h>
#include <base/outputs.h>
#include <base/quantities.h>
#include <datasets/label_map.h>
#include <volume/image_check.h>
#include <volume/prepare/body.h>
#include <volume/prepare/name_table.h>
#include <volume/provenance.h>
#include <volume/resample.h>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cmath>
#include <ctime>
#include <iterator>
#include <stdexcept>

namespace palpate::prepare {

namespace {

namespace fs = std::filesystem;

bool isFolder(const fs::path& path)
{
    std::error_code none;
    return fs::is_directory(path, none);
}

// The series of the image: --series is for labels that are a folder.
std::string seriesOfImage(const ImportRequest& o)
{
    return o.imageSeries.empty() && !isFolder(o.input) ? o.reading.series : o.imageSeries;
}

// The same coordinates in two frames of reference are two places of the patient.
void checkFrame(const ImportRequest& o, const volume::ImportedLabels& labels, const volume::ImportedImage& image,
                std::vector<std::string>& notes)
{
    const bool differ = !labels.frame.empty() && !image.frame.empty() && labels.frame != image.frame;
    base::failIf(differ && !o.ignoreFrame,
                 "{}: its frame of reference ({}) is not that of {} ({}), so it lies elsewhere: give the image that the "
                 "segmentation was made of, or --ignore-frame-of-reference if both are registered to each other",
                 o.image.native(), image.frame, o.input.filename().string(), labels.frame);
    if (o.ignoreFrame) {
        notes.push_back(differ ? fmt::format("labels and image have different frames of reference ({} and {}), which "
                                             "--ignore-frame-of-reference takes for one",
                                             labels.frame, image.frame)
                               : "--ignore-frame-of-reference decides nothing: no two frames of reference differ");
    }
}

// The image as its file has it, its unit as --image-unit has it.
volume::ImportedImage readImage(const ImportRequest& o, const volume::ImportedLabels& labels,
                                std::vector<std::string>& notes, const ImportProgress& tell)
{
    volume::ImportOptions reading;
    reading.series = seriesOfImage(o);
    reading.seriesOfLabels = labels.madeOf;
    reading.volume = o.imageVolume;
    reading.axes = o.imageAxes.empty() ? o.reading.axes : o.imageAxes;
    reading.axesIfUnsaid = o.imageAxes.empty();
    tell("checking the image", {});
    reading.progress = [&](double fraction) { tell("reading the image", fraction); };
    volume::ImportedImage image = volume::importImage(o.image, reading);
    for (const std::string& warning : image.warnings) {
        notes.push_back(fmt::format("{}: {}", o.image.filename().string(), warning));
    }
    checkFrame(o, labels, image, notes);
    base::failIf(!o.imageUnit.empty() && !image.what.empty() && image.what != o.imageUnit,
                 "{}: says itself that it is in {}: leave --image-unit out", o.image.native(), image.what);
    image.what = o.imageUnit.empty() ? image.what : o.imageUnit;
    base::failIf(o.bodyFromImage && image.what != "HU",
                 "{}: --body-from-image needs CT in Hounsfield units: add --image-unit HU if it "
                 "is that, or invent a body with --body-from-hull MM",
                 o.image.native());
    return image;
}

// The image on the voxels of the labels.
volume::CompanionImage companionOf(const ImportRequest& o, const volume::ImportedImage& image,
                                   const volume::LabelImage& labels, const volume::TissueTable& table,
                                   std::vector<std::string>& notes)
{
    const volume::VoxelGrid from{image.size, image.affine}, to{labels.size, labels.affine};
    volume::CompanionImage companion;
    companion.unit = image.what;
    if (!o.stiffness.empty()) {
        companion.stiffness = datasets::stiffnessMap(o.stiffness, companion.unit, table);
    }
    const float missing = companion.unit == "HU" ? -1000.0F : 0.0F;
    companion.values = volume::resampledImage(from, image.values, to, std::nanf(""));
    std::uint64_t bare = 0, labelled = 0;
    for (std::size_t i = 0; i < companion.values.size(); ++i) {
        labelled += labels.values[i] != 0 ? 1 : 0;
        bare += std::isnan(companion.values[i]) && labels.values[i] != 0 ? 1 : 0;
        companion.values[i] = std::isnan(companion.values[i]) ? missing : companion.values[i];
    }
    base::failIf(2 * bare > labelled,
                 "{}: it covers less than half of the labelled voxels of {}: give the image that the "
                 "segmentation was made of, in the same patient frame",
                 o.image.native(), o.input.filename().string());
    if (bare > 0) {
        notes.push_back(fmt::format("{} labelled voxels lie outside the image and have {} there{}", bare, missing,
                                    companion.stiffness.points.empty() ? "" : ", for their stiffness too"));
    }
    return companion;
}

// Whether something adds voxels, or asks of labels that are tissue for each.
bool needsOutside(const ImportRequest& o)
{
    return o.hull > 0 || o.bodyFromImage || o.steps.voxel > 0 || o.steps.largest || o.steps.pad > 0;
}

// A body around the labels, as it is asked for; before anything else is done to them.
std::vector<PreparationStep> addBody(const ImportRequest& o, volume::LabelImage& labels,
                                     std::vector<volume::LabelName>& named, const volume::TissueTable& table,
                                     const volume::ImportedImage* image, std::vector<std::string>& notes,
                                     const ImportProgress& tell)
{
    const auto quiet = [&](const std::string& what) { tell(what, {}); };
    if (o.bodyFromImage) {
        const volume::VoxelGrid ct{image->size, image->affine};
        extendToImage(labels, ct);
        tell("resampling the image", {});
        auto hu = volume::resampledImage(ct, image->values, {labels.size, labels.affine}, std::nanf(""));
        return bodyFromImage(labels, named, std::move(hu), table, quiet);
    }
    if (o.hull == 0) {
        return {};
    }
    notes.push_back(
        fmt::format("the body around the labels is invented: {:g} mm of soft tissue and skin that no image "
                    "shows",
                    1e3 * o.hull));
    return bodyFromHull(labels, named, o.hull, table, quiet);
}

volume::Provenance provenanceOf(const ImportRequest& o, const volume::LabelImage& image,
                                const std::vector<std::string>& notes, const std::vector<PreparationStep>& steps)
{
    base::Fnv hash;  // of the label values, x fastest: the same voxels give the same hash whatever file they came in
    hash.addAll(image.values);
    volume::Provenance provenance = {{"source", o.input.filename().string()},
                                     {"label hash", fmt::format("{:016x}", hash.value)},
                                     {"imported", fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(std::time(nullptr)))},
                                     {"program", std::string(base::build())}};
    std::error_code none;
    if (fs::is_regular_file(o.input, none)) {
        provenance.insert(provenance.begin() + 1, {"bytes", std::to_string(fs::file_size(o.input))});
    }
    if (!o.image.empty()) {
        provenance.emplace_back("image file", o.image.filename().string());
    }
    if (!o.stiffness.empty()) {
        provenance.emplace_back("stiffness", fmt::format("scaled by the image, map {}", o.stiffness));
    }
    for (const PreparationStep& step : steps) {
        provenance.emplace_back(volume::stepKey, step.text);
    }
    for (const std::string& note : notes) {
        provenance.emplace_back(volume::warningKey, note);
    }
    for (const PreparationStep& step : steps) {
        if (!step.warning.empty()) {
            provenance.emplace_back(volume::warningKey, step.warning);
        }
    }
    return provenance;
}

// What became of voxels that several segments hold: in one note, or with --verbose in one for each pair.
void noteOverlaps(const volume::ImportedLabels& labels, bool verbose, std::vector<std::string>& notes)
{
    const auto nameOf = [&](std::uint16_t value) {
        const auto n = std::ranges::find(labels.names, value, &volume::LabelName::value);
        return n == labels.names.end() ? fmt::format("label {}", value) : n->name;
    };
    std::uint64_t all = 0;
    const volume::Overlap* most = nullptr;
    for (const volume::Overlap& o : labels.overlaps) {
        all += o.voxels;
        most = most == nullptr || o.voxels > most->voxels ? &o : most;
        if (verbose || labels.overlaps.size() == 1) {
            notes.push_back(fmt::format("{} voxels of '{}' lie in '{}' too, which has them: --overlap says otherwise",
                                        o.voxels, nameOf(o.lost), nameOf(o.kept)));
        }
    }
    if (!verbose && labels.overlaps.size() > 1) {
        notes.push_back(
            fmt::format("{} voxels lie in several segments, in {} pairs of them, the most of '{}' in '{}' ({}): "
                        "--overlap says who has them, --verbose lists each pair",
                        all, labels.overlaps.size(), nameOf(most->lost), nameOf(most->kept), most->voxels));
    }
}

void checkLength(const LengthBounds& bounds, double length)
{
    if (length != 0.0) {
        base::lengthWithin(bounds.option, fmt::format("{:g}mm", 1e3 * length), length, bounds.least, bounds.most);
    }
}

void checkBody(const ImportRequest& request, const volume::LabelImage& image)
{
    try {
        volume::checkImage(image);
    } catch (const std::runtime_error& e) {
        throw std::runtime_error(request.input.string() + ": " + e.what());
    }
}

}  // namespace

void checkRequest(const ImportRequest& o)
{
    checkLength(voxelBounds, o.steps.voxel);
    checkLength(sliceBounds, o.reading.sliceSpacing);
    checkLength(skinBounds, o.steps.addSkin);
    checkLength(hullBounds, o.hull);
    checkLength(padBounds, o.steps.pad);
    checkLength(cropBounds, o.steps.cropMargin);
    checkLength(holesBounds, o.steps.closeSkinHoles.value_or(0.0));
    base::failIf(!o.stiffness.empty() && o.image.empty(), "--stiffness-from: needs the image: add --image FILE");
    base::failIf(o.bodyFromImage && o.image.empty(), "--body-from-image: needs the image: add --image FILE");
    base::failIf(!o.imageUnit.empty() && o.image.empty(), "--image-unit: needs the image: add --image FILE");
    base::failIf(o.imageVolume > 0 && o.image.empty(), "--image-volume: needs the image: add --image FILE");
    base::failIf(!o.imageAxes.empty() && o.image.empty(), "--image-axes: needs the image: add --image FILE");
    base::failIf(!o.imageSeries.empty() && o.image.empty(), "--image-series: needs the image: add --image FILE");
    base::failIf(o.ignoreFrame && o.image.empty(), "--ignore-frame-of-reference: needs the image: add --image FILE");
    std::error_code none;
    base::failIf(!o.imageSeries.empty() && fs::exists(o.image, none) && !isFolder(o.image),
                 "--image-series: the image is no folder of DICOM: leave --image-series out");
    base::failIf(!o.reading.series.empty() && fs::exists(o.input, none) && !isFolder(o.input) && !isFolder(o.image),
                 "--series: neither the labels nor the image are a folder of DICOM: leave --series out");
    base::failIf(!o.reading.series.empty() && !o.imageSeries.empty() && !isFolder(o.input),
                 "--series: the labels are one file: leave --series out");
}

void checkReplaced(const ImportRequest& o, const std::vector<fs::path>& outputs)
{
    std::error_code none;
    if (std::ranges::none_of(outputs, [&](const fs::path& file) { return fs::is_regular_file(file, none); })) {
        return;
    }
    std::vector<fs::path> files = volume::filesOf(o.input);
    if (!o.image.empty()) {
        const std::vector<fs::path> more = volume::filesOf(o.image);
        files.insert(files.end(), more.begin(), more.end());
    }
    std::vector<std::string> notes;
    if (const auto found = o.mapping.names.empty() ? datasetOf(o.input, notes) : std::nullopt) {
        files.push_back(*found);
    }
    base::checkOutputs(outputs, files);
}

NamedLabels readLabels(const ImportRequest& request, const ImportProgress& tell)
{
    tell("checking the file", {});
    volume::ImportOptions reading = request.reading;
    reading.progress = [&](double fraction) { tell("reading", fraction); };
    NamedLabels read;
    read.labels = volume::importLabels(request.input, reading);
    tell("counting labels", {});
    read.counts = countLabels(read.labels.image);
    addNames(request.mapping, request.input, read.counts, read.labels);
    return read;
}

ImportedVolume importVolume(const ImportRequest& request, const volume::TissueTable& table, const ImportProgress& tell)
{
    checkRequest(request);
    auto [labels, counts] = readLabels(request, tell);
    std::vector<std::string> notes = labels.warnings;
    noteOverlaps(labels, request.mapping.verbose, notes);
    std::vector<volume::LabelName> named = mapLabels(request.mapping, request.input, labels, counts, table, notes);
    auto image = request.image.empty() ? std::nullopt : std::optional(readImage(request, labels, notes, tell));
    std::vector<PreparationStep> steps;
    const auto done = [&](std::vector<PreparationStep> more) {
        steps.insert(steps.end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
    };
    if (needsOutside(request)) {
        done(separateOutside(labels.image, named, table));
    }
    done(addBody(request, labels.image, named, table, image ? &*image : nullptr, notes, tell));
    done(prepare(labels.image, named, table, request.steps, [&](const std::string& what) { tell(what, {}); }));
    std::optional<volume::CompanionImage> companion;
    if (image) {
        tell("resampling the image", {});
        companion = companionOf(request, *image, labels.image, table, notes);
        image.reset();
    }
    tell("making tissue", {});
    checkBody(request, labels.image);
    volume::Provenance provenance = provenanceOf(request, labels.image, notes, steps);
    auto tissue =
        volume::Tissue::fromLabels(labels.image, table, named, std::move(provenance), companion ? &*companion : nullptr);
    return {std::move(tissue), std::move(labels.overlaps), std::move(steps)};
}

}  // namespace palpate::prepare
