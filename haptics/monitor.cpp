#include <haptics/monitor.h>

#include <haptics/events.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>

namespace palpate::haptics {

namespace {

// A warning ends only this much beyond its distance, so that it cannot flicker.
constexpr double hysteresis = 1.1;

Proximity proximityOf(const GuardedStructure& s, const occupancy::Body& body, Vec3 rest, Vec3 position) noexcept
{
    const double d = s.distance.distance(rest);
    const Vec3 normal = s.distance.normal(rest);
    if (d <= 0.0) {
        return {d, normal, s.gain, true, false};
    }
    const Vec3 nearest = rest - d * normal;
    const Vec3 away = position - (nearest + occupancy::displacementAt(body, nearest));
    const double length = glm::length(away);
    return {length, length > 1e-6 ? away / length : normal, s.gain, true, false};
}

}  // namespace

std::array<Proximity, maxStructures> monitor(const SessionModel& model, const occupancy::Body& body, const TipState& tip,
                                             Vec3 position, MonitorState& state, TickRecord& record) noexcept
{
    std::array<Proximity, maxStructures> found{};
    const double radius = model.scene.tool.radius;
    for (std::size_t i = 0; i < model.structures.size(); ++i) {
        const auto& s = model.structures[i];
        found[i] = proximityOf(s, body, tip.proxy, position);
        found[i].vital = i != 0;
        const double d = found[i].distance;
        record.distance[i] = d;
        if (i == 0) {
            continue;
        }
        const auto index = static_cast<std::uint8_t>(i);
        if (record.nearestVital == 0xFF || d < record.distance[record.nearestVital]) {
            record.nearestVital = index;
        }
        if (d < s.warnDistance && !state.near[i]) {
            addEvent(record, {EventKind::warning, index, 0, d});
        }
        state.near[i] = d < s.warnDistance * (state.near[i] ? hysteresis : 1.0);
        found[i].touching = tip.phase != Phase::free && d < radius;
        if (found[i].touching && !state.touching[i]) {
            addEvent(record, {EventKind::vitalTouch, index, 0, radius - d});
        }
        state.touching[i] = found[i].touching;
    }
    return found;
}

void monitorThrow(const SessionModel& model, const occupancy::Body& body, Vec3 from, Vec3 to, TickRecord& record) noexcept
{
    constexpr int samples = 64;
    const double radius = model.scene.tool.radius;
    for (std::size_t i = 1; i < model.structures.size(); ++i) {
        double least = radius;
        for (int k = 0; k < samples; ++k) {
            const Vec3 p = glm::mix(from, to, (k + 0.5) / samples);
            least = std::min(least, model.structures[i].distance.distance(occupancy::restPoint(body, p)));
        }
        if (least < radius) {
            addEvent(record, {EventKind::vitalTouch, static_cast<std::uint8_t>(i), 0, radius - least});
        }
    }
}

}  // namespace palpate::haptics
