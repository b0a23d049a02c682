#pragma once

#include <report/groups.h>
#include <training/progress.h>

#include <filesystem>
#include <vector>

namespace palpate::training {

/// All that is known of somebody's progress.
struct PersonProgress {
    Person person;
    std::vector<StoredSession> sessions;        // all, by start
    std::vector<CurriculumProgress> curricula;  // those that have sessions of this person
};

/// People whose sessions are compared with others'.
struct PeopleGroup {
    std::string name;
    std::vector<PersonProgress> people;  // with those of their sessions that are compared
};

/// Writes a page: for each person where they stand, what is next and why, learning curves by measure, the CUSUM chart with
/// its assumptions; then the groups compared. Needs no other file. Throws std::runtime_error.
/// @param groups  may be empty
void writeProgressPage(const std::filesystem::path& html, const std::vector<PersonProgress>& people,
                       const std::vector<report::ScoredGroup>& groups);

/// Writes one line per session: who, when, what for, whether its levels were met, all measures; where there are groups,
/// first the group, which is empty for those of `people`. Throws std::runtime_error.
void writeProgressCsv(const std::filesystem::path& file, const std::vector<PersonProgress>& people,
                      const std::vector<PeopleGroup>& groups = {});

/// Writes xAPI statements (version 1.0.3), an array in one JSON file: "passed", "failed" or "completed" for each session,
/// with the total as score and the measures as extensions. A session has the same statement id whenever it is written, and
/// one statement, also where a person and groups have it. Throws std::runtime_error.
void writeXapi(const std::filesystem::path& file, const std::vector<PersonProgress>& people,
               const std::vector<PeopleGroup>& groups = {});

/// A session's measures in the order of haptics::measures(), as groups compare them. What is missing is not a
/// number.
std::vector<double> rowOf(const StoredSession& session);

}  // namespace palpate::training
