#include <base/error.h>
#include <base/inputs.h>
#include <volume/import.h>
#include <volume/import/barrier.h>
#include <volume/import/dicom.h>
#include <volume/import/header_text.h>
#include <volume/import/label_sink.h>
#include <volume/import/segments.h>
#include <volume/import/source.h>

#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <optional>

namespace palpate::volume {

namespace {

constexpr double smallest = 5.0;  // of a body: what is smaller in all may have another unit than its file says [mm]

// The direction that a letter of "LPS" names, in LPS; none for other letters.
std::optional<std::pair<int, double>> directionOf(char letter)
{
    constexpr std::array<const char*, 2> letters = {"LPS", "RAI"};
    for (std::size_t sign = 0; sign < 2; ++sign) {
        for (int axis = 0; axis < 3; ++axis) {
            if (letters[sign][axis] == letter) {
                return std::pair(axis, sign == 0 ? 1.0 : -1.0);
            }
        }
    }
    return std::nullopt;
}

// The axes that `axes` names, as columns in LPS.
Mat3 frameOf(const std::string& axes)
{
    Mat3 frame(0.0);
    std::array<bool, 3> used{};
    bool sound = axes.size() == 3;
    for (std::size_t k = 0; sound && k < 3; ++k) {
        const auto direction = directionOf(axes[k]);
        sound = direction && !used[static_cast<std::size_t>(direction->first)];
        if (sound) {
            used[static_cast<std::size_t>(direction->first)] = true;
            frame[static_cast<int>(k)][direction->first] = direction->second;
        }
    }
    base::failIf(!sound,
                 "--axes {}: must be three letters, one of L R, one of P A, one of S I: the sides of the patient to "
                 "which the axes of the file run, as LPS or RAS",
                 axes);
    return frame;
}

bool isVdb(const std::filesystem::path& file)
{
    return lowerCase(file.extension().string()) == ".vdb";
}

using SourceReader = Source (*)(const std::filesystem::path&);

// The reader by the name's ending; none for other names.
SourceReader readerFor(const std::filesystem::path& file)
{
    const std::string name = lowerCase(file.filename().string());
    const auto ends = [&](std::initializer_list<const char*> endings) {
        return std::ranges::any_of(endings, [&](const char* e) { return name.ends_with(e); });
    };
    if (ends({".nii", ".nii.gz", ".hdr", ".hdr.gz", ".img", ".img.gz"})) {
        return readNifti;
    }
    return ends({".nrrd", ".nhdr"}) ? readNrrd
           : ends({".mha", ".mhd"}) ? readMeta
           : ends({".mgz", ".mgh"}) ? readMgh
                                    : nullptr;
}

void checkFile(const std::filesystem::path& file)
{
    if (const std::string why = base::whyNoFile(file); !why.empty()) {
        refuse(file, "{}", why);
    }
    std::ifstream in(file, std::ios::binary);
    std::string start(23, '\0');
    in.read(start.data(), static_cast<std::streamsize>(start.size()));
    refuseIf(in.gcount() == 0, file, "{}",
             in.is_open() ? "is empty: get the file again" : "cannot be opened: check the permissions");
    refuseIf(start.rfind("version https://git-lfs", 0) == 0, file,
             "is a git-LFS pointer, not the data: run 'git lfs pull' where it came from");
}

ImportedLabels labelsOf(Source source, const ImportOptions& options)
{
    ImportedLabels out;
    out.image.size = source.size;
    out.image.affine = source.affine;
    if (source.layers > 1) {
        flatten(source.header, layeredSegments(source, options), options, out);
    } else {
        LabelSink sink(source.header, source.size, LabelRules(source.scaled, options));
        decode(source, options.progress, [&](std::span<const double> values) { sink.add(values); });
        std::ranges::transform(source.segments, std::back_inserter(out.names), &SegmentName::label);
        sink.finish(source.label, out);
        if (!options.overlap.empty()) {
            out.warnings.emplace_back("--overlap decides nothing: a voxel of it has one label");
        }
    }
    // What the header left to choose comes first.
    out.warnings.insert(out.warnings.begin(), source.warnings.begin(), source.warnings.end());
    return out;
}

Source checkedSource(const std::filesystem::path& file, const ImportOptions& options, bool sheared)
{
    Source source = readSource(file);
    chooseVolume(source, options);
    placeAxes(source, options);
    checkAffine(file, source.affine, sheared, source.warnings);
    checkBytes(source);
    for (SegmentName& s : source.segments) {
        s.label.name = printable(s.label.name);
    }
    return source;
}

// Texts of the file end up on terminals and in other files.
void clean(std::vector<std::string>& texts)
{
    std::transform(texts.begin(), texts.end(), texts.begin(), printable);
}

ImportedLabels readLabels(const std::filesystem::path& path, const ImportOptions& options)
{
    if (std::error_code error; std::filesystem::is_directory(path, error)) {
        return folderLabels(path, options);
    }
    checkFile(path);
    if (isVdb(path)) {
        refuseVolume(path, options);
        refuseSegmentationOptions(path, options);
        return labelsApart(path, "OpenVDB", options, [&](const ImportOptions& o) { return vdbLabels(path, o); });
    }
    if (isDicom(path)) {
        refuseAxes(path, options);
        refuseVolume(path, options);
        return labelsApart(path, dicomLibrary, options,
                           [&](const ImportOptions& o) { return dicomLabels(path, {path}, o); });
    }
    refuseSegmentationOptions(path, options);
    ImportedLabels labels = labelsOf(checkedSource(path, options, options.sheared), options);
    if (options.dicomLabels) {
        labels.warnings.emplace_back("--dicom-labels decides nothing: it is no DICOM");
    }
    return labels;
}

}  // namespace

Index3 checkedVolumes(const std::filesystem::path& file, std::vector<std::int64_t> sizes, Source& source)
{
    if (sizes.size() <= 3) {
        return checkedSize(file, sizes);
    }
    std::uint64_t volumes = 1;
    for (std::size_t i = 3; i < sizes.size(); ++i) {
        refuseIf(sizes[i] < 1 || sizes[i] > 32767 || volumes > 32767, file,
                 "its size is {}: each side must be 1 to 32767, save it again", fmt::join(sizes, " x "));
        volumes *= static_cast<std::uint64_t>(sizes[i]);
    }
    source.dimensions = fmt::format("{}", fmt::join(sizes, " x "));
    sizes.resize(3);
    const Index3 size = checkedSize(file, sizes);
    source.volumes = volumes;
    source.volumeInner = static_cast<std::uint64_t>(sizes[0] * sizes[1] * sizes[2]);
    return size;
}

void chooseVolume(Source& source, const ImportOptions& options)
{
    if (options.volume > 0 && source.layers > 1) {
        std::swap(source.volumes, source.layers);
        source.volumeInner = source.inner;
        source.inner = 1;
        std::erase_if(source.segments,
                      [&](const SegmentName& s) { return s.layer + 1 != static_cast<std::uint64_t>(options.volume); });
    }
    refuseIf(static_cast<std::uint64_t>(options.volume) > source.volumes, source.header, "--volume {}: it holds {}",
             options.volume, source.volumes == 1 ? "one volume" : fmt::format("{} volumes", source.volumes));
    refuseIf(source.volumes > 1 && options.volume == 0, source.header,
             "holds {} volumes, or as many values per voxel ({}): choose one with --volume N, or --image-volume N "
             "where it is the image",
             source.volumes, source.dimensions);
    source.volume = source.volumes > 1 ? static_cast<std::uint64_t>(options.volume) - 1 : 0;
}

void refuseAxes(const std::filesystem::path& file, const ImportOptions& options)
{
    refuseIf(!options.axes.empty() && !options.axesIfUnsaid, file,
             "--axes {}: it says itself where its axes run: leave --axes out", options.axes);
}

void refuseVolume(const std::filesystem::path& file, const ImportOptions& options)
{
    refuseIf(options.volume > 1, file, "--volume {}: it holds one volume", options.volume);
}

void refuseThreshold(const std::filesystem::path& file, const ImportOptions& options)
{
    refuseIf(options.fractionalThreshold.has_value(), file,
             "--threshold {:g}: it is no fractional DICOM SEG, and holds no probabilities: leave --threshold out",
             options.fractionalThreshold.value_or(0.0F));
}

void refuseSegmentationOptions(const std::filesystem::path& file, const ImportOptions& options)
{
    refuseThreshold(file, options);
    refuseIf(options.sliceSpacing > 0, file, "--slice-spacing {:g}: it is no DICOM SEG: leave --slice-spacing out",
             1e3 * options.sliceSpacing);
}

void placeAxes(Source& source, const ImportOptions& options)
{
    if (source.oriented) {
        refuseAxes(source.header, options);
    } else if (source.assumed && options.axes.empty()) {
        source.affine = *source.assumed;
    } else {
        placeAxes(options, source.affine, source.warnings);
    }
}

void placeAxes(const ImportOptions& options, Affine& affine, std::vector<std::string>& warnings)
{
    if (options.axes.empty()) {
        warnings.emplace_back(
            "it does not say which side is left: its axes are taken as left, posterior, superior; --axes says "
            "otherwise, of an image --image-axes");
        return;
    }
    const Mat3 frame = frameOf(options.axes);
    affine.linear = frame * affine.linear;
    affine.origin = frame * affine.origin;
}

bool hasSourceName(const std::filesystem::path& file)
{
    return readerFor(file) != nullptr;
}

Source readSource(const std::filesystem::path& file)
{
    checkFile(file);
    const SourceReader reader = readerFor(file);
    refuseIf(reader == nullptr, file,
             "is no format that is read: NIfTI (.nii, .nii.gz, .hdr/.img), NRRD (.nrrd, .nhdr), MetaImage (.mha, .mhd), "
             "FreeSurfer (.mgz), DICOM or OpenVDB (.vdb)");
    return reader(file);
}

std::vector<std::filesystem::path> filesOf(const std::filesystem::path& path)
{
    std::error_code error;
    if (std::filesystem::is_directory(path, error)) {
        return filesOfFolder(path);
    }
    if (readerFor(path) == nullptr) {
        return {path};
    }
    const Source source = readSource(path);
    return {path, source.header, source.data};
}

std::int64_t ImportedLabels::originalOf(std::uint16_t value) const noexcept
{
    const auto found = std::ranges::find(renumbered, value, &Renumbered::value);
    return found == renumbered.end() ? value : found->original;
}

ImportedLabels importLabels(const std::filesystem::path& path, const ImportOptions& options)
{
    ImportedLabels out = readLabels(path, options);
    const Vec3 extent = 1e3 * out.image.affine.spacing() * Vec3(out.image.size);
    if (std::max({extent.x, extent.y, extent.z}) < smallest) {
        out.warnings.push_back(fmt::format("is {:.2g} x {:.2g} x {:.2g} mm in all: check the unit in its header", extent.x,
                                           extent.y, extent.z));
    }
    clean(out.warnings);
    for (LabelName& n : out.names) {
        n.name = printable(n.name);
        n.terminology = printable(n.terminology);
    }
    return out;
}

ImportedImage importImage(const std::filesystem::path& path, const ImportOptions& options)
{
    std::error_code error;
    const bool folder = std::filesystem::is_directory(path, error);
    if (!folder) {
        checkFile(path);
    }
    refuseIf(!folder && isVdb(path), path, "is OpenVDB, of which only labels are read: save the image as NIfTI");
    if (folder || isDicom(path)) {
        const Files files = folder ? dicomFilesIn(path) : Files{path};
        refuseAxes(path, options);
        refuseVolume(path, options);
        return imageApart(path, dicomLibrary, options, [&](const ImportOptions& o) { return dicomImage(path, files, o); });
    }
    Source source = checkedSource(path, options, true);
    refuseIf(source.layers > 1, path, "has {} layers: an image has one, choose it with --image-volume N", source.layers);
    ImportedImage out;
    out.size = source.size;
    out.affine = source.affine;
    out.values.reserve(static_cast<std::size_t>(source.voxels()));
    decode(source, options.progress, [&](std::span<const double> values) {
        std::transform(values.begin(), values.end(), std::back_inserter(out.values),
                       [](double v) { return static_cast<float>(v); });
    });
    out.warnings = std::move(source.warnings);
    makeFinite(path, out.values, out.warnings);
    clean(out.warnings);
    return out;
}

}  // namespace palpate::volume
