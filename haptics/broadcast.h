#pragma once

#include <channel/channel.h>
#include <haptics/session_model.h>
#include <haptics/simulation.h>
#include <haptics/timing.h>

#include <optional>
#include <string>

namespace palpate::haptics {

/// The segment of a session, with its scenery. Throws std::runtime_error when it cannot be made.
/// @param viewersHand  who holds the tool, see channel::handIsViewers
/// @param who          a name or a pseudonym, of which viewers see the first 31 bytes, with an ellipsis; empty: not known
channel::Publisher publisherOf(const std::string& session, const SessionModel& model,
                               std::uint32_t viewersHand = channel::handElsewhere, const std::string& who = {});
/// The same with the body's tissues, and the image if it has one, sampled on `display`.
channel::Publisher publisherOf(const std::string& session, const SessionModel& model, std::uint32_t viewersHand,
                               const volume::NodeGrid& display, const std::string& who = {});

/// What viewers see of a tick, on top of what they have seen of those before it. Allocates nothing.
/// @param period  of the session's ticks [s]
void showTick(const TickRecord& record, const ServoTiming& timing, channel::State& state,
              double period = tickSeconds) noexcept;

/// The displaced nodes after the last tick. Allocates nothing.
void showShape(const Simulation& simulation, channel::Displaced& out) noexcept;

/// Shows a session to viewers: scenery once, the state in every tick, displaced nodes at frame rate (task H9).
class Broadcast {
public:
    /// As publisherOf().
    Broadcast(const std::string& session, const SessionModel& model, std::uint32_t viewersHand = channel::handElsewhere,
              const std::string& who = {});

    /// Wait-free; allocates nothing.
    void publish(const TickRecord& record, const ServoTiming& timing, const Simulation& simulation) noexcept;
    /// What the viewer that is the hand asks for; see channel::Publisher. A viewer that was stopped in the middle of its
    /// writing has said nothing new: what it asked for before holds. Called by one thread at a time.
    /// @returns  the last that was whole; none: there was none yet
    std::optional<channel::Input> input() const noexcept
    {
        if (const auto now = publisher_.input()) {
            heard_ = now;
        }
        return heard_;
    }
    /// Whether another program has cut off the segment: nobody sees the session any more. Wait-free.
    bool torn() const noexcept { return publisher_.torn(); }
    /// The last state again, while the session stands still. Wait-free; allocates nothing.
    void stand(channel::Standing how) noexcept;
    /// The last state again, marked finished.
    void finish() noexcept;

private:
    channel::Publisher publisher_;
    channel::State state_;
    mutable std::optional<channel::Input> heard_;
};

}  // namespace palpate::haptics
