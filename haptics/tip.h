#pragma once

#include <haptics/contact_law.h>
#include <haptics/session_model.h>
#include <haptics/tick.h>
#include <occupancy/query.h>

namespace palpate::haptics {

/// How the tool's tip holds on to tissue. The proxy is the material point, at rest, that the tip has hold of: on the
/// surface while it presses, inside while a needle cuts. The tissue there is displaced by tip - proxy, and the force is
/// that of the depth law over the same way; the proxy gives way towards the tip only when the tissue fails (slips, is
/// pierced, is cut), so that it only ever takes energy out.
struct TipState {
    Phase phase = Phase::free;
    Vec3 proxy{0.0};          // at rest; while free: the tip itself [m]
    Vec3 normal{0.0};         // out of the body at the proxy, while in contact
    Vec3 entry{0.0};          // where the needle went in, at rest [m]
    Vec3 deepest{0.0};        // end of the path that is cut, at rest [m]
    double inserted = 0;      // length of the shaft inside, at rest [m]
    double anchor = 0;        // where the shaft sticks, along the needle from `entry` [m]
    std::uint8_t tissue = 0;  // row at the proxy
};

/// One tick of the tip; returns the basic force F_BFFB [N].
/// @param way  from the last pose to this one through the deformed body; looked at while the tip is free
///
/// Contact: the proxy stays on the surface; it slips where the force leaves the cone of friction, without friction for a
/// sphere. Puncture: when the force along the needle reaches the tissue's puncture force. Inside: at the tip the force
/// stays at the cutting force of the tissue, and a boundary to another tissue holds until that one's puncture force is
/// reached; along the shaft stick and slip by tissue and inserted length; sideways the tissue gives way at three times the
/// cutting force. Withdrawal follows the cut path freely but for the shaft.
/// Sources: Simone and Okamura, "Modeling of needle insertion forces for robot-assisted percutaneous therapy", ICRA 2002;
/// contact proxy after Zilles and Salisbury, "A constraint-based god-object method for haptic display", IROS 1995.
///
/// At most `cutSteps` steps of `cutStep` per tick: the proxy never outruns 1 m/s, and neither does a rupture.
Vec3 moveTip(const SessionModel& model, const volume::Tissue::Reader& reader, const occupancy::Body& body,
             const DeviceSample& device, const occupancy::Sweep& way, TipState& tip, TickRecord& record) noexcept;

inline constexpr double cutStep = 0.25e-3;  // [m]
inline constexpr int cutSteps = 4;

}  // namespace palpate::haptics
