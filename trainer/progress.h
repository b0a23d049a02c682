#pragma once

#include <nlohmann/json_fwd.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace palpate::trainer {

/// A measure by session; NaN where a session has no value of it.
struct Curve {
    std::string label, unit;
    std::vector<double> values;
    std::optional<double> atLeast, atMost;  // the exercise's level
};

/// Where somebody stands in an exercise of a curriculum.
struct ExerciseEntry {
    enum class Standing : std::uint8_t { locked, open, next, reached, refresh };

    std::string curriculum, curriculumTitle, id, title, caseId;
    Standing standing = Standing::locked;
    bool next = false;  // to be trained next
    bool test = false;  // its gate counts tests only
    int sessions = 0, recentMet = 0, recentTried = 0, pass = 1, of = 1;
    std::optional<double> daysSince;  // the last session; nothing: never
    std::vector<Curve> curves;        // of its levels; then the total
    Curve alarm, learning;            // both CUSUM charts; their limits are atMost
    double p0 = 0, p1 = 0;            // failure rates that the charts tell apart
};

/// A session that a profile keeps.
struct KeptSession {
    std::string name;
    std::int64_t number = 0;
    std::string started;        // UTC, "2026-11-22T09:14:05Z"
    std::string caseId, scene;  // caseId empty: none
    bool test = false;
    std::string record;  // file; empty: none was kept
    std::string note;    // of an instructor
    int rating = 0;      // 1 to 5; 0: none
    std::optional<double> total;
};

struct Progress {
    std::vector<ExerciseEntry> exercises;  // by curriculum, in its order
    std::vector<KeptSession> sessions;     // by start

    /// What to train next; nothing when all is reached.
    std::optional<std::size_t> next() const noexcept;
    /// Points of the best session of a case.
    std::optional<double> best(const std::string& caseId) const noexcept;
};

/// What `palpate progress --json` gives. What is not as it should be is left out.
Progress progressIn(const nlohmann::json& figures);

/// "locked", "open", "next", "reached", "to be refreshed", in the user's language.
const char* inWords(ExerciseEntry::Standing standing) noexcept;
/// What its levels ask for, "Passes: at most 2", one line each.
std::vector<std::string> levelsInWords(const ExerciseEntry& exercise);
/// Why it is next, or what its gate asks for.
std::string reasonFor(const ExerciseEntry& exercise);

}  // namespace palpate::trainer
