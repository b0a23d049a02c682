#include <haptics/bounded.h>
#include <studies/stability/method.h>

#include <algorithm>
#include <array>

namespace palpate::studies {

namespace {

constexpr int furthest = 64;  // voxels that are looked through for the way out

// The way out of the solid from `p` along one side of one axis, in voxels.
double wayOut(const ContactVoxels& voxels, Vec3 p, int axis, int side) noexcept
{
    Index3 n(voxels.voxel(p));
    const double at = voxels.inVoxels(p)[axis];
    for (int i = 0; i < furthest && voxels.solid(n); ++i) {
        n[axis] += side;
    }
    return side > 0 ? n[axis] - at : at - (n[axis] + 1);
}

// The nearest face of the surface pushes out along its normal, and so do faces that are no voxel farther: their forces
// add up.
Vec3 depthVector(const ContactVoxels& voxels, Vec3 p) noexcept
{
    std::array<double, 6> out{};
    for (int s = 0; s < 6; ++s) {
        out[static_cast<std::size_t>(s)] = wayOut(voxels, p, s / 2, s % 2 != 0 ? 1 : -1);
    }
    const double reach = *std::min_element(out.begin(), out.end()) + 1.0;
    Vec3 sum(0.0);
    for (int s = 0; s < 6; ++s) {
        const double way = out[static_cast<std::size_t>(s)];
        sum[s / 2] += way < reach ? (s % 2 != 0 ? way : -way) : 0.0;
    }
    return sum * voxels.grid.spacing;
}

}  // namespace

// Source: Massie and Salisbury, "The PHANToM haptic interface: a device for probing virtual objects", ASME 1994.
StabilityMethod superposedNormals()
{
    return {"superposed_normals", [](const MethodScene& scene) -> RunningMethod {
                auto voxels = std::make_shared<const ContactVoxels>(scene.model);
                auto reader = std::make_shared<const volume::Tissue::Reader>(*scene.model.tissue);
                return {[=](const haptics::DeviceSample& sample) {
                    if (!voxels->solid(voxels->voxel(sample.position))) {
                        return Vec3(0.0);
                    }
                    const Vec3 depth = depthVector(*voxels, sample.position);
                    const double k = contactStiffness(scene, *reader, sample.position, sample.axis);
                    return haptics::bounded(k * depth, capOf(scene));
                }};
            }};
}

}  // namespace palpate::studies
