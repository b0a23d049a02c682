#pragma once

#include <volume/import/source.h>

// Inside volume/import/ only: segments that may overlap, before they become one label map.
namespace palpate::volume {

/// Voxels from `begin` to before `end`, x fastest.
struct Run {
    std::uint32_t begin = 0;
    std::uint32_t end = 0;
};

/// A set of voxels with a name.
struct Segment {
    LabelName label;
    std::vector<Run> runs;
    std::uint64_t voxels = 0;

    /// Voxels come in rising order.
    void add(std::uint32_t voxel)
    {
        if (runs.empty() || runs.back().end != voxel) {
            runs.push_back({voxel, voxel});
        }
        ++runs.back().end;
        ++voxels;
    }
};

/// Makes one label map of segments: options.overlap says who wins. A label value that two segments have is changed for the
/// later one. Sets values, names and overlaps of `out`, whose size is set.
void flatten(const std::filesystem::path& file, std::vector<Segment> segments, const ImportOptions& options,
             ImportedLabels& out);

/// The segments of a source with layers, in the order of its header.
std::vector<Segment> layeredSegments(const Source& source, const ImportOptions& options);

}  // namespace palpate::volume
