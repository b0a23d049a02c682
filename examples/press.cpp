// Presses a ball of 10 mm into a block of fat, 0.1 mm a tick, and prints the force of the tissue at every millimetre.
#include <palpate/datasets/scene.h>
#include <palpate/haptics/simulation.h>

#include <cstdio>
#include <exception>

using namespace palpate;

namespace {

bool press()
{
    auto scene = *datasets::builtInScene("block");
    const double radius = scene.tool.radius;
    const auto model = haptics::buildModel(std::move(scene));
    haptics::Simulation simulation(model);

    // The front of the block is y = 0, its inside y > 0. The position is that of the ball's middle.
    haptics::DeviceSample sample{.position = {0, -radius - 1e-3, 0}, .buttons = haptics::buttonDeadMan};
    double last = 0.0;
    bool grows = true;
    for (int tick = 0; tick <= 60; ++tick) {
        sample.position.y = -radius - 1e-3 + 1e-4 * tick;
        const haptics::TickRecord& record = simulation.tick(sample);
        if (tick % 10 == 0) {
            const double force = -record.tissueForce.y;
            std::printf("%4.1f mm deep: %.3f N\n", 1e3 * (sample.position.y + radius), force);
            grows = grows && force >= last;
            last = force;
        }
    }
    return grows && last > 0.0;
}

}  // namespace

int main()
{
    try {
        return press() ? 0 : 1;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "press: %s\n", e.what());
        return 1;
    }
}
