#include <render/tip_way.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <iterator>
#include <utility>

namespace palpate::render {

void TipWay::add(const channel::State& state)
{
    constexpr double fine = 0.3e-3;  // [m]
    constexpr std::size_t most = 2000;
    const bool wasIn = std::exchange(isIn_, state.phase == channel::Phase::inserted);
    const glm::dvec3 tip = vec(state.tip);
    if (isIn_ && !wasIn) {
        start_ = places_.size();
        step_ = fine;
    } else if (!isIn_ || glm::distance(places_.back().tip, tip) < step_) {
        return;
    }
    places_.push_back({state.time, tip, !wasIn});
    if (places_.size() - start_ <= most) {
        return;
    }
    step_ *= 2;
    std::size_t kept = start_;
    for (std::size_t i = start_; i < places_.size(); i += 2)
        places_[kept++] = places_[i];
    places_.resize(kept);
}

std::vector<glm::dvec3> TipWay::until(double time) const
{
    const auto end = std::ranges::upper_bound(places_, time, {}, &Place::time);
    auto begin = end;
    while (begin != places_.begin() && !std::prev(begin)->isFirst)
        --begin;
    begin -= begin != places_.begin() ? 1 : 0;
    std::vector<glm::dvec3> way;
    std::ranges::transform(begin, end, std::back_inserter(way), &Place::tip);
    return way;
}

}  // namespace palpate::render
