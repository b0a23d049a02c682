#include <volume/import/dicom.h>
#include <volume/import/dicom_file.h>
#include <volume/import/label_sink.h>

#include <fmt/ranges.h>

#include <algorithm>
#include <array>

namespace palpate::volume {

namespace {

using Objects = std::vector<DicomObject>;

std::string kindOf(const DicomObject& object)
{
    return object.description.empty() ? object.modality : fmt::format("{} '{}'", object.modality, object.description);
}

std::string listOf(const std::map<std::string, Objects>& series)
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

// The one series that is meant.
Objects chosen(const std::filesystem::path& path, const Files& files, const std::string& wanted)
{
    std::map<std::string, Objects> series;
    for (const std::filesystem::path& file : files) {
        DicomObject object = readDicom(file);
        if (object.pixels) {
            series[object.series].push_back(std::move(object));
        } else if (files.size() == 1) {
            refuse(path, "is DICOM without pixels (modality '{}'): name the series, or a DICOM SEG", object.modality);
        }
    }
    refuseIf(series.empty(), path, "holds DICOM files, but none with pixels: name a folder with one series");
    if (!wanted.empty()) {
        const auto found = series.find(wanted);
        refuseIf(found == series.end(), path, "--series {} is not there: name one of these: {}", wanted, listOf(series));
        return std::move(found->second);
    }
    refuseIf(series.size() > 1, path, "holds {} series: say which with --series, or name one file: {}", series.size(),
             listOf(series));
    return std::move(series.begin()->second);
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
    const Objects objects = chosen(path, files, options.series);
    const auto segmentations =
        std::count_if(objects.begin(), objects.end(), [](const DicomObject& o) { return !o.segmentationType.empty(); });
    if (segmentations > 0) {
        refuseIf(objects.size() > 1, path, "holds {} DICOM SEG files of one series: name one of them", objects.size());
        return readSegmentation(objects[0], options);
    }
    refuseThreshold(path, options);
    checkNoImage(path, objects[0], options);
    DicomVolume volume = readSeries(path, objects, options.sheared, options.progress);
    ImportedLabels out;
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
    const Objects objects = chosen(path, files, options.series);
    refuseIf(!objects[0].segmentationType.empty(), path,
             "is a DICOM SEG, not an image: name the series that it was made of");
    DicomVolume volume = readSeries(path, objects, true, options.progress);
    ImportedImage out;
    out.size = volume.size;
    out.affine = volume.affine;
    out.values = std::move(volume.values);
    out.what = volume.hounsfield ? "HU" : "";
    out.warnings = std::move(volume.warnings);
    makeFinite(path, out.values, out.warnings);
    return out;
}

}  // namespace palpate::volume
