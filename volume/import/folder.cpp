#include <volume/import/barrier.h>
#include <volume/import/dicom.h>
#include <volume/import/header_text.h>
#include <volume/import/label_sink.h>
#include <volume/import/segments.h>

#include <glm/common.hpp>

#include <algorithm>
#include <fstream>
#include <set>

namespace palpate::volume {

namespace {

Files filesIn(const std::filesystem::path& folder)
{
    Files files;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
        if (entry.is_regular_file() && entry.path().filename().string()[0] != '.') {
            files.push_back(entry.path());
        }
    }
    std::sort(files.begin(), files.end());
    return files;
}

// "liver" of liver.nii.gz.
std::string structureName(const std::filesystem::path& file)
{
    const bool packed = lowerCase(file.extension().string()) == ".gz";
    const std::string name = (packed ? file.stem() : file.filename()).string();
    return printable(name.substr(0, name.rfind('.')));
}

// One label but 0 is inside; more than one is no mask, and neither are the fractions of a probability.
Segment readMask(const Source& source, std::uint16_t value, const ImportOptions& options,
                 const std::function<void(double)>& progress)
{
    Segment segment;
    segment.label = {value, structureName(source.header), ""};
    LabelRules rules(source.scaled, options);
    rules.round = true;  // which one it is does not matter
    double seen = 0;     // the last value
    std::uint16_t label = 0, inside = 0;
    std::uint32_t voxel = 0;
    decode(source, progress, [&](std::span<const double> values) {
        for (const double v : values) {
            if (v != seen) {
                label = LabelSink::label(source.header, v, rules, fmt::format("voxel {}", voxel));
                seen = v;
            }
            if (label != 0) {
                inside = inside == 0 ? label : inside;
                refuseIf(label != inside, source.header,
                         "holds the values {} and {} beside 0, but in a folder of masks each file is "
                         "one structure: name this file alone if it is a label map",
                         inside, label);
                segment.add(voxel);
            }
            ++voxel;
        }
    });
    return segment;
}

void checkSameGrid(const Source& first, const Source& other)
{
    const bool sameSize = first.size == other.size;
    const double apart = voxelsApart(first.affine, other.affine, first.size);
    refuseIf(!sameSize || !(apart < 0.01), other.header,
             "is not on the grid of {} (sizes {} x {} x {} and {} x {} x {}, up to {:.2g} voxels "
             "apart): masks of one folder must share a grid, resample it or leave it out",
             first.header.filename().string(), other.size.x, other.size.y, other.size.z, first.size.x, first.size.y,
             first.size.z, apart);
}

ImportedLabels masks(const std::filesystem::path& folder, const Files& files, const ImportOptions& options)
{
    ImportedLabels out;
    std::vector<Segment> segments;
    Source first;
    for (std::size_t i = 0; i < files.size(); ++i) {
        Source source = readSource(files[i]);
        chooseVolume(source, options);
        placeAxes(source, options);
        checkAffine(files[i], source.affine, options.sheared, source.warnings);
        refuseIf(source.layers > 1, files[i], "has layers of segments, so it is no mask: name this file alone");
        if (i == 0) {
            first = source;
            out.warnings = source.warnings;
        }
        checkSameGrid(first, source);
        checkBytes(source);
        const auto progress = [&](double fraction) {
            if (options.progress) {
                options.progress((static_cast<double>(i) + fraction) / static_cast<double>(files.size()));
            }
        };
        segments.push_back(readMask(source, static_cast<std::uint16_t>(i + 1), options, progress));
    }
    out.image.size = first.size;
    out.image.affine = first.affine;
    flatten(folder, std::move(segments), options, out);
    return out;
}

// The DICOM files among those of a folder. One that is empty, or damaged from its first byte on, is a slice that would be
// missing without a word.
Files dicomAmong(const Files& files)
{
    Files dicom, others;
    std::set<std::string> endings = {".dcm"};
    for (const std::filesystem::path& file : files) {
        const bool ours = isDicom(file);
        (ours ? dicom : others).push_back(file);
        endings.insert(ours ? lowerCase(file.extension().string()) : ".dcm");
    }
    for (const std::filesystem::path& file : others) {
        const std::string ending = lowerCase(file.extension().string());
        std::error_code error;
        const bool empty = std::filesystem::file_size(file, error) == 0;
        refuseIf(ending == ".dcm" || (empty && !dicom.empty() && endings.contains(ending)), file,
                 "{}: get it again, or take it out of the folder",
                 empty ? "is empty, where a DICOM file belongs" : "does not begin as DICOM does, so it is damaged");
    }
    return dicom;
}

}  // namespace

bool isDicom(const std::filesystem::path& file)
{
    std::ifstream in(file, std::ios::binary);
    std::string start(132, '\0');
    in.read(start.data(), static_cast<std::streamsize>(start.size()));
    if (in.gcount() == 132 && start.compare(128, 4, "DICM") == 0) {
        return true;
    }
    // Without a preamble a data set begins with group 8, in little endian.
    const bool group = start[0] == 8 && start[1] == 0 && static_cast<unsigned char>(start[2]) < 0x20 && start[3] == 0;
    return in.gcount() >= 16 && group;
}

Files filesOfFolder(const std::filesystem::path& folder)
{
    Files files;
    for (const std::filesystem::path& file : filesIn(folder)) {
        if (hasSourceName(file) || isDicom(file)) {
            files.push_back(file);
        }
        try {
            const Source source = hasSourceName(file) ? readSource(file) : Source();
            files.insert(files.end(), {source.header, source.data});
        } catch (const std::runtime_error&) {
            continue;  // the import says so, where it reads it at all
        }
    }
    return files;
}

Files dicomFilesIn(const std::filesystem::path& folder)
{
    const Files files = dicomAmong(filesIn(folder));
    refuseIf(files.empty(), folder, "holds no DICOM files: name a folder with one series, or a file");
    return files;
}

ImportedLabels folderLabels(const std::filesystem::path& folder, const ImportOptions& options)
{
    const Files all = filesIn(folder);
    Files volumes, others;
    for (const std::filesystem::path& file : all) {
        if (hasSourceName(file)) {
            // The two files of a pair are one volume.
            const std::string ending = lowerCase(file.extension().string());
            if (ending != ".img" && lowerCase(file.stem().extension().string()) != ".img") {
                volumes.push_back(file);
            }
        } else {
            others.push_back(file);
        }
    }
    const Files dicom = dicomAmong(others);
    refuseIf(!volumes.empty() && !dicom.empty(), folder,
             "holds {} volume files and {} DICOM files: name one of the files, or a folder with one kind", volumes.size(),
             dicom.size());
    if (!dicom.empty()) {
        refuseAxes(folder, options);
        refuseVolume(folder, options);
        return labelsApart(folder, dicomLibrary, options,
                           [&](const ImportOptions& o) { return dicomLabels(folder, dicom, o); });
    }
    refuseIf(volumes.empty(), folder,
             "holds {} files, but no DICOM and no masks (NIfTI, NRRD, MetaImage): name a file, or the "
             "folder that holds them itself",
             all.size());
    refuseIf(!options.series.empty(), folder,
             "--series {}: it holds no DICOM: leave --series out; --image-series is for the image", options.series);
    refuseSegmentationOptions(folder, options);
    refuseIf(volumes.size() > 65535, folder, "holds more than 65535 masks: name a folder with fewer");
    return masks(folder, volumes, options);
}

}  // namespace palpate::volume
