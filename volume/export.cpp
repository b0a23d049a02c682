#include <volume/export.h>

#include <base/error.h>
#include <base/outputs.h>
#include <volume/export_source.h>
#include <volume/import/header_text.h>
#include <volume/runs.h>

#include <zlib.h>
#include <glm/common.hpp>

#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>

namespace palpate::volume {

static_assert(std::endian::native == std::endian::little, "the writers' headers say little endian");

namespace {

constexpr int packLevel = 6;

bool ends(const std::string& name, std::string_view ending)
{
    return name.size() > ending.size() && name.compare(name.size() - ending.size(), ending.size(), ending) == 0;
}

bool isSegmentation(const std::filesystem::path& file)
{
    return ends(lowerCase(file.filename().string()), ".seg.nrrd");
}

// Value, extent and given name of every label that a voxel has.
std::vector<ExportedSegment> segmentsOf(const LabelImage& image, std::span<const LabelName> names)
{
    std::map<std::uint16_t, ExportedSegment> found;
    forEachRunOf(image, [&](std::uint16_t value, int first, int last, int y, int z) {
        if (value != 0) {
            const ExportedSegment fresh{{value, "", ""}, {first, y, z}, {last, y, z}};
            ExportedSegment& s = found.emplace(value, fresh).first->second;
            s.low = glm::min(s.low, fresh.low);
            s.high = glm::max(s.high, fresh.high);
        }
    });
    std::vector<ExportedSegment> segments;
    for (auto& [value, segment] : found) {
        const auto name = std::find_if(names.begin(), names.end(), [&](const LabelName& n) { return n.value == value; });
        if (name != names.end()) {
            segment.label = *name;
        } else {
            segment.label.name = fmt::format("label {}", value);
        }
        segments.push_back(std::move(segment));
    }
    return segments;
}

void writeAny(const std::filesystem::path& file, const VoxelStream& voxels, std::span<const ExportedSegment> segments,
              const ExportOptions& options)
{
    const std::string name = lowerCase(file.filename().string());
    if (ends(name, ".nii") || ends(name, ".nii.gz")) {
        writeNifti(file, voxels, segments, options);
    } else if (ends(name, ".nrrd")) {
        writeNrrd(file, voxels, isSegmentation(file) ? segments : std::span<const ExportedSegment>{}, options);
    } else {
        writeMeta(file, voxels, options);
    }
}

void refuseSegmentation(const std::filesystem::path& file)
{
    checkExportName(file);
    refuseIf(isSegmentation(file), file, "a segmentation holds labels, not numbers: name it .nrrd");
}

template <typename T>
void append(std::vector<std::byte>& out, const T* first, std::size_t count)
{
    const std::size_t at = out.size();
    out.resize(at + count * sizeof(T));
    std::memcpy(out.data() + at, first, count * sizeof(T));
}

}  // namespace

struct OutputFile::Impl {
    std::filesystem::path file, part;
    std::ofstream out;
    Packing packing = Packing::none;
    z_stream stream{};
    std::vector<std::byte> buffer = std::vector<std::byte>(std::size_t{1} << 18);

    [[noreturn]] void fail()
    {
        const std::string why = errno != 0 ? std::strerror(errno) : "unknown error";
        throw base::error("{}: cannot be written ({}): check the folder and the space on the disk", file.string(), why);
    }
    void put(const std::byte* bytes, std::size_t count)
    {
        if (!out.write(reinterpret_cast<const char*>(bytes), static_cast<std::streamsize>(count))) {
            fail();
        }
    }
    void pack(std::span<const std::byte> bytes, int flush)
    {
        do {
            // zlib counts in 32 bits.
            const auto now = std::min<std::size_t>(bytes.size(), std::size_t{1} << 30);
            stream.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(bytes.data()));
            stream.avail_in = static_cast<uInt>(now);
            do {
                stream.next_out = reinterpret_cast<Bytef*>(buffer.data());
                stream.avail_out = static_cast<uInt>(buffer.size());
                deflate(&stream, now == bytes.size() ? flush : Z_NO_FLUSH);
                put(buffer.data(), buffer.size() - stream.avail_out);
            } while (stream.avail_out == 0);
            bytes = bytes.subspan(now);
        } while (!bytes.empty());
    }
    void endPacking()
    {
        if (packing == Packing::gzip) {
            pack({}, Z_FINISH);
            deflateEnd(&stream);
        }
        packing = Packing::none;
    }
};

OutputFile::OutputFile(const std::filesystem::path& file) : impl_(std::make_unique<Impl>())
{
    impl_->file = base::replaceable(file);
    impl_->part = fmt::format("{}.{}.part", impl_->file.string(), ::getpid());
    errno = 0;
    impl_->out.open(impl_->part, std::ios::binary | std::ios::trunc);
    if (!impl_->out) {
        impl_->fail();
    }
}

OutputFile::~OutputFile()
{
    if (impl_->packing == Packing::gzip) {
        deflateEnd(&impl_->stream);
    }
    if (!impl_->part.empty()) {
        std::error_code ignored;
        std::filesystem::remove(impl_->part, ignored);
    }
}

void OutputFile::begin(Packing packing)
{
    impl_->endPacking();
    impl_->packing = packing;
    constexpr int gzipWindow = 15 + 16;
    if (packing == Packing::gzip &&
        deflateInit2(&impl_->stream, packLevel, Z_DEFLATED, gzipWindow, 8, Z_DEFAULT_STRATEGY) != Z_OK) {
        impl_->packing = Packing::none;
        throw std::runtime_error(impl_->file.string() + ": there is no memory left to compress it");
    }
}

void OutputFile::write(std::span<const std::byte> bytes)
{
    if (impl_->packing == Packing::gzip) {
        impl_->pack(bytes, Z_NO_FLUSH);
    } else {
        impl_->put(bytes.data(), bytes.size());
    }
}

void OutputFile::write(std::string_view text)
{
    write(std::as_bytes(std::span(text)));
}

void OutputFile::close()
{
    if (!impl_->out.is_open()) {
        return;
    }
    impl_->endPacking();
    errno = 0;
    impl_->out.close();
    if (!impl_->out) {
        impl_->fail();
    }
}

void OutputFile::finish()
{
    close();
    errno = 0;
    std::error_code failed;
    std::filesystem::rename(impl_->part, impl_->file, failed);
    if (failed) {
        impl_->fail();
    }
    impl_->part.clear();
}

void writeSlices(OutputFile& out, const VoxelStream& voxels, bool planar, const ExportOptions& options)
{
    std::vector<std::byte> bytes;
    const int parts = planar ? voxels.components : 1;
    for (int part = 0; part < parts; ++part) {
        for (int z = 0; z < voxels.grid.size.z; ++z) {
            bytes.clear();
            voxels.slice(z, planar ? part : -1, bytes);
            out.write(bytes);
            if (options.progress) {
                options.progress(static_cast<double>(part * voxels.grid.size.z + z + 1) / (parts * voxels.grid.size.z));
            }
        }
    }
}

bool isNifti(const std::filesystem::path& file)
{
    const std::string name = lowerCase(file.filename().string());
    return ends(name, ".nii") || ends(name, ".nii.gz");
}

void checkExportName(const std::filesystem::path& file, std::string_view others)
{
    static constexpr std::array<std::string_view, 5> endings{".nii", ".nii.gz", ".nrrd", ".mha", ".mhd"};
    const std::string name = lowerCase(file.filename().string());
    refuseIf(std::none_of(endings.begin(), endings.end(), [&](std::string_view e) { return ends(name, e); }), file,
             "is no format that is written: name it .nii, .nii.gz, .nrrd, .seg.nrrd, .mha or .mhd{}", others);
}

void checkCount(const std::filesystem::path& file, std::string_view what, std::size_t values, Index3 size)
{
    refuseIf(size.x < 1 || size.y < 1 || size.z < 1, file, "a grid of {} x {} x {} is empty", size.x, size.y, size.z);
    refuseIf(values != base::countOf(size), file, "{} of {} values do not fit a grid of {} x {} x {}", what, values, size.x,
             size.y, size.z);
}

// No reader gets a place from a voxel whose directions are dependent.
void checkHasVolume(const std::filesystem::path& file, const Affine& affine)
{
    const Vec3 s = affine.spacing();
    const double volume = affine.voxelVolume();
    refuseIf(!std::isfinite(volume) || !(volume > 1e-6 * s.x * s.y * s.z), file,
             "its voxels have no volume, or numbers that are not finite: check the affine");
}

void exportLabels(const std::filesystem::path& file, const LabelImage& image, std::span<const LabelName> names,
                  const ExportOptions& options)
{
    checkExportName(file);
    checkCount(file, "labels", image.values.size(), image.size);
    checkHasVolume(file, image.affine);
    const std::vector<ExportedSegment> segments = segmentsOf(image, names);
    const bool small = segments.empty() || segments.back().label.value < 256;
    VoxelStream voxels{{image.size, image.affine}, small ? Component::u8 : Component::u16, 1, {}};
    voxels.slice = [&](int z, int, std::vector<std::byte>& out) {
        const std::uint16_t* first = image.values.data() + image.offset({0, 0, z});
        const std::size_t count = image.offset({0, 0, 1});
        if (!small) {
            append(out, first, count);
            return;
        }
        out.resize(count);
        std::transform(first, first + count, out.begin(), [](std::uint16_t v) { return static_cast<std::byte>(v); });
    };
    writeAny(file, voxels, segments, options);
}

void exportImage(const std::filesystem::path& file, const VoxelGrid& grid, std::span<const float> values,
                 const ExportOptions& options)
{
    refuseSegmentation(file);
    checkCount(file, "an image", values.size(), grid.size);
    checkHasVolume(file, grid.affine);
    const auto slice = static_cast<std::size_t>(grid.size.x) * static_cast<std::size_t>(grid.size.y);
    VoxelStream voxels{grid, Component::f32, 1, {}};
    voxels.slice = [&](int z, int, std::vector<std::byte>& out) {
        append(out, values.data() + static_cast<std::size_t>(z) * slice, slice);
    };
    writeAny(file, voxels, {}, options);
}

void exportVectors(const std::filesystem::path& file, const VoxelGrid& grid, std::span<const Vec3f> values,
                   const ExportOptions& options)
{
    refuseSegmentation(file);
    checkCount(file, "vectors", values.size(), grid.size);
    checkHasVolume(file, grid.affine);
    const auto slice = static_cast<std::size_t>(grid.size.x) * static_cast<std::size_t>(grid.size.y);
    VoxelStream voxels{grid, Component::f32, 3, {}};
    voxels.slice = [&](int z, int c, std::vector<std::byte>& out) {
        const std::span<const Vec3f> here = values.subspan(static_cast<std::size_t>(z) * slice, slice);
        std::vector<float> numbers;
        for (const Vec3f& v : here) {
            for (int k = 0; k < 3; ++k) {
                if (c < 0 || c == k) {
                    numbers.push_back(v[k]);
                }
            }
        }
        append(out, numbers.data(), numbers.size());
    };
    writeAny(file, voxels, {}, options);
}

}  // namespace palpate::volume
