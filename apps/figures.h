#pragma once

#include <haptics/score.h>
#include <haptics/timing.h>

#include <nlohmann/json_fwd.hpp>

#include <string>

namespace palpate::apps {

/// {p50, p99, p999, max} in microseconds.
nlohmann::json microseconds(const haptics::Percentiles& p);

/// Lateness, work and tasks of a servo loop as `train` and `bench tick` give them: lateness_us, tick_us, tasks_us{H2..H7}.
nlohmann::json timingFigures(const haptics::ServoTiming& timing);

/// 16 hexadecimal digits.
std::string hexadecimal(std::uint64_t hash);

/// Peak resident memory of this process [MB].
double peakMemoryMb();

}  // namespace palpate::apps
