#pragma once

#include <haptics/dffb.h>
#include <haptics/session_model.h>
#include <haptics/tip.h>
#include <occupancy/body.h>

#include <array>

namespace palpate::haptics {

/// State of the warnings and of the look-ahead between ticks.
struct MonitorState {
    std::array<bool, maxStructures> near{};
    std::array<bool, maxStructures> veryNear{};
    std::array<bool, maxStructures> touching{};
    Vec3 last{0.0};    // tip in the tick before [m]
    double speed = 0;  // of the tip along the needle, low-passed [m/s]
    bool started = false;
};

/// Task H6: distance and direction from the tip to the target and to every vital structure, in the deformed tissue, and
/// the warnings that follow from them. Each begins with an event; it ends a tenth of its distance later than it began, so
/// that it cannot flicker. Distances are those of the tip; a touch is that of the tool's surface, see touchReach().
///
/// The nearest point of a structure at rest is Y = X - d grad d, X being the tissue at the tip and d the distance field;
/// now it is at Y + u(Y). Fills distance, nearestVital, warning and warned of the record.
std::array<Proximity, maxStructures> monitor(const SessionModel& model, const occupancy::Body& body, const TipState& tip,
                                             Vec3 position, MonitorState& state, TickRecord& record) noexcept;

/// What is ahead of a needle at `tool` on its own line: marches through the deformed tissue in steps of lookAheadStep, as
/// it is deformed now, over channel::lookAheadReach and at least a gun's throw and 10 mm more. A structure is touched
/// within the needle's radius; where a core was taken nothing is left of it. Of other tools: nothing is ahead.
/// @param dt  period of the loop [s]
LookAhead lookAhead(const SessionModel& model, const volume::Tissue::Reader& reader, const occupancy::Body& body,
                    const TipState& tip, const DeviceSample& tool, double dt, MonitorState& state) noexcept;

/// Looks along a needle's throw: which vital structures lie within the needle's radius of the way from `from` to `to` [m],
/// in the deformed tissue. Adds an event for each.
void monitorThrow(const SessionModel& model, const occupancy::Body& body, Vec3 from, Vec3 to, TickRecord& record) noexcept;

/// So near to its tip (TickRecord::distance) a tool touches a structure [m]: with its surface, and in the air with the tip
/// alone. The one measure of touches, of their time and depth, and of how near a tool came.
inline double touchReach(Phase phase, double radius) noexcept
{
    return phase != Phase::free ? radius : 0.0;
}

inline constexpr double lookAheadStep = 1e-3;  // [m]
inline constexpr double veryNearShare = 0.4;   // of the warning distance

}  // namespace palpate::haptics
