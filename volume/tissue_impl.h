#pragma once

#include <volume/grids.h>
#include <volume/tissue.h>

#include <optional>
#include <vector>

// Inside volume/ only: everything that knows OpenVDB includes this.
namespace palpate::volume {

/// Voxel indices, both ends included.
struct IndexBox {
    Index3 low{0};
    Index3 high{-1};

    bool empty() const noexcept { return high.x < low.x || high.y < low.y || high.z < low.z; }
};

/// What a label value is made of; looked up for each voxel that is read.
struct LabelLookup {
    std::vector<std::uint8_t> row = std::vector<std::uint8_t>(65536, 0);    // row of the tissue table
    std::vector<std::uint8_t> solid = std::vector<std::uint8_t>(65536, 0);  // 1 where the label is not air
};

/// What a Tissue holds.
struct TissueData {
    Index3 size{0};
    Affine affine;
    TissueTable table;
    Provenance provenance;
    std::vector<Structure> structures;  // by value
    std::vector<IndexBox> extents;      // voxels of each structure (structures x 1)
    LabelLookup lookup;
    Box box;
    std::optional<Support> support;

    openvdb::Int32Grid::Ptr label;
    openvdb::FloatGrid::Ptr stiffness;  // [kPa]
    openvdb::BoolGrid::Ptr occupancy;
    openvdb::FloatGrid::Ptr image;  // null where there is none
    std::string imageUnit;
    StiffnessMap stiffnessMap;

    /// Fills `lookup`, `box` and `support` from the table, the structures and their extents.
    void derive();
    /// All voxels whose label is marked in `wanted` (65536 x 1).
    IndexBox extentOf(const std::vector<std::uint8_t>& wanted) const;
};

struct Tissue::Impl : TissueData {};

/// The affine as OpenVDB's index-to-world transform [mm], for other programs; ours read the affine itself.
openvdb::math::Transform::Ptr transformOf(const Affine& affine);

/// What an image in `unit` has where there is no tissue.
double valueOfAir(const std::string& unit) noexcept;

/// The patient box around the voxels of `extent` [m].
Box patientBox(const Affine& affine, const IndexBox& extent);

}  // namespace palpate::volume
