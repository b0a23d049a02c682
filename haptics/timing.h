#pragma once

#include <haptics/tick.h>

#include <array>
#include <cstdint>
#include <memory>

namespace palpate::haptics {

/// Percentiles of a time [s].
struct Percentiles {
    double p50 = 0;   // half are at most so long
    double p99 = 0;   // 99 of 100
    double p999 = 0;  // 999 of 1000
    double max = 0;   // the longest
};

/// How often which duration was seen: bins 1 % apart from 10 ns to 10 s. add() allocates nothing.
class Histogram {
public:
    Histogram();
    Histogram(Histogram&&) noexcept;             // leaves the other without bins: only to be destroyed
    Histogram& operator=(Histogram&&) noexcept;  // as above
    ~Histogram();

    void add(double seconds) noexcept;  // counts one duration [s]
    Percentiles percentiles() const;    // of all that was counted [s]
    /// The duration that `fraction` of all do not pass, to 1 % [s].
    double quantile(double fraction) const noexcept;
    std::uint64_t count() const noexcept;  // how many durations

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// How the servo loop kept time.
struct ServoTiming {
    bool paced = false;                      // against the clock; else lateness, missed ticks and gaps are not measured
    Histogram lateness;                      // start of a tick after its due time
    Histogram work;                          // a tick, H2 to H5
    std::array<Histogram, taskCount> tasks;  // by haptics::Task
    std::uint64_t ticks = 0;                 // so far
    std::uint64_t missed = 0;                // force sent after the next tick was due, and ticks skipped to catch up
    std::uint64_t overruns = 0;              // ticks whose own work took over a period
    std::uint64_t gaps = 0;                  // runs of missed ticks, one after the other without one in time between
    std::uint64_t longestGap = 0;            // [ticks]
    std::uint64_t pauses = 0;                // how often the session was made to stand still
    double paused = 0;                       // for how long in all, in no tick [s]
};

}  // namespace palpate::haptics
