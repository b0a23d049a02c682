#include <volume/import.h>
#include <volume/import_source.h>
#include <volume/unpack.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <cctype>
#include <cmath>
#include <cstring>
#include <fstream>

namespace palpate::volume {

namespace {

constexpr std::size_t mostLabels = 1024;   // more different values than this is an image, not a label map
constexpr std::uint64_t mostPadding = 16;  // bytes
constexpr double mostShear = 2e-3;         // cosine between voxel axes

bool endsWith(const std::string& text, const std::string& ending)
{
    return text.size() >= ending.size() && text.compare(text.size() - ending.size(), ending.size(), ending) == 0;
}

void checkFile(const std::filesystem::path& file)
{
    if (std::filesystem::is_directory(file)) {
        refuse(file, "is a folder: name one NIfTI, NRRD or MetaImage file");
    }
    if (!std::filesystem::is_regular_file(file)) {
        refuse(file, "there is no such file");
    }
    std::ifstream in(file, std::ios::binary);
    std::string start(132, '\0');
    in.read(start.data(), static_cast<std::streamsize>(start.size()));
    start.resize(static_cast<std::size_t>(in.gcount()));
    if (start.empty()) {
        refuse(file, in.is_open() ? "is empty" : "cannot be opened: check the permissions");
    }
    if (start.rfind("version https://git-lfs", 0) == 0) {
        refuse(file, "is a git-LFS pointer, not the data: run 'git lfs pull' where it came from");
    }
    if (start.size() == 132 && start.compare(128, 4, "DICM") == 0) {
        refuse(file, "is DICOM: convert it to NIfTI first (dcm2niix, or segimage2itkimage for a DICOM SEG)");
    }
}

Source readHeader(const std::filesystem::path& file)
{
    std::string name = file.filename().string();
    std::transform(name.begin(), name.end(), name.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    const auto ends = [&](const char* ending) { return endsWith(name, ending); };
    if (ends(".nii") || ends(".nii.gz") || ends(".hdr") || ends(".hdr.gz") || ends(".img") || ends(".img.gz")) {
        return readNifti(file);
    }
    if (ends(".nrrd") || ends(".nhdr")) {
        return readNrrd(file);
    }
    if (ends(".mha") || ends(".mhd")) {
        return readMeta(file);
    }
    if (ends(".vdb")) {
        refuse(file, "is a volume already: 'palpate info' shows it");
    }
    refuse(file,
           "is no format that is read: NIfTI (.nii, .nii.gz, .hdr/.img), NRRD (.nrrd, .nhdr) or MetaImage (.mha, .mhd)");
}

// The header's promise against the bytes that are there. Readers return zeros or what lay in memory for what is missing.
void checkBytes(Source& source)
{
    const std::uint64_t wanted = source.voxels() * bytesOf(source.component);
    const std::uint64_t there = unpackedSize(source.data, source.offset, source.packed);
    if (source.fromEnd && there >= wanted) {
        source.skip = there - wanted;
        return;
    }
    const std::uint64_t expected = source.skip + wanted;
    const std::string sizes =
        fmt::format("its header promises {} x {} x {} voxels of {} bytes, {} in all, but there are {}", source.size.x,
                    source.size.y, source.size.z, bytesOf(source.component), expected, there);
    if (there < expected) {
        refuse(source.header, sizes + ": it is cut short or its header is wrong");
    }
    // A little padding at the end is harmless; what could be a wrong size, or a header of its own, is not.
    const Index3 n = source.size;
    const auto sheet = static_cast<std::uint64_t>(std::min({n.x * n.y, n.y * n.z, n.x * n.z}));
    if (there - expected >= std::min(mostPadding, sheet * bytesOf(source.component))) {
        refuse(source.header, sizes + ": its header is wrong, or the data begin elsewhere");
    }
    if (there > expected) {
        source.warnings.push_back(fmt::format("{} bytes behind the voxels are ignored", there - expected));
    }
}

// Voxels read by what is there, not through ITK.
Pixels ownPixels(const Source& source)
{
    Pixels pixels{source.component, unpackedBytes(source.data, source.offset, source.packed, source.skip,
                                                  source.voxels() * bytesOf(source.component))};
    const std::uint64_t width = bytesOf(source.component);
    if (source.bigEndian != (std::endian::native == std::endian::big) && width > 1) {
        for (std::size_t i = 0; i < pixels.bytes.size(); i += width) {
            std::reverse(pixels.bytes.begin() + static_cast<std::ptrdiff_t>(i),
                         pixels.bytes.begin() + static_cast<std::ptrdiff_t>(i + width));
        }
    }
    return pixels;
}

std::string voxelName(const Source& source, std::size_t at)
{
    const auto nx = static_cast<std::size_t>(source.size.x);
    const auto ny = static_cast<std::size_t>(source.size.y);
    return fmt::format("voxel ({}, {}, {})", at % nx, at / nx % ny, at / nx / ny);
}

// One voxel as a label; refuses what no label map holds.
template <typename T>
std::uint16_t label(const Source& source, T value, std::size_t at)
{
    const double number = source.slope * static_cast<double>(value) + source.intercept;
    if (!std::isfinite(number)) {
        refuse(source.header, fmt::format("{} is not a number ({}): a label map holds whole numbers from 0 to 65535",
                                          voxelName(source, at), number));
    }
    // A slope that is no power of two leaves a rounding of single precision.
    const double whole = std::round(number);
    const double tolerance = source.scaled ? 1e-6 * std::max(1.0, std::abs(number)) : 0.0;
    if (std::abs(number - whole) > tolerance) {
        refuse(source.header,
               fmt::format("{} is {}: a label map holds whole numbers from 0 to 65535, this is an image or a "
                           "probability{}",
                           voxelName(source, at), number, source.scaled ? " (its scl_slope is applied)" : ""));
    }
    if (whole < 0 || whole > 65535) {
        refuse(source.header,
               fmt::format("{} is {}: a label map holds whole numbers from 0 to 65535, so this is not a label map "
                           "but an image: give the segmentation that was made of it",
                           voxelName(source, at), number));
    }
    return static_cast<std::uint16_t>(whole);
}

template <typename T>
std::vector<std::uint16_t> labelsFrom(const Source& source, const Pixels& pixels)
{
    const auto count = static_cast<std::size_t>(source.voxels());
    std::vector<std::uint16_t> labels(count);
    for (std::size_t i = 0; i < count; ++i) {
        T value;
        std::memcpy(&value, pixels.bytes.data() + i * sizeof(T), sizeof(T));
        labels[i] = label(source, value, i);
    }
    return labels;
}

// Most label maps are unsigned bytes, where nothing can be wrong.
std::vector<std::uint16_t> labelsFromBytes(const Source& source, const Pixels& pixels)
{
    const auto count = static_cast<std::ptrdiff_t>(source.voxels());
    std::vector<std::uint16_t> labels(static_cast<std::size_t>(count));
    std::transform(pixels.bytes.begin(), pixels.bytes.begin() + count, labels.begin(),
                   [](std::byte b) { return std::to_integer<std::uint16_t>(b); });
    return labels;
}

std::vector<std::uint16_t> toLabels(const Source& source, const Pixels& pixels)
{
    switch (pixels.component) {
        case Component::u8:
            return source.scaled ? labelsFrom<std::uint8_t>(source, pixels) : labelsFromBytes(source, pixels);
        case Component::i8:
            return labelsFrom<std::int8_t>(source, pixels);
        case Component::u16:
            return labelsFrom<std::uint16_t>(source, pixels);
        case Component::i16:
            return labelsFrom<std::int16_t>(source, pixels);
        case Component::u32:
            return labelsFrom<std::uint32_t>(source, pixels);
        case Component::i32:
            return labelsFrom<std::int32_t>(source, pixels);
        case Component::u64:
            return labelsFrom<std::uint64_t>(source, pixels);
        case Component::i64:
            return labelsFrom<std::int64_t>(source, pixels);
        case Component::f32:
            return labelsFrom<float>(source, pixels);
        case Component::f64:
            return labelsFrom<double>(source, pixels);
    }
    refuse(source.header, "has an unknown type of voxel");
}

void checkValues(const Source& source, const std::vector<std::uint16_t>& labels)
{
    std::vector<bool> seen(65536, false);
    for (const std::uint16_t value : labels) {
        seen[value] = true;
    }
    const auto different = static_cast<std::size_t>(std::count(seen.begin(), seen.end(), true));
    if (different > mostLabels) {
        refuse(source.header,
               fmt::format("has {} different values, so it is not a label map (at most {}) but an image: give the "
                           "segmentation that was made of it",
                           different, mostLabels));
    }
    if (different == 1 && seen[0]) {
        refuse(source.header, "no voxel is set: every label is 0");
    }
}

void checkAffine(const Source& source, const Affine& affine)
{
    const Mat3& m = affine.linear;
    const Vec3 spacing = affine.spacing();
    const bool finite = std::isfinite(affine.voxelVolume()) && std::isfinite(glm::dot(affine.origin, Vec3(1.0)));
    if (!finite || !(spacing.x > 0 && spacing.y > 0 && spacing.z > 0)) {
        refuse(source.header, fmt::format("its voxels are {} x {} x {} mm: the spacing in its header is wrong",
                                          1e3 * spacing.x, 1e3 * spacing.y, 1e3 * spacing.z));
    }
    const double shear = std::max({std::abs(glm::dot(m[0], m[1])) / (spacing.x * spacing.y),
                                   std::abs(glm::dot(m[1], m[2])) / (spacing.y * spacing.z),
                                   std::abs(glm::dot(m[0], m[2])) / (spacing.x * spacing.z)});
    if (shear > mostShear) {
        refuse(source.header, fmt::format("its voxel axes are sheared by {:.1f} degrees (a tilted gantry, or an affine "
                                          "registration): resample it to a straight grid first",
                                          std::asin(std::min(1.0, shear)) * 180.0 / 3.141592653589793));
    }
}

// Where the voxels are: by our own rule, or as ITK reads the header.
Affine placement(const Source& source)
{
    if (source.affine) {
        return *source.affine;
    }
    const ItkHeader header = itkHeader(source);
    if (header.size != source.size || header.component != source.component) {
        refuse(source.header, "its size or type of voxel is read in two ways by two readers: save it again");
    }
    return header.affine;
}

}  // namespace

Index3 checkedSize(const std::filesystem::path& file, const std::vector<std::int64_t>& sizes)
{
    const std::string text = fmt::format("{}", fmt::join(sizes, " x "));
    if (sizes.size() > 3) {
        refuse(file, fmt::format("has {} dimensions ({}): save one volume or one layer of it", sizes.size(), text));
    }
    if (sizes.size() < 3) {
        refuse(file, fmt::format("has {} dimensions ({}): a volume has 3", sizes.size(), text));
    }
    if (std::any_of(sizes.begin(), sizes.end(), [](std::int64_t n) { return n < 1 || n > 32767; })) {
        refuse(file, fmt::format("its size is {}: each side must be 1 to 32767 voxels", text));
    }
    return {static_cast<int>(sizes[0]), static_cast<int>(sizes[1]), static_cast<int>(sizes[2])};
}

ImportedLabels importLabels(const std::filesystem::path& file)
{
    checkFile(file);
    Source source = readHeader(file);
    checkBytes(source);
    const Affine affine = placement(source);
    checkAffine(source, affine);
    ImportedLabels out;
    out.image.size = source.size;
    out.image.affine = affine;
    out.image.values = toLabels(source, source.ours ? ownPixels(source) : itkPixels(source));
    checkValues(source, out.image.values);
    out.names = std::move(source.names);
    out.warnings = std::move(source.warnings);
    return out;
}

}  // namespace palpate::volume
