#pragma once

#include <tests/apps/program.h>

#include <string>
#include <vector>

namespace palpate::apps {

/// A plan of 3 x 4 x `repeats` presses, each some milliseconds, and `more` lines at its beginning.
std::string shortPlan(int repeats, const std::string& more = "");

/// Rows of a CSV file without quotes, the names first.
std::vector<std::vector<std::string>> csvRows(const std::filesystem::path& file);

/// table.csv of a sweep without the columns that differ from run to run: machine, tick_us, case_s.
std::string sameOnEveryRun(const std::filesystem::path& folder);

/// Processes that `pid` has started.
std::vector<int> childrenOf(int pid);

/// How many cases of a sweep have their file.
std::size_t casesIn(const std::filesystem::path& folder);

}  // namespace palpate::apps
