#pragma once

#include <volume/geometry.h>
#include <volume/label_image.h>

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

// Inside volume/ only: what the readers of each format agree on.
namespace palpate::volume {

enum class Component : std::uint8_t { u8, i8, u16, i16, u32, i32, u64, i64, f32, f64 };

constexpr std::uint64_t bytesOf(Component c)
{
    constexpr std::array<std::uint64_t, 10> bytes = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
    return bytes[static_cast<std::size_t>(c)];
}

enum class Format : std::uint8_t { nifti, nrrd, meta };

/// What a header says, by our own reading of it, and where its voxels are.
struct Source {
    Format format = Format::nifti;
    std::filesystem::path header;
    std::filesystem::path data;  // the file with the voxels; often the header's own
    Index3 size{0};
    Component component = Component::u8;
    bool bigEndian = false;
    std::uint64_t offset = 0;  // where the voxel stream begins in `data`
    bool packed = false;       // the stream is deflated, whatever the header says
    std::uint64_t skip = 0;    // bytes before the voxels in the inflated stream
    bool fromEnd = false;      // the voxels are the last bytes of the stream; skip is then unknown
    bool ours = false;         // decoded here: the header is wrong about the stream, or ITK would mend values in silence
    bool scaled = false;       // the values meant are slope * stored + intercept
    double slope = 1;
    double intercept = 0;
    std::optional<Affine> affine;  // set where our rule, not ITK's, places the voxels [m]
    std::vector<LabelName> names;
    std::vector<std::string> warnings;

    std::uint64_t voxels() const
    {
        return static_cast<std::uint64_t>(size.x) * static_cast<std::uint64_t>(size.y) * static_cast<std::uint64_t>(size.z);
    }
};

/// Decoded voxels, x fastest, in the machine's byte order.
struct Pixels {
    Component component = Component::u8;
    std::vector<std::byte> bytes;
};

/// What ITK makes of a header.
struct ItkHeader {
    Index3 size{0};
    Component component = Component::u8;
    Affine affine;  // LPS [m]
};

Source readNifti(const std::filesystem::path& file);
Source readNrrd(const std::filesystem::path& file);
Source readMeta(const std::filesystem::path& file);

ItkHeader itkHeader(const Source& source);
/// Decodes through ITK. Throws std::runtime_error in our form.
Pixels itkPixels(const Source& source);

[[noreturn]] inline void refuse(const std::filesystem::path& file, const std::string& why)
{
    throw std::runtime_error(fmt::format("{}: {}", file.string(), why));
}

/// The three sizes of a header, each in 1..32767, so that nothing absurd is allocated.
Index3 checkedSize(const std::filesystem::path& file, const std::vector<std::int64_t>& sizes);

}  // namespace palpate::volume
