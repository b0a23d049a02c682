#include <studies/stability/method.h>

#include <base/folds.h>
#include <base/mapped.h>
#include <haptics/contact_law.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <iterator>

namespace palpate::studies {

namespace {

std::shared_ptr<haptics::Simulation> simulationOf(const MethodScene& scene)
{
    return std::make_shared<haptics::Simulation>(scene.model, haptics::SimulationOptions{scene.period, scene.device});
}

double furthestNode(const haptics::Simulation& simulation) noexcept
{
    return base::largestOf(simulation.shape().moved(),
                           [&](auto n) { return static_cast<double>(glm::length(simulation.shape().u()[n])); });
}

// A simulation and what its last tick gave.
struct Ours {
    std::shared_ptr<haptics::Simulation> simulation;
    const haptics::TickRecord* last = nullptr;

    Vec3 tick(const haptics::DeviceSample& sample) noexcept
    {
        last = &simulation->tick(sample);
        return last->total;
    }
};

RunningMethod running(const MethodScene& scene)
{
    auto ours = std::make_shared<Ours>(Ours{simulationOf(scene)});
    return {[ours](const haptics::DeviceSample& sample) { return ours->tick(sample); },
            [ours] { return furthestNode(*ours->simulation); }, [ours] { return ours->last; },
            [ours] { return ours->last != nullptr ? ours->last->tissueForce : Vec3(0.0); }};
}

// The force of the last update, held until the next.
struct Held {
    std::shared_ptr<haptics::Simulation> simulation;
    double period, every;
    double since = 0.0;
    Vec3 force{0.0};

    Vec3 tick(const haptics::DeviceSample& sample) noexcept
    {
        const Vec3 now = simulation->tick(sample).total;
        since += period;
        if (since >= every) {
            since -= every;
            force = now;
        }
        return force;
    }
};

}  // namespace

std::vector<StabilityMethod> ourMethods()
{
    using datasets::ModelLevel;
    return base::mapped<StabilityMethod>(
        std::initializer_list{ModelLevel::elastic, ModelLevel::chainmail, ModelLevel::spring}, [&](ModelLevel level) {
            return StabilityMethod{std::string(name(level)), running, level, true};
        });
}

// Palpate's force, updated by a tissue model at 60 Hz.
StabilityMethod lateUpdates()
{
    const auto start = [](const MethodScene& scene) -> RunningMethod {
        auto held = std::make_shared<Held>(Held{simulationOf(scene), scene.period, 1.0 / 60.0});
        return {[held](const haptics::DeviceSample& sample) { return held->tick(sample); },
                [held] { return furthestNode(*held->simulation); }};
    };
    return {"late_60hz", start, datasets::ModelLevel::elastic, true};
}

std::vector<StabilityMethod> stabilityMethods()
{
    auto all = ourMethods();
    std::ranges::move(std::array{superposedNormals(), godObject(), penalty(), layers(), chainMailForce(), lateUpdates()},
                      std::back_inserter(all));
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
