#pragma once

#include <volume/tissue.h>

#include <cstdint>
#include <optional>
#include <vector>

namespace palpate::chainmail {

/// Where the tissue of a volume is in another posture: a grid of cells over the unloaded body, each node of which has a
/// place in the volume and one in the posture [m]. Trilinear in a cell.
struct PostureMap {
    volume::NodeGrid nodes;            // cell (i, j, k) lies between nodes (i, j, k) and (i + 1, j + 1, k + 1)
    std::vector<Vec3> taken;           // place in the volume, patient frame [m] (count x 1)
    std::vector<Vec3> now;             // place in the posture [m] (count x 1)
    std::vector<std::uint8_t> filled;  // of each cell, by its lowest node: 2 holds tissue, 1 is beside one that does

    /// Where a place of the volume goes; nothing further than a cell from tissue.
    std::optional<Vec3> moved(Vec3 place) const;
};

/// The place in the cell in which `place` lies, each coordinate from 0 to 1; nothing where it lies outside.
/// @param corners  8, x fastest
std::optional<Vec3> placeInCell(const Vec3* corners, Vec3 place) noexcept;

/// The volume in the posture: every voxel takes the label, and the value of the image, of the place that its tissue comes
/// from. Its voxels are those of the volume, and more of them where tissue goes beyond. A structure that would lose all its
/// voxels keeps one.
/// @param note  for the provenance, under "gravity"
volume::Tissue inPosture(const volume::Tissue& tissue, const PostureMap& map, const std::string& note);

}  // namespace palpate::chainmail
