#include <volume/import/dicom.h>
#include <volume/import/dicom_file.h>
#include <volume/import/label_sink.h>

#include <fmt/ranges.h>

#include <algorithm>
#include <array>

namespace palpate::volume {

namespace {

using Objects = std::vector<DicomObject>;
using SeriesList = std::map<std::string, Objects>;  // by SeriesInstanceUID

enum class Purpose : std::uint8_t { labels, image };

std::string kindOf(const DicomObject& object)
{
    return object.description.empty() ? object.modality : fmt::format("{} '{}'", object.modality, object.description);
}

std::string listOf(const SeriesList& series)
{
    std::vector<std::string> list;
    for (const auto& [uid, objects] : series) {
        if (list.size() == 5) {
            list.emplace_back("...");
            break;
        }
        list.push_back(fmt::format("{} ({}, {} files)", uid, kindOf(objects[0]), objects.size()));
    }
    return fmt::format("{}", fmt::join(list, ", "));
}

bool isSegmentation(const DicomObject& object)
{
    return !object.segmentationType.empty();
}

// All files with pixels; `bare` gets those without.
SeriesList seriesIn(const std::filesystem::path& path, const Files& files, Objects& bare)
{
    SeriesList series;
    for (const std::filesystem::path& file : files) {
        DicomObject object = readDicom(file);
        refuseIf(files.size() == 1 && !object.pixels, path,
                 "is DICOM without pixels (modality '{}'): name the series, or a DICOM SEG", object.modality);
        if (object.pixels) {
            series[object.series].push_back(std::move(object));
        } else if (!object.directory) {
            refuseIf(object.series.empty(), file,
                     "is DICOM that belongs to no series, so it is cut short or damaged: get it again, or take it out of "
                     "the folder");
            bare.push_back(std::move(object));
        }
    }
    refuseIf(series.empty(), path, "holds DICOM files, but none with pixels: name a folder with one series");
    return series;
}

// A slice that lost its pixels would be missing without a word where it is the first or the last. Of other series only
// where the user did not name one.
void checkWhole(const Objects& bare, const std::string& chosen, bool named)
{
    for (const DicomObject& o : bare) {
        refuseIf(o.series == chosen || (o.bare && !named), o.file,
                 "is a DICOM image without its pixels, so it is cut short or damaged: get it again, or take it out of the "
                 "folder");
    }
}

// The series to be read among several.
SeriesList::iterator oneOf(const std::filesystem::path& path, SeriesList& series, const ImportOptions& options,
                           const char* option, std::vector<std::string>& warnings)
{
    SeriesList::iterator found = series.end();
    std::size_t ofLabels = 0;
    for (auto s = series.begin(); s != series.end(); ++s) {
        if (std::ranges::count(options.seriesOfLabels, s->first) > 0) {
            found = s;
            ++ofLabels;
        }
    }
    refuseIf(ofLabels != 1, path, "holds {} series: say which with {}, or name one file: {}", series.size(), option,
             listOf(series));
    warnings.push_back(
        fmt::format("of its {} series, {} is taken: the labels were made of it", series.size(), found->first));
    return found;
}

// The files of the one series that is meant.
Objects chosen(const std::filesystem::path& path, const Files& files, const ImportOptions& options, Purpose purpose,
               std::vector<std::string>& warnings)
{
    const bool folder = files[0] != path;
    const std::string wanted = folder ? options.series : "";
    const char* const option = purpose == Purpose::image ? "--image-series" : "--series";
    Objects bare;
    SeriesList series = seriesIn(path, files, bare);
    const bool images = std::ranges::any_of(series, [](const auto& s) { return !isSegmentation(s.second[0]); });
    if (purpose == Purpose::image && images) {
        std::erase_if(series, [](const auto& s) { return isSegmentation(s.second[0]); });
    }
    const auto found = !wanted.empty()     ? series.find(wanted)
                       : series.size() > 1 ? oneOf(path, series, options, option, warnings)
                                           : series.begin();
    refuseIf(found == series.end(), path, "{} {} is not there: name one of these: {}", option, wanted, listOf(series));
    checkWhole(bare, found->first, !wanted.empty());
    return std::move(found->second);
}

// The frame of reference of a series, which has one; empty where no file says it.
std::string frameOf(const std::filesystem::path& path, const Objects& objects)
{
    const DicomObject* first = nullptr;
    for (const DicomObject& o : objects) {
        if (first != nullptr && !o.frame.empty() && o.frame != first->frame) {
            refuse(path,
                   "its slices have different frames of reference ({} in {}, {} in {}), so their places do not fit "
                   "together: put each into a folder of its own",
                   first->frame, first->file.filename().string(), o.frame, o.file.filename().string());
        }
        first = first == nullptr && !o.frame.empty() ? &o : first;
    }
    return first == nullptr ? "" : first->frame;
}

// A series of a modality is an image, however few values it has: few values are no labels.
void checkNoImage(const std::filesystem::path& path, const DicomObject& object, const ImportOptions& options)
{
    constexpr std::array<const char*, 10> imaging = {"CT", "MR", "PT", "NM", "US", "XA", "MG", "CR", "DX", "RF"};
    const bool image = std::any_of(imaging.begin(), imaging.end(), [&](const char* m) { return object.modality == m; });
    refuseIf(image && !options.dicomLabels, path,
             "is a DICOM series of modality {}, so an image: give the segmentation that was made of it, "
             "or add --dicom-labels if its values are labels",
             object.modality);
}

}  // namespace

ImportedLabels dicomLabels(const std::filesystem::path& path, const Files& files, const ImportOptions& options)
{
    std::vector<std::string> warnings;
    const Objects objects = chosen(path, files, options, Purpose::labels, warnings);
    if (std::ranges::any_of(objects, isSegmentation)) {
        refuseIf(objects.size() > 1, path, "holds {} DICOM SEG files of one series: name one of them", objects.size());
        ImportedLabels labels = readSegmentation(objects[0], options);
        labels.frame = objects[0].frame;
        labels.madeOf = objects[0].madeOf;
        return labels;
    }
    refuseSegmentationOptions(path, options);
    checkNoImage(path, objects[0], options);
    DicomVolume volume = readSeries(path, objects, options.sheared, options.progress);
    ImportedLabels out;
    out.frame = frameOf(path, objects);
    out.image.size = volume.size;
    out.image.affine = volume.affine;
    LabelSink sink(path, volume.size, LabelRules(true, options));
    std::vector<double> row;
    for (std::size_t at = 0; at < volume.values.size(); at += row.size()) {
        const std::size_t count = std::min<std::size_t>(65536, volume.values.size() - at);
        row.assign(volume.values.begin() + static_cast<std::ptrdiff_t>(at),
                   volume.values.begin() + static_cast<std::ptrdiff_t>(at + count));
        sink.add(row);
    }
    volume.values = {};
    out.warnings = std::move(volume.warnings);
    sink.finish(false, out);
    return out;
}

ImportedImage dicomImage(const std::filesystem::path& path, const Files& files, const ImportOptions& options)
{
    std::vector<std::string> warnings;
    const Objects objects = chosen(path, files, options, Purpose::image, warnings);
    refuseIf(isSegmentation(objects[0]), path, "is a DICOM SEG, not an image: name the series that it was made of");
    DicomVolume volume = readSeries(path, objects, true, options.progress);
    ImportedImage out;
    out.size = volume.size;
    out.affine = volume.affine;
    out.values = std::move(volume.values);
    out.what = volume.hounsfield ? "HU" : "";
    out.frame = frameOf(path, objects);
    out.warnings = std::move(warnings);
    out.warnings.insert(out.warnings.end(), volume.warnings.begin(), volume.warnings.end());
    makeFinite(path, out.values, out.warnings);
    return out;
}

}  // namespace palpate::volume
