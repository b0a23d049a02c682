// Presses a ball into a block of fat, 0.1 mm a tick, and prints the force at 5 mm.
#include <datasets/scene.h>
#include <haptics/simulation.h>

#include <glm/geometric.hpp>

#include <cstdio>
#include <exception>
#include <memory>

using namespace palpate;

namespace {

double forceAt(double depth)
{
    auto scene = *datasets::builtInScene("block");
    const double radius = scene.tool.radius;
    auto tissue = std::make_shared<const volume::Tissue>(datasets::sceneVolume(scene));
    const auto model = haptics::buildModel(std::move(scene), std::move(tissue));
    haptics::Simulation simulation(model);

    // The front of the block is y = 0, its inside y > 0. A second of rest before the push: forces ramp up.
    haptics::DeviceSample sample{.position = {0, -radius - 1e-3, 0}, .buttons = haptics::buttonDeadMan};
    for (int tick = 0; tick < 1000; ++tick) {
        simulation.tick(sample);
    }
    while (sample.position.y < depth - radius) {
        sample.position.y += 1e-4;
        simulation.tick(sample);
    }
    for (int tick = 0; tick < 100; ++tick) {
        simulation.tick(sample);
    }
    const auto& record = simulation.tick(sample);
    return record.total.y;
}

}  // namespace

int main()
{
    try {
        const double force = forceAt(5e-3);
        std::printf("a ball of 10 mm pressed 5 mm into fat pushes back with %.2f N\n", -force);
        return force < 0.0 ? 0 : 1;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "use_palpate: %s\n", e.what());
        return 1;
    }
}
