#pragma once

#include <chainmail/displaced_lattice.h>
#include <datasets/tables.h>
#include <haptics/session_model.h>
#include <haptics/tip.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace palpate::tests {

/// A box of tissue, 48 mm wide and 60 mm deep in 1 mm voxels, under the plane y = 0 (body behind it, +y), under a 14 G
/// needle. `tissueAt(p)` names the tissue at p [m]; the structure of each is called as its tissue. `scene` is what the
/// scene has beside the target; level and additional force are off where it says nothing.
inline haptics::SessionModel boxOf(const std::function<std::string(Vec3)>& tissueAt, const std::string& target,
                                   const std::string& scene = {},
                                   const volume::TissueTable& table = datasets::defaultTissues())
{
    volume::LabelImage image;
    image.size = {48, 60, 48};
    image.affine.linear = Mat3(1e-3);
    image.affine.origin = {-23.5e-3, 0.5e-3, -23.5e-3};
    std::vector<volume::LabelName> names;
    volume::forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        const auto name = tissueAt(image.affine.toPatient(n));
        auto at = std::find_if(names.begin(), names.end(), [&](const auto& known) { return known.name == name; });
        if (at == names.end()) {
            names.push_back({static_cast<std::uint16_t>(names.size() + 1), name, name});
            at = names.end() - 1;
        }
        image.values.push_back(at->value);
    });
    auto parsed =
        datasets::parseScene("name = \"box\"\n[volume]\nphantom = \"block\"\n" + scene +
                                 "\n[target]\naim_mm = [0, 26, 0]\nentry_mm = [0, 0, 0]\nstructure = \"" + target + "\"\n",
                             "box.toml");
    auto tissue = std::make_shared<const volume::Tissue>(volume::Tissue::fromLabels(image, table, names, {}));
    return haptics::buildModel(std::move(parsed), std::move(tissue));
}

inline const std::string chainmailOnly = "[model]\nlevel = \"chainmail\"\n[dffb]\nmode = \"off\"\n";

/// Layers from the surface on: tissue and thickness [m]; the last goes on.
inline std::function<std::string(Vec3)> layers(std::vector<std::pair<std::string, double>> list)
{
    return [list = std::move(list)](Vec3 p) {
        double depth = p.y;
        for (const auto& [name, thickness] : list) {
            depth -= thickness;
            if (depth < 0.0) {
                return name;
            }
        }
        return list.back().first;
    };
}

inline const volume::TissueRow& rowOf(const haptics::SessionModel& model, const std::string& name)
{
    return model.tissue->table().rows[*model.tissue->table().find(name)];
}

/// A needle alone in tissue that keeps its shape: moveTip() and nothing else.
struct LoneNeedle {
    explicit LoneNeedle(const haptics::SessionModel& m)
        : model(m), reader(*m.tissue), shape(m.lattice), body(shape.body(m.surface))
    {
    }

    /// Force on the hand with the tip at `p` [N].
    Vec3 at(Vec3 p, Vec3 axis = {0, 1, 0})
    {
        haptics::DeviceSample device;
        device.position = p;
        device.axis = axis;
        tool = haptics::bentTool(device, tip.needle);
        record = {};
        const auto way = occupancy::sweep(body, {last, last, 0.0}, {tool.position, tool.position, 0.0});
        const Vec3 force = haptics::moveTip(model, reader, body, tool, way, dt, tip, record);
        last = tool.position;
        return force;
    }
    /// Along a straight line at `speed` [m/s]; calls visit(position, force) for every tick.
    template <typename Visit>
    void go(Vec3 from, Vec3 to, double speed, Visit&& visit, Vec3 axis = {0, 1, 0})
    {
        const int ticks = std::max(1, static_cast<int>(glm::distance(from, to) / (speed * dt)));
        for (int i = 0; i <= ticks; ++i) {
            const Vec3 p = from + (to - from) * (static_cast<double>(i) / ticks);
            visit(p, at(p, axis));
        }
    }
    void go(Vec3 from, Vec3 to, double speed, Vec3 axis = {0, 1, 0})
    {
        go(
            from, to, speed, [](Vec3, Vec3) {}, axis);
    }
    int punctures() const
    {
        int count = 0;
        for (std::uint32_t i = 0; i < record.eventCount; ++i) {
            count += record.events[i].kind == haptics::EventKind::puncture ? 1 : 0;
        }
        return count;
    }

    static constexpr double dt = 1e-3;
    const haptics::SessionModel& model;
    volume::Tissue::Reader reader;
    chainmail::DisplacedLattice shape;
    occupancy::Body body;
    haptics::TipState tip;
    haptics::DeviceSample tool;
    haptics::TickRecord record;
    Vec3 last{0.0, -10e-3, 0.0};
};

}  // namespace palpate::tests
