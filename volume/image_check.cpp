#include <volume/image_check.h>

#include <base/error.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::volume {

namespace {

// Of the corner of the grid that is farthest from the origin of the patient frame [m].
double reachOf(Index3 size, const Affine& affine)
{
    double reach = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3 side(corner & 1, (corner >> 1) & 1, (corner >> 2) & 1);
        reach = std::max(reach, glm::length(affine.toPatient(side * Vec3(size) - 0.5)));
    }
    return reach;
}

}  // namespace

void checkGrid(Index3 size, const Affine& affine)
{
    base::failIf(size.x < 1 || size.y < 1 || size.z < 1, "a label map of {} x {} x {} voxels is empty", size.x, size.y,
                 size.z);
    const Vec3 s = affine.spacing();
    const double volume = affine.voxelVolume();
    base::failIf(
        !std::isfinite(volume) || !std::isfinite(glm::dot(affine.origin, Vec3(1.0))) || !std::isfinite(s.x + s.y + s.z),
        "a label map's affine has numbers that are not finite, or far too large");
    base::failIf(!(s.x > 0 && s.y > 0 && s.z > 0), "a label map's voxels have no volume: its spacing is 0");
    base::failIf(std::max({s.x, s.y, s.z}) > maxSpacing || std::min({s.x, s.y, s.z}) < minSpacing,
                 "a label map's voxels are {:g} x {:g} x {:g} mm: that is no patient, check the units of its affine",
                 1e3 * s.x, 1e3 * s.y, 1e3 * s.z);
    base::failIf(volume < 1e-6 * s.x * s.y * s.z, "a label map's voxels have no volume: its directions are dependent");
    if (const double reach = reachOf(size, affine); reach >= farthestPlace) {
        throw base::error(
            "a label map reaches {:g} m from the origin of the patient frame, and {:g} m is the most: check the "
            "units of its affine, or move its origin",
            reach, farthestPlace);
    }
}

double shearOf(const Affine& affine) noexcept
{
    const Mat3& m = affine.linear;
    const Vec3 spacing = affine.spacing();
    const double cosine = std::max({std::abs(glm::dot(m[0], m[1])) / (spacing.x * spacing.y),
                                    std::abs(glm::dot(m[1], m[2])) / (spacing.y * spacing.z),
                                    std::abs(glm::dot(m[0], m[2])) / (spacing.x * spacing.z)});
    return std::asin(std::min(1.0, cosine));
}

void checkImage(const LabelImage& image)
{
    checkGrid(image.size, image.affine);
    base::failIf(image.values.size() != image.offset({0, 0, image.size.z}),
                 "a label map of {} x {} x {} voxels has {} values", image.size.x, image.size.y, image.size.z,
                 image.values.size());
}

}  // namespace palpate::volume
