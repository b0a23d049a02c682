#include <reference/symmetry.h>

#include <base/error.h>
#include <volume/clean.h>

#include <cmath>
#include <cstdint>
#include <vector>

namespace palpate::reference {

namespace {

constexpr double between = 1e-6;  // of a voxel, that a plane may be off

// Twice the index of the plane `axis` = 0, which lies between two voxels.
int twicePlane(const volume::LabelImage& image, int axis)
{
    const Vec3 origin = image.affine.toIndex(Vec3(0.0));
    const double twice = 2.0 * origin[axis];
    const double spacing = image.affine.spacing()[axis];
    const bool aligned = std::abs(std::abs(image.affine.linear[axis][axis]) - spacing) < between * spacing;
    base::failIf(!aligned || std::abs(twice - std::round(twice)) > between || std::lround(twice) % 2 == 0,
                 "volume: the plane {} = 0 does not run between voxels: solve all of it",
                 "xyz"[static_cast<std::size_t>(axis)]);
    return static_cast<int>(std::lround(twice));
}

// @param rows  of the tissue table, by label value (65536 x 1)
void checkSymmetry(const volume::LabelImage& image, const std::vector<std::uint8_t>& rows, int axis, int twice)
{
    volume::forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        Index3 other = n;
        other[axis] = twice - n[axis];
        const bool in = other[axis] >= 0 && other[axis] < image.size[axis];
        base::failIf(rows[image.values[image.offset(n)]] != (in ? rows[image.values[image.offset(other)]] : 0),
                     "volume: tissues differ across the plane {} = 0: solve all of it",
                     "xyz"[static_cast<std::size_t>(axis)]);
    });
}

}  // namespace

volume::Tissue mirroredPart(const volume::Tissue& tissue, std::array<bool, 3> mirrored)
{
    volume::LabelImage image = tissue.labels();
    std::vector<std::uint8_t> rows(65536, 0);
    std::vector<volume::LabelName> names;
    for (const volume::Structure& s : tissue.structures()) {
        rows[s.value] = s.tissue;
        names.push_back({s.value, s.name, tissue.table().rows[s.tissue].name, s.colour, s.terminology});
    }
    for (int axis = 0; axis < 3; ++axis) {
        if (!mirrored[static_cast<std::size_t>(axis)]) {
            continue;
        }
        const int twice = twicePlane(image, axis);
        checkSymmetry(image, rows, axis, twice);
        Index3 low(0);
        Index3 high = image.size - 1;
        (image.affine.linear[axis][axis] > 0.0 ? low : high)[axis] =
            image.affine.linear[axis][axis] > 0.0 ? (twice + 1) / 2 : (twice - 1) / 2;
        image = volume::cropped(image, low, high);
    }
    return volume::Tissue::fromLabels(image, tissue.table(), names, tissue.provenance());
}

}  // namespace palpate::reference
