#pragma once

#include <volume/geometry.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace palpate::volume {

/// A dense label map: the form in which labels arrive from a file or a phantom. x runs fastest.
struct LabelImage {
    Index3 size{0};                     // voxels along each axis
    Affine affine;                      // where they are [m]
    std::vector<std::uint16_t> values;  // size.x * size.y * size.z

    /// Of a voxel in `values`.
    std::size_t offset(Index3 n) const noexcept { return base::offsetOf(size, n); }
};

/// A name for one label value, and the tissue it is made of.
struct LabelName {
    std::uint16_t value = 0;                                           // that voxels have in the label map
    std::string name;                                                  // the structure: "tumour", "left lung"
    std::string tissue;                                                // a row of the tissue table
    std::optional<std::array<std::uint8_t, 3>> colour = std::nullopt;  // red, green, blue, where the file gives one
    std::string terminology = {};  // what the structure is in a coding scheme, as 3D Slicer writes it
};

}  // namespace palpate::volume
