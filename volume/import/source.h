#pragma once

#include <base/cells.h>
#include <volume/geometry.h>
#include <volume/import.h>
#include <volume/import/header_text.h>
#include <volume/import/unpack.h>
#include <volume/label_image.h>

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

// Inside volume/import/ only: what the readers of the formats with a header and one stream of voxels agree on.
namespace palpate::volume {

enum class Component : std::uint8_t { u8, i8, u16, i16, u32, i32, u64, i64, f32, f64 };

constexpr std::uint64_t bytesOf(Component c)
{
    constexpr std::array<std::uint64_t, 10> bytes = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
    return bytes[static_cast<std::size_t>(c)];
}

/// A segment that a header names, and where its voxels are: those with `value` in layer `layer`.
struct SegmentName {
    LabelName label;
    std::uint64_t layer = 0;
};

/// What a header says, and where its voxels are.
struct Source {
    std::filesystem::path header;
    std::filesystem::path data;  // the file with the voxels; often the header's own
    Index3 size{0};
    Affine affine;
    Component component = Component::u8;
    bool bigEndian = false;
    Encoding encoding = Encoding::raw;
    std::uint64_t offset = 0;   // where the voxel stream begins in `data`
    std::uint64_t skip = 0;     // bytes before the voxels in the decoded stream
    bool fromEnd = false;       // the voxels are the last bytes of the stream; skip is then unknown
    std::uint64_t trailer = 0;  // bytes that may follow the voxels
    bool scaled = false;        // the values meant are slope * stored + intercept
    double slope = 1;
    double intercept = 0;
    std::uint64_t layers = 1;       // segmentations of the same space in one stream
    std::uint64_t inner = 1;        // how many elements of one layer follow each other before the next layer's
    std::uint64_t volumes = 1;      // of four dimensions; chooseVolume() picks one
    std::uint64_t volumeInner = 1;  // how many elements of one volume follow each other before the next one's
    std::uint64_t volume = 0;       // the one that is read
    std::string dimensions;         // all sizes, where there are volumes
    bool oriented = true;           // the header says where the voxel axes go
    std::optional<Affine> assumed;  // else: its place as the program of that format assumes it, where --axes is not given
    bool label = false;             // the file says itself that it is a label map
    std::vector<SegmentName> segments;
    std::vector<std::string> warnings;

    std::uint64_t voxels() const { return base::countOf(size); }
    std::uint64_t elements() const { return voxels() * layers * volumes; }
};

Source readNifti(const std::filesystem::path& file);
Source readNrrd(const std::filesystem::path& file);
Source readMeta(const std::filesystem::path& file);
Source readMgh(const std::filesystem::path& file);

/// The reader by the file's name; refuses what none is for, and what is no volume at all (empty, git-LFS pointer).
Source readSource(const std::filesystem::path& file);
/// True for the name of a file that readSource() reads.
bool hasSourceName(const std::filesystem::path& file);

/// The header's promise against the bytes that are there; sets `skip` where the voxels are the last of them.
void checkBytes(Source& source);

/// The voxels in the order of the file, slope and intercept applied, a piece at a time.
void decode(const Source& source, const std::function<void(double)>& progress,
            const std::function<void(std::span<const double>)>& sink);

/// Throws std::runtime_error with the file's name and why it is not read, a format with its values.
template <typename... Values>
[[noreturn]] void refuse(const std::filesystem::path& file, fmt::format_string<Values...> why, Values&&... values)
{
    throw std::runtime_error(
        printable(fmt::format("{}: {}", file.native(), fmt::format(why, std::forward<Values>(values)...))));
}

/// The same if `wrong`. The values are evaluated in any case: name only such as can be.
template <typename... Values>
void refuseIf(bool wrong, const std::filesystem::path& file, fmt::format_string<Values...> why, Values&&... values)
{
    if (wrong) {
        refuse(file, why, std::forward<Values>(values)...);
    }
}

/// The three sizes of a header, each in 1..32767 and not too many voxels, so that nothing absurd is allocated.
Index3 checkedSize(const std::filesystem::path& file, const std::vector<std::int64_t>& sizes);

/// The size of one volume from all sizes of a header: those beyond three dimensions are counted in `source.volumes`.
Index3 checkedVolumes(const std::filesystem::path& file, std::vector<std::int64_t> sizes, Source& source);

/// Picks options.volume of a source with four dimensions, or refuses it; the layers of a .seg.nrrd count as volumes then.
void chooseVolume(Source& source, const ImportOptions& options);

/// Where the voxel axes go that a header does not say: options.axes, else where the program of that format assumes them,
/// else left, posterior, superior, with a warning. The one rule for all formats.
void placeAxes(Source& source, const ImportOptions& options);
/// The same of axes that a file never says.
void placeAxes(const ImportOptions& options, Affine& affine, std::vector<std::string>& warnings);
/// Refuses options.axes for a file that says where its axes run, and options.volume for one that can hold one volume alone.
void refuseAxes(const std::filesystem::path& file, const ImportOptions& options);
void refuseVolume(const std::filesystem::path& file, const ImportOptions& options);
/// Refuses options.fractionalThreshold for labels without probabilities.
void refuseThreshold(const std::filesystem::path& file, const ImportOptions& options);
/// Refuses all that only a DICOM SEG takes.
void refuseSegmentationOptions(const std::filesystem::path& file, const ImportOptions& options);

/// How far two placements of the same voxels are apart at most, in voxels of `a`.
double voxelsApart(const Affine& a, const Affine& b, Index3 size);

/// Refuses spacings that are not positive and finite, and sheared axes unless `sheared`, which leave a warning.
void checkAffine(const std::filesystem::path& file, const Affine& affine, bool sheared, std::vector<std::string>& warnings);

/// Values of an image: what is not a number takes the smallest value that is one, with a warning.
void makeFinite(const std::filesystem::path& file, std::vector<float>& values, std::vector<std::string>& warnings);

}  // namespace palpate::volume
