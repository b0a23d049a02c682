#pragma once

#include <haptics/device.h>
#include <haptics/simulation.h>
#include <haptics/timing.h>

#include <atomic>
#include <functional>
#include <string>
#include <vector>

namespace palpate::haptics {

/// A paced session that stands still when it is asked to. The force fades first, as when the device falls silent;
/// then no tick is computed or recorded, so that measures and record know nothing of the time. It goes on where it was,
/// once the tool is back within `backAgain` of there, with no force at first.
struct PauseHooks {
    std::function<bool()> asked;  // whether it is to stand still: once a period; empty: never
    /// Once a period while it stands; `elsewhere`: it is to go on, and the tool is not back yet.
    std::function<void(bool elsewhere)> standing;

    static constexpr double backAgain = 2e-3;  // [m]
    static constexpr int fadeTicks = 100;      // of fading, before it stands
};

/// How a loop keeps time and when it ends.
struct ServoOptions {
    bool paced = true;   // one tick per period of the simulation; false: as fast as it goes, for batches
    double seconds = 0;  // end after this much session time; 0 = when the device has finished
    /// Paced: asks for a cheaper model when more than this many of the last thousand ticks were late; 0 = never. A gap, in
    /// which the computer did something else, is one late tick, however long it was.
    std::uint64_t lateAllowed = 100;
    PauseHooks pause = {};  // paced: must allocate nothing, lock nothing and not block
};

/// Called after every tick, in the servo thread: must not allocate, lock or block.
using TickSink = std::function<void(const TickRecord&, const ServoTiming&)>;

/// The loop, at 1 kHz unless the simulation has another period: H2, the simulation's tasks, H5, then `sink`. Runs in the
/// calling thread until the device has finished, the time is over or `stop` is set. Sleeps until 50 us before a tick is due
/// and spins the rest. After a gap it goes on from where it is: the ticks in between are counted as missed, never made up
/// in a burst, and for as many ticks the samples are marked stale, so that the stabiliser's watchdog fades the force.
ServoTiming runServo(Device& device, Simulation& simulation, const ServoOptions& options, const TickSink& sink,
                     const std::atomic<bool>& stop);

/// Gives the calling thread SCHED_FIFO priority and locks the process's memory, where permitted. The memory is locked until
/// the last claim ends, and stays so where the process itself had locked some before the first; the priority ends with the
/// thread.
class RealTimeClaim {
public:
    RealTimeClaim();
    ~RealTimeClaim();
    RealTimeClaim& operator=(RealTimeClaim&&) = delete;

    /// A sentence for the user for each that is not permitted.
    const std::vector<std::string>& warnings() const noexcept { return warnings_; }

private:
    bool locked_ = false;
    std::vector<std::string> warnings_;
};

}  // namespace palpate::haptics
