#pragma once

#include <haptics/falcon/link.h>
#include <haptics/tick.h>

#include <cstdint>
#include <functional>
#include <string_view>

namespace palpate::falcon {

/// Tells presses of the grip's buttons from what the packets say of them. A packet has no checksum, so a button is down or
/// up once all readings have said so for `settled`. What is down from the first reading on is no press.
class Presses {
public:
    static constexpr double settled = 20e-3;  // [s]

    /// @param buttons  of a reading: buttonRight | ...
    /// @param now      when it came [s]
    /// @returns        those that have gone down
    std::uint8_t take(std::uint8_t buttons, double now) noexcept;

private:
    std::uint8_t down_ = 0xFF;
    std::uint8_t seen_ = 0;
    double since_ = 0;  // [s]
    bool begun_ = false;
};

/// One button for what reads it all the time: it changes once all readings have said so for a while.
class SteadyButton {
public:
    /// @param down  of a tick's reading
    /// @returns     whether it is down
    bool take(bool down) noexcept
    {
        since_ = down == down_ ? 0.0 : since_ + haptics::tickSeconds;
        if (since_ >= Presses::settled) {
            down_ = down;
            since_ = 0.0;
        }
        return down_;
    }

private:
    double since_ = 0;  // [s]
    bool down_ = false;
};

/// "right", "forward", "centre" or "left".
/// @param button  one of buttonRight, ...
std::string_view nameOf(std::uint8_t button) noexcept;

/// Tells each press of a button, without a force, until the Falcon is lost or `ended` says so.
/// @param link     connected; it need not be homed
/// @param wire     the link's, for its clock
/// @param pressed  is told one button at a time
/// @param ended    is asked about a hundred times a second
void watchButtons(Link& link, Transport& wire, const std::function<void(std::uint8_t)>& pressed,
                  const std::function<bool()>& ended);

}  // namespace palpate::falcon
