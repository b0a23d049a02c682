#pragma once

#include <channel/layout.h>
#include <haptics/arm.h>
#include <haptics/device.h>
#include <haptics/probe_follower.h>
#include <haptics/session_model.h>
#include <haptics/trigger.h>

#include <cstdint>
#include <functional>
#include <optional>

namespace palpate::haptics {

/// The hand of a viewer's user: the mouse says where the tool is to be, and a simulated stylus in a simulated grip follows
/// it, so that tissue holds the tool back as it would hold a hand: how far it stays behind the mouse is what would be felt.
///
/// The mouse comes in jumps, one per picture. A goal follows it with a lag of the first order and no faster than a hand
/// moves, and the grip pulls the stylus after the goal. A press of the dead-man switch starts where the tool is, and while
/// it is up the tool stays: nothing jumps.
///
/// When the viewer is stuck or dead (its beat stands still) the samples are no longer fresh, so that the stabiliser fades
/// the force to zero, and the tool stays where it is.
class MouseDevice final : public Device {
public:
    /// What the viewer has written last; nothing while there is none. Must neither allocate nor block.
    using Source = std::function<std::optional<channel::Input>()>;

    /// The tip waits at `start` [m] until the viewer's hand moves it; `axis` is the tool's (unit vector).
    MouseDevice(const DeviceParameters& device, Source source, Vec3 start, Vec3 axis);

    DeviceSample read() noexcept override;
    void write(Vec3 force) noexcept override { arm_.write(force); }
    bool finished() const noexcept override { return ended_; }

    static constexpr double fastest = 0.25;        // of the goal [m/s]
    static constexpr double fastestTurn = 1.5;     // of the axis [rad/s]
    static constexpr double lag = 0.02;            // of the goal behind the mouse [s]
    static constexpr double longestSilence = 0.5;  // of a viewer that lives: a slow picture takes so long [s]
    // Critically damped, so that a jump of the mouse does not ring; as stiff as a hand's.
    static constexpr Grip grip{0.1, 16.0, 400.0};

private:
    void listen() noexcept;
    void follow() noexcept;
    void turn() noexcept;

    Source source_;
    Arm arm_;
    channel::Input input_;
    bool heard_ = false;
    double silence_ = 0;  // since the beat changed [s]
    Vec3 offset_{0.0};    // from the mouse to the tool when the dead-man switch was pressed [m]
    Vec3 goal_{0.0};      // [m]
    Vec3 axis_{0.0};
    ProbeFollower probe_;
    Trigger fire_, mark_, unmark_, picture_;
    bool ended_ = false;
};

/// Where a tool waits.
struct Start {
    Vec3 tip{0.0};       // [m]
    Vec3 axis{0, 1, 0};  // unit vector along the tool, towards the tip
};

/// A place and a direction that say nothing of the plan: 15 to 25 mm beside the planned entry, at least `distance` [m]
/// above the body, a needle 10 to 20 degrees oblique and not towards the target. They follow from the seed.
Start startOffPlan(const SessionModel& model, double distance, std::uint64_t seed) noexcept;

/// The mouse with the scene's device in the hand, where startOffPlan() says.
MouseDevice mouseOffPlan(const SessionModel& model, MouseDevice::Source source, double distance, std::uint64_t seed);

/// The mouse with the scene's device in the hand, its tip `distance` [m] outside the body on the planned line.
MouseDevice mouseBefore(const SessionModel& model, MouseDevice::Source source, double distance);

}  // namespace palpate::haptics
