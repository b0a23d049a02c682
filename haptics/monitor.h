#pragma once

#include <haptics/dffb.h>
#include <haptics/session_model.h>
#include <haptics/tip.h>
#include <occupancy/body.h>

#include <array>

namespace palpate::haptics {

/// State of the warnings between ticks.
struct MonitorState {
    std::array<bool, maxStructures> near{};
    std::array<bool, maxStructures> touching{};
};

/// Task H6: distance and direction from the tip to the target and to every vital structure, in the deformed tissue, and
/// the events that follow from them.
///
/// The nearest point of a structure at rest is Y = X - d grad d, X being the tissue at the tip and d the distance field;
/// now it is at Y + u(Y). Fills record.distance and record.nearestVital.
std::array<Proximity, maxStructures> monitor(const SessionModel& model, const occupancy::Body& body, const TipState& tip,
                                             Vec3 position, MonitorState& state, TickRecord& record) noexcept;

/// Looks along a needle's throw: which vital structures lie within the needle's radius of the way from `from` to `to` [m],
/// in the deformed tissue. Adds an event for each.
void monitorThrow(const SessionModel& model, const occupancy::Body& body, Vec3 from, Vec3 to, TickRecord& record) noexcept;

}  // namespace palpate::haptics
