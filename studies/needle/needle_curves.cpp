#include <studies/needle/needle_curves.h>

#include <datasets/tables.h>
#include <haptics/simulation.h>
#include <studies/stability/method.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

namespace palpate::studies {

namespace {

constexpr double outside = 5e-3;     // where a drive begins, before the surface [m]
constexpr double lineStep = 0.1e-3;  // [m]
constexpr double layersDepth = 49e-3;
constexpr double liverDepth = 50e-3;
constexpr double excisedModulus =
    2e3;                               // under the needle's law it gives the published curve, for a needle 1 mm across [Pa]
constexpr double thinNeedle = 0.5e-3;  // [m]

struct Driving {
    const RunningMethod& running;
    const NeedleDrive& drive;
    const volume::TissueTable& table;
    NeedleCurve& curve;

    void at(double depth) const
    {
        haptics::DeviceSample sample;
        sample.position = drive.entry + depth * drive.axis;
        sample.axis = drive.axis;
        sample.buttons = haptics::buttonDeadMan;
        const Vec3 force = running.tick(sample);
        const auto* record = running.record ? running.record() : nullptr;
        curve.depth.push_back(depth);
        curve.force.push_back(-glm::dot(force, drive.axis));
        curve.inserted.push_back(record ? record->inserted : 0.0);
        for (std::uint32_t i = 0; record && i < record->eventCount; ++i) {
            const auto& event = record->events[i];
            if (event.kind == haptics::EventKind::puncture) {
                curve.punctures.push_back({table.rows[event.tissue].name, depth, event.value});
            }
        }
    }
};

haptics::SessionModel withLevel(datasets::Scene scene, std::shared_ptr<const volume::Tissue> tissue,
                                datasets::ModelLevel level)
{
    scene.model.level = level;
    scene.dffb.mode = datasets::DffbMode::off;
    return haptics::buildModel(std::move(scene), std::move(tissue));
}

StabilityMethod oursAt(datasets::ModelLevel level)
{
    auto all = ourMethods();
    return *std::ranges::find(all, level, &StabilityMethod::level);
}

// A table in which every tissue has one stiffness under a punch of this radius.
volume::TissueTable evenTable(double stiffness, double radius)
{
    auto table = datasets::defaultTissues();
    for (auto& row : table.rows) {
        row.youngsModulus = stiffness * (1.0 - row.poissonRatio * row.poissonRatio) / (2.0 * radius);
    }
    return table;
}

LiverNeedle liverNeedle(std::string name, double modulus, double radius, double speed, datasets::ModelLevel level)
{
    auto table = datasets::defaultTissues();
    table.rows[*table.find("liver")].youngsModulus = modulus;
    auto scene = datasets::parseScene(
        "name = \"liver\"\n[volume]\nphantom = \"block\"\nvoxel_mm = 2\n[volume.parameters]\ntissue = \"liver\"\ntumours = "
        "0\n"
        "width_mm = 80\nthickness_mm = 80\n[target]\nstructure = \"base\"\nentry_mm = [0, 0, 0]\naim_mm = [0, 82, 0]\n",
        "liver.toml");
    scene.tool.radius = radius;
    scene.tool.notchRadius = std::min(scene.tool.notchRadius, 0.8 * radius);
    const auto tissue = std::make_shared<const volume::Tissue>(datasets::makePhantom(scene.source.phantom, table));
    const auto model = withLevel(std::move(scene), tissue, level);
    const NeedleDrive drive{model.approach.entry, Vec3(0, 1, 0), liverDepth, speed};
    return {driveNeedle(model, oursAt(level), drive, std::move(name)), modulus, radius, speed};
}

// The capsule's rupture runs on for some millimetres: what is beyond it is compared.
void compareLiver(LiverNeedle& liver)
{
    constexpr double ruptureLength = 6e-3;
    const auto& c = liver.curve;
    const double broken = c.punctures.empty() ? liverDepth : c.punctures.front().depth;
    for (std::size_t i = 0; i < c.turn; ++i) {
        if (c.depth[i] > 0.0 && c.depth[i] < broken) {
            const double off = std::abs(c.force[i] - publishedLiverForce(c.depth[i]));
            liver.furthestBefore = std::max(liver.furthestBefore, off);
        } else if (c.depth[i] > broken + ruptureLength) {
            const double low = liverCutting + liverFrictionLow * c.inserted[i] - liverSpread;
            const double high = liverCutting + liverFrictionHigh * c.inserted[i] + liverSpread;
            liver.outsideAfter = std::max({liver.outsideAfter, low - c.force[i], c.force[i] - high});
        }
    }
}

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
    return haptics::buildModel(std::move(scene));
}

double onsetOf(const Onset& onset, double OnsetPoint::*distance)
{
    const auto near = [&](const OnsetPoint& p) { return p.*distance < onset.warnDistance; };
    const auto first = std::ranges::find_if(onset.points, near);
    return first == onset.points.end() ? std::numeric_limits<double>::infinity() : first->pressed;
}

}  // namespace

NeedleCurve driveNeedle(const haptics::SessionModel& model, const StabilityMethod& method, const NeedleDrive& drive,
                        std::string name)
{
    const MethodScene scene{model, haptics::deviceParameters(model.scene.device)};
    const RunningMethod running = method.start(scene);
    NeedleCurve curve;
    curve.name = std::move(name);
    const Driving driving{running, drive, model.tissue->table(), curve};
    // Forces are ramped up after the start.
    for (double t = 0.0; t < haptics::settledAfter; t += scene.period) {
        driving.at(-outside);
    }
    const double step = drive.speed * scene.period;
    const auto steps = static_cast<int>(std::ceil((drive.depth + outside) / step));
    curve = NeedleCurve{curve.name, {}, {}, {}, 0, {}};
    for (int i = 0; i <= steps; ++i) {
        driving.at(std::min(-outside + i * step, drive.depth));
    }
    curve.turn = curve.depth.size();
    for (int i = 1; i <= steps; ++i) {
        driving.at(std::max(drive.depth - i * step, -outside));
    }
    return curve;
}

std::vector<NeedleBoundary> boundariesOn(const haptics::SessionModel& model, const NeedleDrive& drive)
{
    const volume::Tissue::Reader reader(*model.tissue);
    std::vector<NeedleBoundary> found;
    std::uint8_t before = 0;
    for (double depth = 0.5 * lineStep; depth < drive.depth; depth += lineStep) {
        const auto here = reader.tissue(drive.entry + depth * drive.axis);
        if (here != before && here != 0) {
            found.push_back({model.tissue->table().rows[here].name, depth - 0.5 * lineStep, 0.0});
        }
        before = here;
    }
    return found;
}

std::vector<double> fallsOf(const NeedleCurve& curve, double least)
{
    constexpr double within = 1e-3;
    std::vector<double> falls;
    std::size_t peak = 0;
    for (std::size_t i = 0; i < curve.turn; ++i) {
        const bool old = curve.depth[i] - curve.depth[peak] > within;
        if (curve.force[i] >= curve.force[peak] || old) {
            peak = i;
        } else if (curve.force[peak] - curve.force[i] >= least) {
            falls.push_back(curve.depth[peak]);
            // The rest of the same fall is no other one.
            while (i + 1 < curve.turn && curve.force[i + 1] < curve.force[i]) {
                ++i;
            }
            peak = i;
        }
    }
    return falls;
}

LayeredNeedle layeredNeedle(datasets::ModelLevel level, double speed)
{
    const auto scene = *datasets::builtInScene("layered");
    const auto tissue = std::make_shared<const volume::Tissue>(datasets::sceneVolume(scene));
    const auto even = std::make_shared<const volume::Tissue>(
        datasets::makePhantom(scene.source.phantom, evenTable(layerStiffness, scene.tool.radius)));
    const auto volume = withLevel(scene, tissue, level);
    const auto soft = withLevel(scene, tissue, datasets::ModelLevel::spring);
    const auto stiff = withLevel(scene, even, datasets::ModelLevel::spring);
    const Vec3 axis = glm::normalize(volume.approach.aim - volume.approach.entry);
    const NeedleDrive drive{volume.approach.entry, axis, layersDepth, speed};
    return {boundariesOn(volume, drive),
            {driveNeedle(volume, oursAt(level), drive, "volume (Palpate)"),
             driveNeedle(stiff, layers(), drive, "layers, K set"),
             driveNeedle(soft, layers(), drive, "layers, K from the tissue")}};
}

double publishedLiverForce(double depth) noexcept
{
    const double z = 1e3 * depth;
    return 0.0020 * z + 0.0023 * z * z;
}

std::vector<LiverNeedle> liverNeedles(datasets::ModelLevel level)
{
    constexpr double slow = 3e-3;
    const auto table = datasets::defaultTissues();
    const double living = table.rows[*table.find("liver")].youngsModulus;
    const double core = datasets::ToolSpec{}.radius;
    std::vector<LiverNeedle> all;
    all.push_back(liverNeedle("2 kPa, needle 1 mm", excisedModulus, thinNeedle, slow, level));
    all.push_back(liverNeedle("the table's 6 kPa", living, thinNeedle, slow, level));
    all.push_back(liverNeedle("14 G needle", excisedModulus, core, slow, level));
    all.push_back(liverNeedle("ten times as fast", excisedModulus, thinNeedle, 10.0 * slow, level));
    all.push_back(liverNeedle("6 kPa and 14 G", living, core, slow, level));
    for (auto& liver : all) {
        compareLiver(liver);
    }
    return all;
}

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
