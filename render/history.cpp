#include <render/history.h>

#include <render/deformation.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::render {

namespace {

constexpr double momentLength = 0.02;  // [s]

}  // namespace

void addTo(std::deque<History::Moment>& moments, const channel::State& state)
{
    History::Moment moment{
        state.time, glm::length(vec(state.basic)), glm::length(vec(state.additional)), glm::length(vec(state.total)), {}};
    for (std::size_t s = 0; s < moment.distance.size(); ++s)
        moment.distance[s] = static_cast<float>(state.distance[s]);
    const double begun = moments.empty() ? moment.time + 1 : moments.back().time;
    if (moment.time < begun || moment.time - begun >= momentLength) {
        moments.push_back(moment);
        return;
    }
    History::Moment& last = moments.back();
    last.basic = std::max(last.basic, moment.basic);
    last.additional = std::max(last.additional, moment.additional);
    last.total = std::max(last.total, moment.total);
    for (std::size_t s = 0; s < moment.distance.size(); ++s)
        last.distance[s] = std::min(last.distance[s], moment.distance[s]);
}

void History::add(const channel::State& state)
{
    if (any_ && state.tick == last_.tick)
        return;
    if (any_ && state.time < last_.time) {
        // Also the one that may hold something later.
        while (!moments.empty() && moments.back().time + momentLength > state.time)
            moments.pop_back();
        while (!events.empty() && events.back().time > state.time)
            events.pop_back();
    } else if (any_) {
        constexpr std::size_t most = 64;
        for (const Event& event : eventsBetween(last_, state))
            events.push_back(event);
        while (events.size() > most)
            events.pop_front();
    }
    addTo(moments, state);
    while (moments.front().time < state.time - traceSeconds)
        moments.pop_front();
    last_ = state;
    any_ = true;
}

// Columns begin at multiples of their width in the session's time: they do not change as time goes on.
std::vector<History::Point> History::columns(double perSecond, const std::function<double(const Moment&)>& valueOf,
                                             bool least) const
{
    std::vector<Point> points;
    double column = -1;
    for (const Moment& moment : moments) {
        const double value = valueOf(moment), at = std::floor(moment.time * perSecond);
        if (!std::isfinite(value))
            continue;
        if (at != column)
            points.push_back({moment.time, value});
        else if (least ? value < points.back().value : value > points.back().value)
            points.back() = {moment.time, value};
        column = at;
    }
    return points;
}

}  // namespace palpate::render
