#pragma once

#include <channel/layout.h>
#include <channel/mapping_guard.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace palpate::channel {

/// The simulation's end. Creates the segment (mode 0600) and removes it on destruction.
/// setState() and the displaced nodes are wait-free: no lock, no allocation, no system call. One writer thread.
class Publisher {
public:
    /// `session`: letters, digits, '-' and '_'. Throws std::runtime_error when the segment cannot be made; takes over a
    /// segment whose owner is dead. `labels`: one tissue row per node of scenery.labels,
    /// `image`: one code for each as well, or none where scenery has no windows. `fine`: one row per node of scenery.fine.
    Publisher(const std::string& session, const Scenery& scenery, std::span<const std::uint8_t> labels,
              std::span<const std::uint16_t> image = {}, std::span<const std::uint8_t> fine = {});
    Publisher(Publisher&&) noexcept;
    ~Publisher();

    /// Fills in `published` where it is 0.
    void setState(const State& state) noexcept;
    /// The buffer to fill before publishDisplaced(); never the one that a viewer reads.
    Displaced& backBuffer() noexcept;
    void publishDisplaced() noexcept;
    /// What the viewer that is the hand has written last; nothing when none has, or its last write was never finished.
    /// Wait-free, and for the writer thread too.
    std::optional<Input> input() const noexcept;
    /// Whether somebody has cut off the segment's file: no viewer sees what is published from then on. Wait-free.
    bool torn() const noexcept;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// How a session is over. `none`: it goes on. `torn`: its segment was cut off by another program.
enum class Ending : std::uint8_t { none, finished, killed, torn };

/// A viewer's end. Any number of viewers may read; none can disturb the simulation: the memory is mapped read-only.
class Subscriber {
public:
    /// Attaches, or returns nothing when there is no such session (yet). Throws std::runtime_error when there is one of
    /// another version or layout, or whose scenery is none.
    static std::optional<Subscriber> attach(const std::string& session);
    Subscriber(Subscriber&&) noexcept;
    Subscriber& operator=(Subscriber&&) noexcept;
    ~Subscriber();

    const Scenery& scenery() const noexcept;
    std::span<const std::uint8_t> labels() const noexcept;
    /// Empty where there is no image.
    std::span<const std::uint16_t> image() const noexcept;
    /// Empty where there are none.
    std::span<const std::uint8_t> fine() const noexcept;
    /// A consistent copy of the last tick; nothing when the writer died in the middle of a write, and for a state that is
    /// none: numbers that are not, places beyond 100 m, rows that there are not.
    std::optional<State> state() const noexcept;
    /// Copies the last displaced nodes if they are newer than `out.publication`. When it returns false `out.nodes` may hold
    /// part of a copy that the writer has overtaken, or that was refused for a node that the lattice does not have.
    bool displaced(Displaced& out) const noexcept;
    /// False when the simulation has ended, was killed, or its segment was replaced.
    bool alive() const noexcept { return ending() == Ending::none; }
    Ending ending() const noexcept;
    /// What the viewer that is the hand asks for, so that others can show it.
    std::optional<Input> input() const noexcept;
    /// Process of the simulation.
    std::uint64_t ownerPid() const noexcept;

private:
    friend class ViewersHand;
    Subscriber();
    /// The page of the input; empty when the segment's name is another one's by now.
    Mapping inputToWrite() const;
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// The viewer whose mouse is the hand of a session; there is one at a time. It can write what is asked of the simulation,
/// and nothing else of the segment. Gives the hand back on destruction.
class ViewersHand {
public:
    /// Nothing when the session is over or has a hand of its own, or another viewer that lives is its hand.
    static std::optional<ViewersHand> take(const Subscriber& session);
    ViewersHand(ViewersHand&&) noexcept = default;
    ViewersHand& operator=(ViewersHand other) noexcept
    {
        std::swap(page_, other.page_);
        return *this;
    }
    ~ViewersHand();

    /// Wait-free. Fills in `beat`: to be called often, also when nothing has changed.
    void set(Input input) noexcept;

private:
    ViewersHand() = default;
    Mapping page_;
};

/// Sessions that can be attached to now, in order.
std::vector<std::string> sessions();

}  // namespace palpate::channel
