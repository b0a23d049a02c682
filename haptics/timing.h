#pragma once

#include <haptics/tick.h>

#include <array>
#include <cstdint>
#include <memory>

namespace palpate::haptics {

/// Percentiles of a time [s].
struct Percentiles {
    double p50 = 0, p99 = 0, p999 = 0, max = 0;
};

/// How often which duration was seen: bins 1 % apart from 10 ns to 10 s. add() allocates nothing.
class Histogram {
public:
    Histogram();
    Histogram(Histogram&&) noexcept;
    Histogram& operator=(Histogram&&) noexcept;
    ~Histogram();

    void add(double seconds) noexcept;
    Percentiles percentiles() const;
    /// The duration that `share` of all do not pass, to 1 % [s].
    double quantile(double share) const noexcept;
    std::uint64_t count() const noexcept;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// How the servo loop kept time.
struct ServoTiming {
    Histogram lateness;  // start of a tick after its due time
    Histogram work;      // a tick, H2 to H5
    std::array<Histogram, taskCount> tasks;
    std::uint64_t ticks = 0;
    std::uint64_t missed = 0;      // force sent after the next tick was due, and ticks skipped to catch up
    std::uint64_t overruns = 0;    // ticks whose own work took over a period
    std::uint64_t gaps = 0;        // runs of missed ticks, one after the other without one in time between
    std::uint64_t longestGap = 0;  // [ticks]
};

}  // namespace palpate::haptics
