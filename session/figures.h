#pragma once

#include <haptics/losses.h>
#include <haptics/measures.h>
#include <haptics/score.h>
#include <haptics/timing.h>

#include <nlohmann/json_fwd.hpp>

#include <string>
#include <vector>

namespace palpate::session {

/// {p50, p99, p999, max} in microseconds.
nlohmann::json microseconds(const haptics::Percentiles& p);

/// Lateness, work and tasks of a servo loop as `train` and `bench tick` give them: lateness_us, tick_us, tasks_us{H2..H7}.
/// Null where a loop that kept no clock did not measure it.
nlohmann::json timingFigures(const haptics::ServoTiming& timing);

/// Cores as `train` gives them: core[]{fraction{tissue:..}, target_fraction, length_in_lesion_mm, fragments, volume_mm3}.
/// @param cores    in their order
/// @param tissues  names of the tissue table's rows
nlohmann::json coreFigures(const std::vector<haptics::CoreSample>& cores, const std::vector<std::string>& tissues);

/// 16 hexadecimal digits.
std::string hexadecimal(std::uint64_t hash);

/// Peak resident memory of this process [MB].
double peakMemoryMb();

/// A score in --json, the same of a live session and of a record: every measure by its key, and points{core, vital,
/// technique}; where its points went in losses[]{measure, points, words, at_s}, the largest first.
nlohmann::json scoreFigures(const haptics::Score& score, const std::vector<haptics::Loss>& losses);

}  // namespace palpate::session
