#include <haptics/motion.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>

namespace palpate::haptics {

constexpr double roundingOff = 1e-9;  // of positions [m]

void PositionWindow::add(Vec3 at) noexcept
{
    newest = (newest + 1) % longest;
    position[newest] = at;
    count = std::min(count + 1, longest);
}

std::size_t straightSince(const PositionWindow& w, double encoder, double period) noexcept
{
    const auto back = [&](std::size_t n) { return w.position[w.back(n)]; };
    const auto most = std::min(w.count, static_cast<std::size_t>(longestStraight / period + 1.5));
    std::size_t length = 0;
    for (std::size_t n = 1; n < most; ++n) {
        const Vec3 slope = (back(n) - back(0)) / static_cast<double>(n);
        bool straight = true;
        for (std::size_t i = 1; i < n && straight; ++i) {
            const Vec3 off = glm::abs(back(i) - back(0) - static_cast<double>(i) * slope);
            straight = std::max({off.x, off.y, off.z}) <= encoder + roundingOff;
        }
        if (!straight) {
            break;
        }
        length = n;
    }
    return length;
}

Vec3 betweenSteps(Vec3 read, double encoder, double period, EncoderState& state) noexcept
{
    const bool begins = state.read.count == 0;
    state.read.add(read);
    const std::size_t since = straightSince(state.read, encoder, period);
    const Vec3 way =
        since > 0 ? (read - state.read.position[state.read.back(since)]) / static_cast<double>(since) : Vec3(0.0);
    const Vec3 half(0.5 * encoder);
    state.position = glm::clamp(begins ? read : state.position + way, read - half, read + half);
    return state.position;
}

}  // namespace palpate::haptics
