#pragma once

#include <haptics/session_model.h>
#include <haptics/simulation.h>
#include <haptics/timing.h>
#include <render/channel/channel.h>

#include <string>

namespace palpate::haptics {

/// Shows a session to viewers: scenery once, the state in every tick, displaced nodes at frame rate (task H9).
class Broadcast {
public:
    /// Throws std::runtime_error when the session's segment cannot be made.
    Broadcast(const std::string& session, const SessionModel& model);

    /// Wait-free; allocates nothing.
    void publish(const TickRecord& record, const ServoTiming& timing, const Simulation& simulation) noexcept;
    /// The last state again, marked finished.
    void finish() noexcept;

private:
    void publishDisplaced(const Simulation& simulation) noexcept;

    channel::Publisher publisher_;
    channel::State state_;
};

}  // namespace palpate::haptics
