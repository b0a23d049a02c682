#pragma once

#include <haptics/tick.h>

#include <array>
#include <cstddef>

namespace palpate::haptics {

/// The last positions read.
struct PositionWindow {
    static constexpr std::size_t longest = 32;
    std::array<Vec3, longest> position{};  // [m], newest at `newest`
    std::size_t newest = 0, count = 0;

    void add(Vec3 at) noexcept;
    std::size_t back(std::size_t n) const noexcept { return (newest + longest - n) % longest; }
};

/// Adaptive windowing: how many periods ago the longest window begins in which no position is off the straight line between
/// its ends by more than an encoder step, and that is 4 ms at most; 0 before there are two positions. (Janabi-Sharifi,
/// Hayward and Chen, "Discrete-time adaptive windowing for velocity estimation", IEEE Trans. Control Systems Technology 8,
/// 2000.)
/// @param encoder  step of the position read [m]    @param period  between samples [s]
std::size_t straightSince(const PositionWindow& window, double encoder, double period) noexcept;

/// Length of the longest such window [s].
inline constexpr double longestStraight = 4e-3;

/// State of betweenSteps().
struct EncoderState {
    PositionWindow read;
    Vec3 position{0.0};  // as it was estimated last [m]
};

/// Where the tip is between two encoder steps [m]: it goes on at the velocity of the last readings, and never leaves the
/// box of half a step around what is read. So a slow motion is felt as a motion, and not as a stair that a stiff tissue
/// turns into knocks; and what is read is never contradicted, so that the estimate does not lag. Without an encoder it is
/// what is read.
Vec3 betweenSteps(Vec3 read, double encoder, double period, EncoderState& state) noexcept;

}  // namespace palpate::haptics
