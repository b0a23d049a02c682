#pragma once

#include <haptics/arm.h>
#include <haptics/motion.h>
#include <haptics/tick.h>

#include <array>
#include <cstddef>

namespace palpate::haptics {

/// What the stabiliser knows of the loop that it stands in.
struct StabiliserOptions {
    DeviceParameters device = deviceParameters("premium");
    double period = tickSeconds;  // between samples [s]
    double cap = 8.5;             // on the force [N]; the device's peak where that is lower
};

/// What a loop stands.
struct StableLimits {
    double stiffness = 0;  // of a spring that is stable [N/m]
    double pressed = 0;    // up to this the force passes unchanged while the hand moves [N/m]
    double resting = 0;    // and while it rests
    double damping = 0;    // the most that is added [N s/m]
};

/// Stable: half of (b + B) / (T / 2 + t_d) (Gil et al., "Stability analysis of a 1 DOF haptic interface using the
/// Routh-Hurwitz criterion", 2004), t_d with the lag of the amplifier. B is about a third of m over the time that the
/// damping comes late. Pressed: 7 kN/m at most; the frames of these devices give way before. Resting: 2 c / D at most,
/// beyond which friction c does not end what an encoder of step D begins (Abbott and Okamura, "Effects of position
/// quantization and sampling rate on virtual-wall passivity", 2005).
StableLimits stableLimits(const StabiliserOptions& options) noexcept;

/// The force as it is sent: equation 1. The controller's damping is in the channels, in each what its own stiffness asks
/// for.
struct SentForce {
    Vec3 basic{0.0};       // [N]
    Vec3 additional{0.0};  // [N]
    bool faulted = false;

    Vec3 total() const noexcept { return basic + additional; }
};

/// The same with the damping of the basic force apart.
struct RenderedForce {
    Vec3 basic{0.0};       // [N]
    Vec3 additional{0.0};  // [N]
    Vec3 damping{0.0};     // [N]

    Vec3 total() const noexcept { return basic + additional + damping; }
};

/// The last positions and forces.
struct MotionWindow {
    PositionWindow read;
    std::array<Vec3, PositionWindow::longest> force{};  // as rendered in answer [N]
    std::array<Vec3, PositionWindow::longest> basic{};  // the tissue's part of it [N]
};

/// What the window says of the motion.
struct Motion {
    Vec3 velocity{0.0};    // [m/s]
    double time = 0;       // that it is the mean of [s]
    double stiffness = 0;  // what the force fell by along the way, over the way [N/m]
    double basic = 0;      // the same of the tissue's part [N/m]
};

/// Over the longest window in which the motion is straight; see straightSince().
Motion motionIn(const MotionWindow& window, double encoder, double period) noexcept;

/// The energy that went through the port.
struct EnergyLedger {
    static constexpr std::size_t longest = 256;  // periods of delay
    std::array<RenderedForce, longest> sent{};   // by tick, modulo
    std::size_t ticks = 0;
    double given = 0;   // net, to the hand [J]
    double tissue = 0;  // the part of it that tissue and controller gave, less what the device's friction took for sure [J]
    double stored = 0;  // what tissue would give back in an ideal loop [J]
    double damped = 0;  // taken by the controller for the basic force [J]
    double owing = 0;   // time that tissue has given more than it may [s]
    double worst = 0;   // and the most that it gave in that time [J]
    double again = 0;   // by how much that grew when the guard had had its time to act [J]
};

/// State of stabilise() between ticks.
struct StabiliserState {
    Vec3 position{0.0};  // in the tick before [m]
    Vec3 read{0.0};      // by the encoder, in the tick before [m]
    bool started = false;
    double unsettled = 0;  // time that a pose that jumped still has to hold still [s]
    Vec3 resting{0.0};     // where the hand stands still [m], and since when [s]
    double rest = 0;
    Vec3 tissue{0.0};   // basic force of the tick before, as computed, see beyondCap() [N]
    Vec3 atCap{0.0};    // where it was last within the cap [m]
    Vec3 coupled{0.0};  // what the virtual coupling made of it [N]
    MotionWindow window;
    EnergyLedger ledger;
    double speed = 0;     // when a pose was last fresh [m/s]
    double presumed = 0;  // energy that tissue may have given since then [J]
    double guard = 1;     // fraction of the basic force that the ledger allows
    double gain = 0;      // start-up ramp, dead-man switch, watchdog
    RenderedForce sent;
    bool faulted = false;  // latched: the output is zero until the session ends
};

/// What stands between computed forces and a hand; in this order:
///
/// - Fault: after a force or a pose that is not finite nothing is sent any more; neither after a sum that would not be
///   finite, nor with a cap, a period or a delay of the device that limits nothing (negative, not a number).
/// - Virtual coupling: while the force rises faster along the motion than the stable stiffness, it rises at that, as
///   through a spring in series, and catches up when the hand is slow or stands still. Below it the force passes unchanged.
/// - Passivity: a force that is held for a period and comes late gives K v^2 (T / 2 + t_d) more than the tissue would
///   (measured against the trapezoid rule; Ryu, Preusche, Hannaford and Hirzinger, "Time domain passivity control with
///   reference energy following", 2005). What the device's friction does not take of it, a damping force takes. It
///   looks at the last milliseconds alone, so it neither saves credit nor acts late. As the last guard, where the tissue
///   would end up with 0.4 mJ more than it ever got, its force on the way out is scaled down until that is paid back. While
///   no fresh pose comes the hand is presumed to move on at its speed, along the force. Where the debt grows all the same,
///   ways in and out change faster than the guard can act (a faulty encoder): then tissue and damping end until it is paid,
///   or until the dead-man switch is let go.
/// - Gain: rises to 1 in half a second; falls to zero in 50 ms when poses stop being fresh or jump (over 10 m/s); is zero
///   while the dead-man switch is up.
/// - Cap: all parts are scaled together, so that their sum is at most the cap (equation 1).
/// - Slew: neither the sum nor a channel changes by more than 5 % of the cap per millisecond. Only on the way out,
///   and while poses are fresh, a force may fall by the stable stiffness times the motion beside it: a spring that unloads
///   late kicks. That is the motion that was read in this tick: while the encoder stands still there is none, whatever is
///   estimated between its steps. A fault and the dead-man switch end the force at once.
///
/// @param device  the pose, between encoder steps where that is estimated
/// @param read    what the encoder said [m]
SentForce stabilise(Vec3 basic, Vec3 additional, const DeviceSample& device, Vec3 read, const StabiliserOptions& options,
                    StabiliserState& state) noexcept;

/// The same where the pose is what was read.
inline SentForce stabilise(Vec3 basic, Vec3 additional, const DeviceSample& device, const StabiliserOptions& options,
                           StabiliserState& state) noexcept
{
    return stabilise(basic, additional, device, device.position, options, state);
}

}  // namespace palpate::haptics
