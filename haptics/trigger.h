#pragma once

#include <haptics/tick.h>

#include <algorithm>
#include <cstdint>

namespace palpate::haptics {

/// A button that a viewer has pressed, from how often it has: down for a while, and then up for as long.
struct Trigger {
    static constexpr double pressed = 0.05;  // [s]

    std::uint32_t done = 0;  // presses that were seen
    double left = 0;         // of this one, down and up [s]

    /// Whether the button is down in this tick.
    /// @param asked  presses so far, as the viewer counts them
    bool down(std::uint32_t asked) noexcept
    {
        // A viewer that could not read what the one before it had counted begins anew: that is no press.
        if (static_cast<std::int32_t>(asked - done) < 0) {
            done = asked;
        }
        if (left <= 0.0 && asked != done) {
            done = asked;
            left = 2.0 * pressed;
        }
        const bool isDown = left > pressed;
        left = std::max(0.0, left - tickSeconds);
        return isDown;
    }
};

}  // namespace palpate::haptics
