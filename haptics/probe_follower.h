#pragma once

#include <datasets/probe.h>
#include <haptics/tick.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate::haptics {

/// The hand that holds the probe follows what a viewer asks for, with a lag and no faster than a hand on skin.
class ProbeFollower {
public:
    static constexpr double fastest = 0.05;     // [m/s]
    static constexpr double fastestTurn = 1.5;  // [rad/s]
    static constexpr double lag = 0.02;         // [s]

    /// One tick on.
    /// @param asked  press, slide, sweep [m], rock, tilt, turn [rad]; one that is not a number leaves it where it is
    const datasets::ProbeMove& follow(const std::array<double, 6>& asked) noexcept
    {
        using Move = datasets::ProbeMove;
        constexpr std::array<double Move::*, 6> members{&Move::press, &Move::slide, &Move::sweep,
                                                        &Move::rock,  &Move::tilt,  &Move::turn};
        for (std::size_t i = 0; i < members.size(); ++i) {
            double& now = move_.*members[i];
            const double most = (i < 3 ? fastest : fastestTurn) * tickSeconds;
            const double way = (asked[i] - now) * std::min(1.0, tickSeconds / lag);
            now += std::isfinite(way) ? std::clamp(way, -most, most) : 0.0;
        }
        return move_;
    }

private:
    datasets::ProbeMove move_;
};

}  // namespace palpate::haptics
