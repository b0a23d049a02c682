#pragma once

#include <channel/layout.h>
#include <render/events.h>

#include <array>
#include <deque>
#include <functional>
#include <vector>

namespace palpate::render {

/// What a session has looked like lately, as far as the viewer has seen it.
struct History {
    /// 20 ms, of which the largest forces and the smallest distances count.
    struct Moment {
        double time = 0;                                       // of the session, where it begins [s]
        double basic = 0, additional = 0, total = 0;           // [N]
        std::array<float, channel::maxStructures> distance{};  // [m]
    };
    std::deque<Moment> moments;  // of the last traceSeconds
    std::deque<Event> events;    // the last ones, oldest first

    struct Point {
        double time = 0;  // [s]
        double value = 0;
    };

    /// A value of the moments over time, at most one for each of `perSecond` columns: the largest there, or the least.
    std::vector<Point> columns(double perSecond, const std::function<double(const Moment&)>& valueOf, bool least) const;
    /// Takes a state in; what is later than it is forgotten, as after a jump in a record.
    void add(const channel::State& state);

private:
    channel::State last_;
    bool any_ = false;
};

inline constexpr double traceSeconds = 10;

/// Takes a state into the last of `moments`, or begins a new one.
void addTo(std::deque<History::Moment>& moments, const channel::State& state);

}  // namespace palpate::render
