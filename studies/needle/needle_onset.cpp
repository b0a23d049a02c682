#include <haptics/simulation.h>
#include <studies/needle/needle_curves.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <utility>

namespace palpate::studies {

namespace {

constexpr double ballRadius = 14e-3;    // [m]
constexpr double aside = 2e-3;          // of the ball's way from the vessel's middle [m]
constexpr double deepestOnset = 12e-3;  // [m]
constexpr double vesselDepth = 14e-3;

haptics::SessionModel besideVessel()
{
    auto scene = datasets::parseScene(
        "name = \"onset\"\n[volume]\nphantom = \"block\"\n[volume.parameters]\ntumours = 0\nwidth_mm = 90\nthickness_mm = "
        "60\n"
        "[[insert]]\nname = \"artery\"\ntissue = \"artery\"\ndiameter_mm = 6\ncentre_mm = [0, 14, -45]\nto_mm = [0, 14, "
        "45]\n"
        "[tool]\nkind = \"sphere\"\nradius_mm = 14\n[dffb]\nmode = \"off\"\n"
        "[[vital]]\nname = \"artery\"\nwarn_mm = 19\n"
        "[target]\nstructure = \"base\"\nentry_mm = [2, 0, 0]\naim_mm = [2, 62, 0]\n",
        "onset.toml");
    auto tissue = std::make_shared<const volume::Tissue>(datasets::sceneVolume(scene));
    return haptics::buildModel(std::move(scene), std::move(tissue));
}

double onsetOf(const Onset& onset, double OnsetPoint::*distance)
{
    for (const OnsetPoint& p : onset.points) {
        if (p.*distance < onset.warnDistance) {
            return p.pressed;
        }
    }
    return std::numeric_limits<double>::infinity();
}

}  // namespace

Onset warningOnset(double speed)
{
    const auto model = besideVessel();
    haptics::Simulation simulation(model);
    const auto body = simulation.shape().body(model.surface);
    const auto& vessel = model.structures.at(1);
    const Vec3 middle(0, vesselDepth, 0);
    Onset onset;
    onset.warnDistance = vessel.warnDistance;
    onset.warnedAt = std::numeric_limits<double>::infinity();
    haptics::DeviceSample sample;
    sample.buttons = haptics::buttonDeadMan;
    for (double pressed = -1e-3; pressed <= deepestOnset; pressed += speed * haptics::tickSeconds) {
        sample.position = Vec3(aside, pressed - ballRadius, 0);
        const haptics::TickRecord& record = simulation.tick(sample);
        const double moved = occupancy::displacementAt(body, middle).y;
        onset.points.push_back({pressed, moved, record.distance[1], vessel.distance.distance(sample.position)});
        for (std::uint32_t i = 0; i < record.eventCount; ++i) {
            if (record.events[i].kind == haptics::EventKind::warning) {
                onset.warnedAt = std::min(onset.warnedAt, pressed);
            }
        }
    }
    onset.deformedOnset = onsetOf(onset, &OnsetPoint::deformed);
    onset.restOnset = onsetOf(onset, &OnsetPoint::rest);
    return onset;
}

}  // namespace palpate::studies
