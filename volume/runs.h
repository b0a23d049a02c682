#pragma once

#include <volume/label_image.h>

#include <cstdint>

// Inside volume/ only.
namespace palpate::volume {

/// Calls visit(value, first, last, y, z) for every run of equal values along x in a slice, both ends included, by y, then
/// x. Label maps are made of long ones.
template <typename Visit>
void forEachRunIn(const LabelImage& image, int z, Visit&& visit)
{
    for (int y = 0; y < image.size.y; ++y) {
        const std::uint16_t* row = image.values.data() + image.offset({0, y, z});
        for (int x = 0; x < image.size.x;) {
            const int first = x;
            const std::uint16_t value = row[x];
            while (x < image.size.x && row[x] == value) {
                ++x;
            }
            visit(value, first, x - 1, y, z);
        }
    }
}

/// The same for all slices in order.
template <typename Visit>
void forEachRunOf(const LabelImage& image, Visit&& visit)
{
    for (int z = 0; z < image.size.z; ++z) {
        forEachRunIn(image, z, visit);
    }
}

}  // namespace palpate::volume
