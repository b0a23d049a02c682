#include <studies/stability/method.h>

#include <haptics/contact_law.h>

#include <glm/common.hpp>

#include <algorithm>

namespace palpate::studies {

std::vector<StabilityMethod> stabilityMethods()
{
    auto all = ourMethods();
    for (auto&& other : {superposedNormals(), godObject(), penalty(), layers(), chainMailForce(), lateUpdates()}) {
        all.push_back(other);
    }
    return all;
}

double capOf(const MethodScene& scene) noexcept
{
    return std::min(scene.model.scene.forceCap, scene.device.peakForce);
}

double contactStiffness(const MethodScene& scene, const volume::Tissue::Reader& reader, Vec3 point, Vec3 inward) noexcept
{
    const double radius = scene.model.scene.tool.radius;
    const auto local = haptics::tissueUnder(scene.model, reader, point, inward, radius);
    const double e = local.youngsModulus / (1.0 - local.poissonRatio * local.poissonRatio);
    return std::min(2.0 * e * radius, haptics::stiffestContact);
}

ContactVoxels::ContactVoxels(const haptics::SessionModel& model)
{
    const bool ball = model.scene.tool.kind != datasets::ToolKind::needle;
    const double radius = ball ? model.scene.tool.radius : 0.0;
    grid = volume::coveringGrid(model.tissue->box(), sceneVoxel, radius + 2.0 * sceneVoxel);
    full.resize(grid.count());
    for (std::size_t i = 0; i < full.size(); ++i) {
        full[i] = model.surface.distance(grid.position(grid.node(i))) < radius ? 1 : 0;
    }
}

Index3 ContactVoxels::voxel(Vec3 p) const noexcept
{
    return Index3(glm::floor(inVoxels(p)));
}

}  // namespace palpate::studies
