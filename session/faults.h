#pragma once

#include <haptics/device.h>

#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

namespace palpate::session {

enum class FaultKind {
    gap,          // the loop sleeps through ticks; the hand goes on under the force that was sent last
    late,         // the force of every tick is sent so much after its pose was read
    nan,          // a pose that is not finite
    jump,         // the pose jumps ahead along the tool, and comes back
    unplug,       // no fresh pose, and the hand feels no force
    stallViewer,  // the viewers that the session started are stopped (SIGSTOP), and go on at its end (SIGCONT)
    diskFull,     // the record cannot grow any more (RLIMIT_FSIZE): until the session ends
};

/// What goes wrong in a session on purpose, to see how it is borne.
struct Fault {
    FaultKind kind = FaultKind::gap;  // which
    double amount = 0;                // late: [s]; jump: [m]
    double length = 0;                // how long it lasts [s]
    double start = 0;                 // session time [s]
};

/// Faults from the form WHAT[=AMOUNT][/LENGTH]\@TIME, several separated by commas: "gap=50ms\@2s,late=5ms/500ms\@3s".
/// Throws std::runtime_error.
std::vector<Fault> parseFaults(const std::string& text);

using Faults = std::vector<Fault>;

/// Whether one of them is of this kind.
bool has(const Faults& faults, FaultKind kind) noexcept;

/// How long the loop is to sleep after this tick [s].
double gapAfter(const Faults& faults, std::uint64_t tick) noexcept;

/// A device whose poses and forces go wrong. What it says is what the record holds, so a replay needs no faults. The device
/// behind it lives in ticks, as those that are simulated or replayed do: through a gap and a delay it goes on.
class FaultyDevice final : public haptics::Device {
public:
    FaultyDevice(std::unique_ptr<haptics::Device> device, Faults faults);  // takes the device over

    haptics::DeviceSample read() noexcept override;
    void write(Vec3 force) noexcept override;
    void observe(const haptics::TickRecord& record) noexcept override { device_->observe(record); }
    bool finished() const noexcept override { return device_->finished(); }
    std::string problem() const override { return device_->problem(); }

private:
    const Fault* active(FaultKind kind) const noexcept;
    void advance(double seconds) noexcept;

    std::unique_ptr<haptics::Device> device_;
    Faults faults_;
    std::uint64_t tick_ = 0;  // of the last read(), from 1 up
    haptics::DeviceSample last_;
};

/// The faults that strike what is around the loop: viewers and disk. A thread of its own carries them out; the servo thread
/// only tells it the tick. All is set right again when it ends.
class FaultsAround {
public:
    /// @param faults  those of other kinds count for nothing
    /// @param record  the file that cannot grow
    /// @param stall   stops (true) or lets go on (false) the viewers; empty: there are none
    FaultsAround(Faults faults, std::filesystem::path record, std::function<void(bool)> stall);
    ~FaultsAround();

    void tell(std::uint64_t tick) noexcept { tick_.store(tick, std::memory_order_relaxed); }  // from the servo thread

private:
    void work(const Faults& faults, const std::filesystem::path& record);

    std::function<void(bool)> stall_;
    std::atomic<std::uint64_t> tick_{0};
    std::atomic<bool> over_{false};
    std::thread thread_;
};

}  // namespace palpate::session
