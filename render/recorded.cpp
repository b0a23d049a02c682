#include <render/recorded.h>

#include <algorithm>
#include <iterator>
#include <utility>

namespace palpate::render {
namespace {

constexpr double rounding = 1e-9;  // of a time [s]

}  // namespace

void Recorded::add(const Event& event)
{
    const std::lock_guard lock(guard_);
    events_.push_back(event);
}

void Recorded::addTaken(const channel::State& state, std::span<const channel::Displacement> shape)
{
    auto taken = std::make_shared<const Taken>(Taken{state, {shape.begin(), shape.end()}});
    const std::lock_guard lock(guard_);
    taken_.push_back(std::move(taken));
}

void Recorded::addTick(const channel::State& state)
{
    const std::lock_guard lock(guard_);
    way_.add(state);
    addTo(moments_, state);
}

std::vector<glm::dvec3> Recorded::wayUntil(double time) const
{
    const std::lock_guard lock(guard_);
    return way_.until(time + rounding);
}

std::deque<History::Moment> Recorded::momentsUntil(double time) const
{
    const std::lock_guard lock(guard_);
    const auto from = std::ranges::lower_bound(moments_, time - traceSeconds, {}, &History::Moment::time);
    return {from, std::ranges::upper_bound(moments_, time + rounding, {}, &History::Moment::time)};
}

std::deque<Event> Recorded::eventsUntil(double time) const
{
    constexpr std::ptrdiff_t most = 64;
    const std::lock_guard lock(guard_);
    const auto end = std::ranges::upper_bound(events_, time + rounding, {}, &Event::time);
    return {end - std::min(most, end - events_.begin()), end};
}

std::shared_ptr<const Recorded::Taken> Recorded::takenAt(std::uint64_t tick) const
{
    const std::lock_guard lock(guard_);
    const auto after = std::ranges::upper_bound(taken_, tick, {}, [](const auto& taken) { return taken->state.tick; });
    return after == taken_.begin() ? nullptr : *std::prev(after);
}

}  // namespace palpate::render
