#include <render/ghost.h>

#include <algorithm>
#include <iterator>

namespace palpate::render {

const GhostPose& at(const Ghost& ghost, double time) noexcept
{
    const auto next =
        std::upper_bound(ghost.begin(), ghost.end(), time, [](double t, const GhostPose& pose) { return t < pose.time; });
    return next == ghost.begin() ? ghost.front() : *std::prev(next);
}

}  // namespace palpate::render
