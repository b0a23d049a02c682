#pragma once

#include <channel/layout.h>
#include <render/events.h>
#include <render/history.h>
#include <render/tip_way.h>

#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

namespace palpate::render {

/// What a viewer that looks at single moments of a record would miss or date wrongly: every event, the moments at which
/// pictures were taken (key P), the way of the tip, forces and distances. Comes to be known as the record is computed. For
/// any thread.
class Recorded {
public:
    /// The state and the shape of the tick at which a picture was taken.
    struct Taken {
        channel::State state;
        std::vector<channel::Displacement> shape;
    };

    /// Not earlier than those before.
    void add(const Event& event);
    void addTaken(const channel::State& state, std::span<const channel::Displacement> shape);
    void addTick(const channel::State& state);

    /// The last ones up to `time` [s], oldest first.
    std::deque<Event> eventsUntil(double time) const;
    /// The last one up to this tick; null: there is none.
    std::shared_ptr<const Taken> takenAt(std::uint64_t tick) const;
    /// Of the tip in tissue, see TipWay.
    std::vector<glm::dvec3> wayUntil(double time) const;
    /// Forces and distances of the last traceSeconds up to `time` [s].
    std::deque<History::Moment> momentsUntil(double time) const;

private:
    mutable std::mutex guard_;
    std::vector<Event> events_;
    std::vector<std::shared_ptr<const Taken>> taken_;
    std::deque<History::Moment> moments_;
    TipWay way_;
};

}  // namespace palpate::render
