#pragma once

#include <haptics/measures.h>
#include <haptics/score.h>
#include <haptics/timing.h>

#include <nlohmann/json_fwd.hpp>

#include <string>

namespace palpate::session {

/// {p50, p99, p999, max} in microseconds.
nlohmann::json microseconds(const haptics::Percentiles& p);

/// Lateness, work and tasks of a servo loop as `train` and `bench tick` give them: lateness_us, tick_us, tasks_us{H2..H7}.
nlohmann::json timingFigures(const haptics::ServoTiming& timing);

/// 16 hexadecimal digits.
std::string hexadecimal(std::uint64_t hash);

/// Peak resident memory of this process [MB].
double peakMemoryMb();

/// A score in --json, the same of a live session and of a record: every measure by its key, and points{core, vital,
/// technique}.
nlohmann::json scoreFigures(const haptics::Score& score);

}  // namespace palpate::session
