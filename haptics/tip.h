#pragma once

#include <haptics/needle.h>
#include <haptics/pushed_way.h>
#include <haptics/session_model.h>
#include <haptics/tick.h>
#include <occupancy/query.h>

namespace palpate::haptics {

/// How the tool's tip holds on to tissue. The proxy is the material point, at rest, that the tip has hold of: on the
/// surface while it presses, inside while a needle cuts. The tissue there is displaced by tip - proxy, and the force is
/// that of the depth law over the same way, but for what other tools displace; the proxy gives way towards the tip only
/// when the tissue fails (slips, is pierced, is cut), so that it only ever takes energy out.
struct TipState {
    Phase phase = Phase::free;
    Vec3 proxy{0.0};   // at rest; while free: the tip itself [m]
    Vec3 place{0.0};   // at rest, of the tool's axis: over what it touches, while in contact; a point's the proxy [m]
    Vec3 normal{0.0};  // out of the body there, while in contact
    std::uint8_t tissue = 0;  // row at the proxy
    RelaxingForce lost;       // of the force while in contact
    NeedleState needle;       // while inserted; its cuts stay
    double others = 0;        // size of the force of tools that press besides, in the tick before [N]
    PushedWay pushed;         // by them, on the needle's way; of another tool, where it touches
};

/// One tick of the tip of a tool whose pose is `tool`; returns the basic force F_BFFB [N].
/// @param way  from the last pose to this one through the deformed body; looked at while the tip is free
/// @param dt   period of the loop [s]
///
/// Contact: the proxy stays on the surface; it slips where the force leaves the cone of friction, without friction for a
/// sphere. Puncture: when the force along the needle reaches the tissue's puncture force; into the mouth of a path that was
/// cut before, at once. Inside: moveNeedle().
/// Sources: Simone and Okamura, "Modeling of needle insertion forces for robot-assisted percutaneous therapy", ICRA 2002;
/// contact proxy after Zilles and Salisbury, "A constraint-based god-object method for haptic display", IROS 1995.
Vec3 moveTip(const SessionModel& model, const volume::Tissue::Reader& reader, const occupancy::Body& body,
             const DeviceSample& tool, const occupancy::Sweep& way, double dt, TipState& tip, TickRecord& record) noexcept;

}  // namespace palpate::haptics
