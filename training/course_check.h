#pragma once

#include <training/simulate.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace palpate::training {

/// Mean number of signals of a chart in the sessions of one exercise, from the first until its gate opens, of somebody who
/// learns by `law`. From the Markov chain over the sessions that the gate looks at and all values that the chart can take,
/// so without an approximation; what has a chance below 1e-12 is left out.
/// @param most  sessions, at most
double expectedSignals(const CusumPlan& plan, const Gate& gate, const LearningLaw& law, CusumChart chart, int most);

/// Signals of one chart, of all people of one skill, until the gates opened.
struct SignalCount {
    std::string skill;
    CusumChart chart = CusumChart::alarm;
    std::size_t counted = 0;
    double expected = 0;
};

/// What became of simulated people who went through a curriculum.
struct CourseCheck {
    std::size_t sessions = 0, finished = 0;
    std::vector<std::string> gateFaults;  // gates that did not open when they should have
    std::vector<SignalCount> signals;     // by skill: alarms, then "has learnt it"
};

/// Sends `people` of each of learningLaws() through a curriculum. When a gate should open is counted anew from what was
/// drawn. Throws std::runtime_error for a gate that looks at over 12 sessions.
/// @param most  sessions of each person, at most
CourseCheck checkCourses(const Curriculum& curriculum, int people, std::uint64_t seed, int most);

/// What became of a file of profiles whose writers were killed.
struct KillCheck {
    int kills = 0;
    std::size_t sessions = 0;         // that were stored in the end
    std::vector<std::string> faults;  // what was lost, halved or damaged; a line each
};

/// Stores the sessions of simulated courses, one person of each skill, in `folder`. The process that stores them is killed
/// (SIGKILL) `kills` times at random moments and another goes on; after each kill the file has to be whole and to have what
/// was said to be stored, at most one session more, with all its measures and in order. Forks: to be called while this
/// process has one thread. Throws std::runtime_error where no process can be started.
KillCheck checkKills(const Curriculum& curriculum, const std::filesystem::path& folder, int kills, std::uint64_t seed);

}  // namespace palpate::training
