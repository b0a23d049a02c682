#pragma once

// Label maps with a closed form, for the tests of volume/.
#include <volume/tissue.h>

#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>

#include <cmath>
#include <vector>

namespace palpate::volume::bodies {

inline TissueRow row(const char* name, Role role, double youngsModulus)
{
    TissueRow r;
    r.name = name;
    r.role = role;
    r.youngsModulus = youngsModulus;
    r.poissonRatio = 0.4899999999999999;
    r.density = 911.3;
    r.compress = 0.7;
    r.stretch = 1.3;
    r.shear = 0.29;
    r.punctureForce = 0.31;
    r.cuttingForce = 0.17;
    r.frictionPerMetre = 43.0;
    r.fixed = role == Role::bone;
    r.colour = {0.1F, 0.7F, 0.3F};
    r.opacity = 0.25F;
    r.source = "made up for a test";
    return r;
}

inline TissueTable table()
{
    TissueTable table{"test",
                      {row("air", Role::air, 0), row("fat", Role::plain, 3.25e3), row("tumour", Role::tumour, 43.7e3),
                       row("bone", Role::bone, 1e6)}};
    table.rows[1].acoustics = {1440, 0.38, 1.16, -0.3, 2.5, EchoPattern::septa, "c: \"recalled\""};
    return table;
}

inline std::vector<LabelName> names()
{
    return {{1, "breast", "fat"}, {7, "lump", "tumour"}, {300, "rib", "bone"}};
}

/// Voxel steps of the given lengths [m], turned out of the patient axes; left-handed when `mirror`.
inline Affine oblique(Vec3 spacing, Vec3 origin, bool mirror)
{
    const glm::dmat4 turned = glm::rotate(glm::rotate(glm::dmat4(1.0), 0.3, Vec3(0, 0, 1)), 0.4, Vec3(1, 0.2, 0));
    Mat3 m(turned);
    m[0] *= mirror ? -spacing.x : spacing.x;
    m[1] *= spacing.y;
    m[2] *= spacing.z;
    return {m, origin};
}

/// A label map whose value at each voxel centre p [m] is inside(p).
template <typename Label>
LabelImage voxelise(Index3 size, const Affine& affine, const Label& label)
{
    LabelImage image{size, affine, {}};
    image.values.resize(image.offset({0, 0, size.z}));
    for (int z = 0; z < size.z; ++z) {
        for (int y = 0; y < size.y; ++y) {
            for (int x = 0; x < size.x; ++x) {
                image.values[image.offset({x, y, z})] = static_cast<std::uint16_t>(label(affine.toPatient(Vec3(x, y, z))));
            }
        }
    }
    return image;
}

/// An affine that puts the middle of the volume at the patient frame's origin.
inline Affine centred(Affine affine, Index3 size)
{
    affine.origin = -(affine.linear * (0.5 * Vec3(size - 1)));
    return affine;
}

}  // namespace palpate::volume::bodies
