#include <haptics/bounded.h>
#include <studies/stability/method.h>

#include <array>

namespace palpate::studies {

namespace {

// One layer at a time is there to be touched. When it gives way it is removed for good, and its flag keeps a force along
// the needle until the next layer is touched: also in a gap, and also in the air outside.
struct Layers {
    MethodScene scene;
    volume::Tissue::Reader reader;
    double front = 0;  // of the tool's foremost point ahead of its position [m]
    std::array<bool, haptics::maxTissues> removed{};
    std::uint8_t touched = 0;  // layer in contact; 0 = none
    std::uint8_t flagged = 0;  // removed layer whose force goes on; 0 = none

    const volume::TissueRow& row(std::uint8_t r) const noexcept { return scene.model.tissue->table().rows[r]; }

    // From the surface of what is not removed to the tip, along the tool: the surface contact point stays there [m].
    double depthBelow(Vec3 tip, Vec3 axis) const noexcept
    {
        constexpr double step = 0.1e-3, furthest = 50e-3;
        double depth = 0.0;
        while (depth < furthest) {
            const auto here = reader.tissue(tip - depth * axis);
            if (here == 0 || removed[here]) {
                break;
            }
            depth += step;
        }
        return depth;
    }

    Vec3 tick(const haptics::DeviceSample& sample) noexcept
    {
        const Vec3 tip = sample.position + front * sample.axis;
        const auto here = reader.tissue(tip);
        if (touched == 0 && here != 0 && !removed[here]) {
            touched = here;
            flagged = 0;
        }
        if (touched == 0) {
            return haptics::bounded(-row(flagged).cuttingForce * sample.axis, capOf(scene));
        }
        const double depth = depthBelow(tip, sample.axis);
        if (depth <= 0.0) {
            touched = 0;
            return Vec3(0.0);
        }
        const double force = contactStiffness(scene, reader, tip - depth * sample.axis, sample.axis) * depth;
        if (force > row(touched).punctureForce) {
            removed[touched] = true;
            flagged = touched;
            touched = 0;
        }
        return haptics::bounded(-force * sample.axis, capOf(scene));
    }
};

}  // namespace

// The layer-based model of the thesis that Palpate started from.
StabilityMethod layers()
{
    const auto start = [](const MethodScene& scene) -> RunningMethod {
        const auto& tool = scene.model.scene.tool;
        const double front = tool.kind == datasets::ToolKind::needle ? 0.0 : tool.radius;
        auto state = std::make_shared<Layers>(Layers{scene, volume::Tissue::Reader(*scene.model.tissue), front});
        return {[state](const haptics::DeviceSample& sample) { return state->tick(sample); }};
    };
    return {"layers", start, datasets::ModelLevel::spring, true};
}

}  // namespace palpate::studies
