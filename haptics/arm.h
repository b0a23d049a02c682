#pragma once

#include <haptics/tick.h>

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::haptics {

/// A haptic device as its loop knows it. The defaults are an ideal one: neither quantised nor delayed nor limited.
struct DeviceParameters {
    std::string_view name = "ideal";
    double mass = 0.075;                                         // apparent, at the tip [kg]
    double viscous = 0;                                          // friction b [N s/m]
    double coulomb = 0;                                          // friction c [N]
    double encoder = 0;                                          // step D of the position read [m]
    double forceStep = 0;                                        // of the force put out [N]
    double peakForce = std::numeric_limits<double>::infinity();  // [N]
    double bandwidth = 0;                                        // of the amplifier, a lag of first order [Hz]; 0 = no lag
    double delay = 0;         // from reading a position to the force that answers it, beside computing [s]
    std::string_view source;  // of the numbers
};

/// "premium" (PHANToM Premium 1.0), "touch" (Touch, once Omni), "falcon" (Novint Falcon), or "ideal": the defaults, for
/// positions that no encoder has read. Throws std::runtime_error for another name.
const DeviceParameters& deviceParameters(std::string_view name);
/// Those that exist: all but "ideal".
std::vector<std::string> deviceNames();

/// What the hand adds to the device: a mass that moves with it, damping against the room, a spring to the hand's goal.
struct Grip {
    double mass = 0.1;       // [kg]
    double damping = 3.0;    // [N s/m]
    double stiffness = 400;  // [N/m]
};
inline constexpr Grip released{0, 0, 0};

/// A simulated device in a simulated hand: (m + m_hand) x'' = f - (b + b_hand) x' - c x'/|x'| + k_hand (goal - x).
///
/// f is the force that was written, rounded to the force step, bounded by the peak, delayed, held until the next one is
/// due, and lagged by the amplifier. Between samples the motion is integrated in steps of at most 50 us by the midpoint
/// rule, with Coulomb friction as the set-valued law that it is: what it can hold stands still (Moreau's time stepping;
/// Acary and Brogliato, "Numerical Methods for Nonsmooth Dynamical Systems", 2008).
/// It lives in ticks and not in wall time. read() and write() allocate nothing.
class Arm {
public:
    /// @param device  its mechanics    @param grip  of the hand    @param start  where the tip rests and is held [m]
    /// @param period  between samples [s]. Throws std::runtime_error for a delay that is negative, or longer than the
    /// line holds (256 samples).
    explicit Arm(const DeviceParameters& device, const Grip& grip = {}, Vec3 start = Vec3(0.0),
                 double period = tickSeconds);

    /// Lives through one period and gives the position: each axis rounded to the nearest multiple of the encoder step [m].
    Vec3 read() noexcept;
    /// The force on the hand from now on [N], `delay` later. One that is not finite counts as none.
    void write(Vec3 force) noexcept;

    void pull(Vec3 goal) noexcept { goal_ = goal; }
    void hold(const Grip& grip) noexcept { grip_ = grip; }
    void letGo() noexcept { grip_ = released; }
    /// Puts the tip there with that velocity [m, m/s].
    void release(Vec3 position, Vec3 velocity = Vec3(0.0)) noexcept;

    const DeviceParameters& device() const noexcept { return device_; }
    double period() const noexcept { return period_; }
    Vec3 position() const noexcept { return position_; }  // the true one [m]
    Vec3 velocity() const noexcept { return velocity_; }  // [m/s]
    Vec3 force() const noexcept { return force_; }        // of the motors now [N]
    /// Work of the motors so far, and what of it the device's own friction took; exact within the integration [J]. In a
    /// loop that is passive work() - friction() never exceeds what the hand put in.
    double work() const noexcept { return work_; }
    double friction() const noexcept { return loss_; }

private:
    struct Command {
        double due = 0;  // [s]
        Vec3 force{0.0};
    };
    static constexpr std::size_t longestLine = 256;

    void live(double seconds) noexcept;
    void step(double h) noexcept;

    DeviceParameters device_;
    Grip grip_;
    double period_;
    Vec3 goal_{0.0};
    Vec3 position_{0.0};
    Vec3 velocity_{0.0};
    Vec3 command_{0.0};  // in force now [N]
    Vec3 force_{0.0};
    double work_ = 0;
    double loss_ = 0;
    double time_ = 0;
    std::uint64_t samples_ = 0;
    std::array<Command, longestLine> line_{};  // on their way, the oldest first
    std::size_t first_ = 0, waiting_ = 0;
};

}  // namespace palpate::haptics
