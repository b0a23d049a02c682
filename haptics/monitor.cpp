#include <haptics/monitor.h>

#include <channel/layout.h>
#include <haptics/events.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::haptics {

namespace {

// A warning ends only this much beyond its distance, so that it cannot flicker.
constexpr double hysteresis = 1.1;
constexpr double graspLength = 4e-3;   // distance below which a needle's tip becomes that of the tissue at it [m]
constexpr double monitorBand = 30.0;   // the tip's speed passes a low-pass at this frequency [Hz]
constexpr double beyondThrow = 10e-3;  // seen of what lies behind the end of a gun's throw [m]
constexpr int restSteps = 3;           // from one point of the line to the next
constexpr int halvings = 5;            // of a step that ends in another tissue
constexpr double farAway = 1.0;        // where a core was taken every structure is [m]

Proximity proximityOf(const GuardedStructure& s, const occupancy::Body& body, const TipState& tip, Vec3 position) noexcept
{
    const double d = s.distance.distance(tip.proxy);
    const Vec3 normal = s.distance.normal(tip.proxy);
    if (d <= 0.0) {
        // Where no side is nearer the field is flat, and nothing pushes: across the middle the push turns round in steps
        // that a hand can follow. At the surface it is whole.
        const double steep = std::min(1.0, glm::length(s.distance.gradient(tip.proxy)));
        return {d, glm::mix(1.0, steep, std::min(1.0, -d / s.distance.grid.spacing)) * normal, s.gain, true, false};
    }
    // The lattice follows the tip closely and not exactly. Near the structure the tip counts as where the tissue is that it
    // has hold of, so that the distance goes through zero where the tip goes into the structure.
    Vec3 from = position;
    if (tip.phase == Phase::inserted && d < graspLength) {
        from = glm::mix(tip.proxy + occupancy::displacementAt(body, tip.proxy), position, d / graspLength);
    }
    const Vec3 nearest = tip.proxy - d * normal;
    const Vec3 away = from - (nearest + occupancy::displacementAt(body, nearest));
    const double length = glm::length(away);
    return {length, length > 1e-6 ? away / length : normal, s.gain, true, false};
}

// Begins below `limit` and ends a tenth above it; an event when it begins.
void warn(EventKind kind, std::uint8_t structure, double distance, double limit, double value, bool& on,
          TickRecord& record) noexcept
{
    const bool now = distance < limit * (on ? hysteresis : 1.0);
    if (now && !on) {
        addEvent(record, {kind, structure, 0, value});
    }
    on = now;
}

WarningLevel levelOf(const MonitorState& state, std::size_t i) noexcept
{
    return state.touching[i]   ? WarningLevel::touch
           : state.veryNear[i] ? WarningLevel::veryNear
           : state.near[i]     ? WarningLevel::near
                               : WarningLevel::none;
}

}  // namespace

std::array<Proximity, maxStructures> monitor(const SessionModel& model, const occupancy::Body& body, const TipState& tip,
                                             Vec3 position, MonitorState& state, TickRecord& record) noexcept
{
    std::array<Proximity, maxStructures> found{};
    const double reach = touchReach(tip.phase, model.scene.tool.radius);
    for (std::size_t i = 0; i < model.structures.size(); ++i) {
        const auto& s = model.structures[i];
        found[i] = proximityOf(s, body, tip, position);
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
        warn(EventKind::warning, index, d, s.warnDistance, d, state.near[i], record);
        warn(EventKind::veryNear, index, d, veryNearShare * s.warnDistance, d, state.veryNear[i], record);
        warn(EventKind::vitalTouch, index, d, reach, reach - d, state.touching[i], record);
        found[i].touching = state.touching[i];
        const auto level = levelOf(state, i);
        const bool nearer = level == record.warning && record.warned != 0xFF && d < record.distance[record.warned];
        if (level > record.warning || (level != WarningLevel::none && nearer)) {
            record.warning = level;
            record.warned = index;
        }
    }
    return found;
}

LookAhead lookAhead(const SessionModel& model, const volume::Tissue::Reader& reader, const occupancy::Body& body,
                    const TipState& tip, const DeviceSample& tool, double dt, MonitorState& state) noexcept
{
    LookAhead found;
    if (model.scene.tool.kind != datasets::ToolKind::needle) {
        return found;
    }
    state.last = state.started ? state.last : tool.position;
    state.started = true;
    const double blend = 1.0 - 1.0 / (1.0 + 2.0 * std::numbers::pi * monitorBand * dt);
    state.speed += blend * (glm::dot(tool.position - state.last, tool.axis) / dt - state.speed);
    state.last = tool.position;
    found.speed = state.speed;

    const double radius = model.scene.tool.radius;
    const std::uint8_t here = tip.phase == Phase::inserted ? tip.tissue : 0;
    const double reach = std::max(channel::lookAheadReach, model.scene.tool.throwLength + beyondThrow);
    const int steps = static_cast<int>(std::lround(reach / lookAheadStep));
    const HolesNear holes(tip.needle.cuts, tip.proxy + 0.5 * reach * tool.axis, reach);
    const auto distanceTo = [&](std::size_t i, Vec3 p, bool hole) {
        const volume::DistanceField& field = model.structures[i].distance;
        // All of a structure lies in its field's grid: from so far beside it no step of the line gets there.
        return hole || field.besideGrid(p) > radius + 2.0 * lookAheadStep ? farAway : field.distance(p);
    };
    std::array<double, maxStructures> before{};
    Vec3 rest = tip.proxy;
    for (std::size_t i = 0; i < model.structures.size(); ++i) {
        before[i] = distanceTo(i, rest, holes.contain(rest));
        found.structure[i] = before[i] <= radius ? 0.0 : found.structure[i];
    }
    for (int k = 1; k <= steps; ++k) {
        const Vec3 p = tool.position + k * lookAheadStep * tool.axis;
        const Vec3 last = rest;
        rest += lookAheadStep * tool.axis;
        for (int n = 0; n < restSteps; ++n) {
            rest = p - occupancy::displacementAt(body, rest);
        }
        const bool hole = holes.contain(rest);
        for (std::size_t i = 0; i < model.structures.size(); ++i) {
            const double d = distanceTo(i, rest, hole);
            if (d <= radius && before[i] > radius && std::isinf(found.structure[i])) {
                found.structure[i] = (k - 1 + (before[i] - radius) / (before[i] - d)) * lookAheadStep;
            }
            before[i] = d;
        }
        const auto left = [&](Vec3 at) { return holes.contain(at) ? std::uint8_t{0} : reader.tissue(at); };
        const auto next = hole ? std::uint8_t{0} : reader.tissue(rest);
        if (std::isinf(found.tissueDistance) && next != here && next != 0) {
            found.tissue = next;
            double low = 0.0, high = 1.0;
            for (int n = 0; n < halvings; ++n) {
                const double middle = 0.5 * (low + high);
                (left(glm::mix(last, rest, middle)) == next ? high : low) = middle;
            }
            found.tissueDistance = (k - 1 + high) * lookAheadStep;
        }
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
