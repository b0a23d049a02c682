#pragma once

#include <training/curriculum.h>
#include <training/store.h>

#include <optional>
#include <string>
#include <vector>

namespace palpate::training {

/// Where somebody stands in one exercise.
struct ExerciseProgress {
    const Exercise* exercise = nullptr;   // of the curriculum
    std::vector<StoredSession> sessions;  // in their order
    std::vector<bool> met;                // by session: all levels were
    std::vector<CusumPoint> chart;        // by session
    GateState gate;
    bool available = false;           // the gates before it are open
    std::optional<double> daysSince;  // the last session of it; nothing: never
    bool refresh = false;             // reached, and not practised for longer than the curriculum says
};

/// Where somebody stands in a curriculum.
struct CurriculumProgress {
    const Curriculum* curriculum = nullptr;
    std::vector<ExerciseProgress> exercises;  // as the curriculum has them

    /// What to do next: first what was reached and may be forgotten, then the first exercise whose gate is shut and that is
    /// available; null when all is reached.
    const ExerciseProgress* next() const noexcept;
    bool finished() const noexcept;
};

/// @param all  all sessions of a person, by start; those of other curricula are left out
/// @param now  UTC, as StoredSession::started: what "days since" counts to
/// @pre  `curriculum` outlives what is returned
CurriculumProgress progressOf(const Curriculum& curriculum, const std::vector<StoredSession>& all, const std::string& now);

/// Why this one is next, in words.
std::string reasonFor(const ExerciseProgress& next);

/// "2026-11-22T09:14:05Z" in days; nothing for anything else.
std::optional<double> daysOf(const std::string& utc);

}  // namespace palpate::training
