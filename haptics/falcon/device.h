#pragma once

#include <haptics/device.h>
#include <haptics/falcon/buttons.h>
#include <haptics/falcon/driver.h>
#include <haptics/session_model.h>

#include <memory>

namespace palpate::falcon {

/// Directions of the Falcon in the patient: pushing away from the user is along the tool, and up stays as near to the head
/// as that allows (to the front where the tool goes along the body).
Mat3 facing(Vec3 axis) noexcept;

/// The Falcon as the hand of a session. Its grip is the tool's tip: the first pose is put to where the session starts, from
/// there on every way is as long in the patient as at the grip. It turns nothing: the tool keeps its axis.
///
/// Centre button, held: forces are on (dead-man switch); forward: fires; right: marks a place; left, for a second: ends the
/// session.
class FalconDevice final : public haptics::Device {
public:
    static constexpr double fresh = 5e-3;   // a pose is for so long: a Falcon on a hub answers every 2 ms or so [s]
    static constexpr double endHeld = 1.0;  // of the left button [s]

    /// The tip starts at `start`, patient frame [m]; `axis` is the tool's, towards its tip (unit vector).
    FalconDevice(std::shared_ptr<Driver> driver, Vec3 start, Vec3 axis);

    haptics::DeviceSample read() noexcept override;
    void write(Vec3 force) noexcept override;
    bool finished() const noexcept override { return ending_ || driver_->ended(); }
    std::string problem() const override { return driver_->problem(); }

private:
    std::shared_ptr<Driver> driver_;
    Vec3 start_, axis_;
    Mat3 turn_;  // Falcon's frame to the patient's
    GripPose pose_;
    Vec3 origin_{0.0};  // grip at the start, Falcon's frame [m]
    bool started_ = false;
    SteadyButton fire_, mark_;
    double leftHeld_ = 0;  // [s]
    bool ending_ = false;
};

/// The Falcon in a session, its tip `distance` [m] outside the body on the planned line.
std::unique_ptr<FalconDevice> falconBefore(const haptics::SessionModel& model, std::shared_ptr<Driver> driver,
                                           double distance);

}  // namespace palpate::falcon
