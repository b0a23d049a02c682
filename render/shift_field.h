#pragma once

#include <render/deformation.h>

#include <glm/vec3.hpp>

#include <array>
#include <cstdint>
#include <vector>

namespace palpate::render {

/// Where what is seen at x lies at rest, X = x + s(x), on a grid around all that has moved: what a ray caster needs to show
/// a deformed body without a new volume per frame.
struct ShiftField {
    using Texel = std::array<std::uint8_t, 4>;  // (128 + 127 s / largest) per axis, and nothing; a byte is what is fast

    glm::ivec3 size{0};             // 0: nothing has moved
    glm::dvec3 origin{0.0};         // of node (0, 0, 0) [m]
    double spacing = 0;             // [m]
    double largest = 0;             // of |s| along an axis [m]
    std::vector<Texel> texels;      // x fastest
    std::vector<glm::vec3> shifts;  // the same in metres
};

/// Samples the present deformation, at half a spacing of its lattice, or a spacing, two, .. as far as that is affordable.
/// Error: that of the trilinear interpolation between nodes, and largest / 127.
void sample(const Deformation& deformation, ShiftField& out);

}  // namespace palpate::render
