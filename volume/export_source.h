#pragma once

#include <volume/export.h>
#include <volume/import/source.h>

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

// Inside volume/ only: what the writers of each format agree on.
namespace palpate::volume {

enum class Packing : std::uint8_t { none, gzip };

/// A file under construction: appears under its name on finish(), and not at all otherwise.
class OutputFile {
public:
    explicit OutputFile(const std::filesystem::path& file);
    ~OutputFile();

    /// What is written from now on is packed like this.
    void begin(Packing packing);
    void write(std::span<const std::byte> bytes);
    void write(std::string_view text);
    /// All bytes are on the disk, still under another name.
    void close();
    /// Puts it under its name, closed or not.
    void finish();

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// The voxels of a file that is to be written. They are made slice by slice, so that nothing is held twice.
struct VoxelStream {
    VoxelGrid grid;
    Component component = Component::u8;  // u8, u16 or f32
    int components = 1;
    /// Component `c` of slice `z`, x fastest, into `out`; c = -1: all of them, those of a voxel side by side.
    std::function<void(int z, int c, std::vector<std::byte>& out)> slice;
};

/// Names of the labels that there are, without value 0, and the box of their voxels.
struct ExportedSegment {
    LabelName label;
    Index3 low{0};
    Index3 high{0};
};

/// Refuses values that are not one for each of the grid's places.
void checkCount(const std::filesystem::path& file, std::string_view what, std::size_t values, Index3 size);

/// Writes all slices; where `planar`, one component after the other.
void writeSlices(OutputFile& out, const VoxelStream& voxels, bool planar, const ExportOptions& options);

/// `segments` may be empty: no names.
void writeNifti(const std::filesystem::path& file, const VoxelStream& voxels, std::span<const ExportedSegment> segments,
                const ExportOptions& options);
void writeNrrd(const std::filesystem::path& file, const VoxelStream& voxels, std::span<const ExportedSegment> segments,
               const ExportOptions& options);
void writeMeta(const std::filesystem::path& file, const VoxelStream& voxels, const ExportOptions& options);

}  // namespace palpate::volume
