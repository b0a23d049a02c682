#pragma once

#include <sweep/folder.h>

#include <cstddef>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace palpate::sweep {

/// What a pool of processes works on.
struct PoolWork {
    /// Called once in each process; gives what the process does with an item. Whatever throws there ends the pool.
    std::function<std::function<void(std::size_t item)>()> start;
    /// A process died while it worked on the item. Called in this process.
    std::function<void(std::size_t item, const std::string& why)> lost;
    /// Called ten times a second in this process; false: no more items are begun.
    std::function<bool(std::size_t done, std::size_t running)> told;
    /// Whether to abandon what is running too.
    std::function<bool()> abandoned;
    /// Of an item, by the clock, after which its process is killed and the item lost, whatever the process does [s].
    double limit = std::numeric_limits<double>::infinity();
};

struct PoolResult {
    std::size_t done = 0;
    double seconds = 0;     // by the clock
    double cpuSeconds = 0;  // of all processes
};

/// Works on items 0 .. count - 1 in `jobs` processes forked from this one, which therefore has one thread. An item whose
/// process was killed from outside (SIGKILL, SIGTERM) is tried once more. When this process dies, so do they. Throws
/// std::runtime_error with the words of the process that failed.
PoolResult runPool(std::size_t count, int jobs, const PoolWork& work);

/// Runs cases in `jobs` processes of this machine, one case in each at a time, each in one thread, and writes their rows.
/// See PoolWork for `told` and `abandoned`. Throws std::runtime_error when a row cannot be written.
PoolResult runLocally(SweepFolder& folder, const std::vector<std::size_t>& cases, int jobs, const std::string& build,
                      const std::function<bool(std::size_t done, std::size_t running)>& told,
                      const std::function<bool()>& abandoned);

}  // namespace palpate::sweep
