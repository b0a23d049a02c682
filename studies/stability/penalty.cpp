#include <haptics/bounded.h>
#include <studies/stability/method.h>

namespace palpate::studies {

// K d along the gradient of the distance to the surface.
StabilityMethod penalty()
{
    return {"penalty", [](const MethodScene& scene) -> RunningMethod {
                auto reader = std::make_shared<const volume::Tissue::Reader>(*scene.model.tissue);
                const bool ball = scene.model.scene.tool.kind != datasets::ToolKind::needle;
                const double radius = ball ? scene.model.scene.tool.radius : 0.0;
                return {[=](const haptics::DeviceSample& sample) {
                    const double depth = radius - scene.model.surface.distance(sample.position);
                    if (depth <= 0.0) {
                        return Vec3(0.0);
                    }
                    const Vec3 normal = scene.model.surface.normal(sample.position);
                    const double k = contactStiffness(scene, *reader, sample.position - radius * normal, -normal);
                    return haptics::bounded(k * depth * normal, capOf(scene));
                }};
            }};
}

}  // namespace palpate::studies
