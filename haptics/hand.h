#pragma once

#include <datasets/scene.h>
#include <haptics/arm.h>
#include <haptics/device.h>
#include <haptics/session_model.h>

#include <vector>

namespace palpate::haptics {

/// How the hand holds the device and what it feels. Default: a firm stylus grip (docs and tissue tables give the ranges).
struct HandParameters {
    DeviceParameters device = deviceParameters("premium");
    Grip grip;
};

/// Simulated device and hand that follow a script: the hand's goal moves along straight lines, the grip pulls the stylus
/// after it, the force of the device acts back. It lives in ticks, not in wall time: a late tick changes nothing.
class HandDevice final : public Device {
public:
    /// Of a tool along `axis` (unit vector, towards its tip) whose tip starts at `start` [m].
    HandDevice(const HandParameters& parameters, std::vector<datasets::TraineeStep> script, Vec3 start, Vec3 axis);

    DeviceSample read() noexcept override;
    void write(Vec3 force) noexcept override;
    /// Takes what it sees of the needle: whether it is in, and how far. Without it the hand goes by what it feels.
    void observe(const TickRecord& record) noexcept override;
    bool finished() const noexcept override { return step_ >= script_.size(); }

private:
    void advance() noexcept;
    bool feltDrop() const noexcept;
    // Seen, where there is something to see: a force that drops may be a device that fades, as after missed ticks.
    bool gaveWay() const noexcept { return sees_ ? inside_ : feltDrop(); }
    bool reached(const datasets::TraineeStep& step) const noexcept;
    void nextStep() noexcept;

    std::vector<datasets::TraineeStep> script_;
    std::size_t step_ = 0;
    double inStep_ = 0;     // time since the step began [s]
    Vec3 from_{0.0};        // goal when the step began
    double travelled_ = 0;  // of the goal, along the step's line [m]
    Vec3 goal_{0.0};
    Arm arm_;
    Vec3 force_{0.0};
    double peak_ = 0;  // largest force felt in this step [N]
    Vec3 axis_{0.0};
    bool sees_ = false, inside_ = false;
    double inserted_ = 0;  // [m]
};

/// The scripted trainee of a session with the scene's device in the hand, its tip `distance` [m] outside the body on the
/// planned line.
HandDevice handBefore(const SessionModel& model, double distance);

}  // namespace palpate::haptics
