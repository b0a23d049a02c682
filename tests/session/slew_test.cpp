#include <datasets/scene.h>
#include <haptics/simulation.h>
#include <haptics/stabiliser.h>
#include <session/devices.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <memory>
#include <string>

namespace palpate::session {
namespace {

// Ticks of a scripted session in which the force changed by more than the slew and, on its way down, by more than the
// stable stiffness times the motion that was read in that tick; and the largest force.
struct Slew {
    int over = 0;
    double worst = 0;  // [N] beyond what is allowed
    double peak = 0;   // [N]
};

Slew slewOf(const std::string& text)
{
    auto scene = datasets::parseScene(text, "slew.toml");
    auto tissue = std::make_shared<const volume::Tissue>(datasets::sceneVolume(scene));
    const auto model = haptics::buildModel(std::move(scene), std::move(tissue));
    const auto device = openDevice(model, {"hand", "", 1, nullptr}, nullptr);
    haptics::Simulation simulation(model);
    const haptics::StabiliserOptions o{haptics::deviceParameters(model.scene.device), haptics::tickSeconds,
                                       model.scene.forceCap};
    const double cap = std::min(o.cap, o.device.peakForce), slew = 50.0 * cap * o.period;
    Slew found;
    Vec3 before(0.0), read(0.0);
    for (int i = 0; !device->finished() && i < 3000; ++i) {
        const haptics::TickRecord& tick = simulation.tick(device->read());
        device->write(tick.total);
        device->observe(tick);
        const double size = glm::length(tick.total);
        const bool falls = size < glm::length(before);
        const double way = i > 0 ? glm::distance(tick.device.position, read) : 0.0;
        const double most = slew + (falls ? haptics::stableLimits(o).stiffness * way : 0.0);
        const double beyond = glm::distance(tick.total, before) - most;
        found.over += size > 0.0 && beyond > 1e-9 * cap ? 1 : 0;
        found.worst = std::max(found.worst, size > 0.0 ? beyond : 0.0);
        found.peak = std::max(found.peak, size);
        before = tick.total;
        read = tick.device.position;
    }
    return found;
}

// A wall of 10 kN/m behind fat that hardly resists: the encoder stands still in many ticks of its slow way out.
TEST(Slew, HoldsBehindARibInFatThatHardlyResists)
{
    auto scene = *datasets::builtInScene("behind-rib");
    std::string text = scene.text;
    text += "\n[tissue.fat]\nyoungs_kpa = 0.01\n";
    text += "[model]\nlevel = \"spring\"\nstiffness_n_m = 10000\n";
    const Slew slew = slewOf(text);
    EXPECT_GT(slew.peak, 1.0) << "nothing was felt";
    EXPECT_EQ(slew.over, 0) << slew.worst << " N beyond";
}

// A ball of 30 mm on a body of bone that is no larger.
TEST(Slew, HoldsForAToolAsLargeAsABodyOfBone)
{
    for (const char* level : {"spring", "chainmail"}) {
        const Slew slew =
            slewOf(std::string("name = \"bone\"\n[volume]\nphantom = \"block\"\nvoxel_mm = 3.0\n"
                               "[volume.parameters]\nwidth_mm = 60\nthickness_mm = 40\n"
                               "[tissue.fat]\nyoungs_kpa = 1e7\n[tissue.idc_high_grade]\nyoungs_kpa = 1e7\n"
                               "[tool]\nkind = \"sphere\"\nradius_mm = 30\n[dffb]\nmode = \"off\"\n"
                               "[model]\nlevel = \"") +
                   level + "\"\n[target]\nentry_mm = [0, 0, 0]\nstructure = \"tumour\"\naim_mm = [0, 25, 0]\n");
        EXPECT_GT(slew.peak, 1.0) << "nothing was felt at " << level;
        EXPECT_EQ(slew.over, 0) << slew.worst << " N beyond at " << level;
    }
}

}  // namespace
}  // namespace palpate::session
