#pragma once

#include <haptics/tick.h>

#include <string>

namespace palpate::haptics {

/// A haptic device: real, simulated or replayed. Called from the servo thread, once each per tick.
class Device {
public:
    virtual ~Device() = default;
    /// H2. Allocates nothing, never blocks.
    virtual DeviceSample read() noexcept = 0;
    /// H5: the force on the hand [N].
    virtual void write(Vec3 force) noexcept = 0;
    /// What is on the trainee's screens after the tick, for a simulated hand that looks at them. Allocates nothing.
    virtual void observe(const TickRecord& /*record*/) noexcept {}
    /// True when there is nothing more to do: the script or the record has come to its end.
    virtual bool finished() const noexcept = 0;
    /// What ended it before its time, for the user; empty: nothing. Not from the servo thread.
    virtual std::string problem() const { return {}; }
};

}  // namespace palpate::haptics
