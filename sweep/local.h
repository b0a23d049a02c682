#pragma once

#include <sweep/folder.h>
#include <sweep/pool.h>

#include <functional>
#include <string>
#include <vector>

namespace palpate::sweep {

/// Runs cases in `jobs` processes of this machine, one case in each at a time, each in one thread, and writes their rows.
/// See PoolWork for `told` and `abandoned`. Throws std::runtime_error when a row cannot be written.
PoolResult runLocally(SweepFolder& folder, const std::vector<std::size_t>& cases, int jobs, const std::string& build,
                      const std::function<bool(std::size_t done, std::size_t running)>& told,
                      const std::function<bool()>& abandoned);

}  // namespace palpate::sweep
