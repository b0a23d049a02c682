#pragma once

#include <haptics/tick.h>

namespace palpate::haptics {

/// Both channels of the force as they are sent; their sum is the total of equation 1.
struct SentForce {
    Vec3 basic{0.0};       // [N]
    Vec3 additional{0.0};  // [N]
    bool faulted = false;
};

/// State of stabilise() between ticks.
struct StabiliserState {
    Vec3 basic{0.0};
    Vec3 additional{0.0};
    double gain = 0;       // start-up ramp, dead-man switch, watchdog
    bool faulted = false;  // latched: the output is zero until the session ends
};

/// What stands between computed forces and a hand.
///
/// - After a force or a pose that is not finite nothing is sent any more: the fault is latched.
/// - Slew: each channel changes by at most 5 % of the cap per tick.
/// - Gain: rises to 1 in half a second; falls to zero in 50 ms when poses stop being fresh; is zero while the dead-man
///   switch is up.
/// - Cap: both channels are scaled together, so that |basic + additional| <= cap (equation 1).
SentForce stabilise(Vec3 basic, Vec3 additional, const DeviceSample& device, double cap, double dt,
                    StabiliserState& state) noexcept;

}  // namespace palpate::haptics
