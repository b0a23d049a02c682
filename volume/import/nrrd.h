#pragma once

#include <volume/import/source.h>

#include <optional>

namespace palpate::volume {

/// A NRRD header as text. Format: https://teem.sourceforge.net/nrrd/format.html
struct NrrdHeader {
    std::filesystem::path file;
    std::map<std::string, std::string> fields;  // "field: value", names in lower case
    std::map<std::string, std::string> pairs;   // "key:=value"
    std::uint64_t end = 0;                      // first byte behind the empty line

    std::string field(const std::string& name, const std::string& fallback = "") const
    {
        const auto found = fields.find(name);
        return found == fields.end() ? fallback : found->second;
    }
    std::optional<std::string> pair(const std::string& name) const
    {
        const auto found = pairs.find(name);
        return found == pairs.end() ? std::nullopt : std::optional(found->second);
    }
};

/// Sets size, affine and layers: which axes are space, which one holds layers of segments.
void placeNrrd(const NrrdHeader& header, Source& source);

/// Segments as 3D Slicer names them in a .seg.nrrd.
std::vector<SegmentName> slicerSegments(const NrrdHeader& header);

}  // namespace palpate::volume
