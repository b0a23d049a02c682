#pragma once

#include <training/progress.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

namespace palpate::training {

/// How somebody who does not exist learns: the chance that session n of an exercise (from 1 up) meets its levels is
///
///     final - (final - first) exp(-(n - 1) / tau)
///
/// the exponential law of practice (A. Heathcote, S. Brown and D. J. K. Mewhort, "The power law repealed", Psychonomic
/// Bulletin & Review 7, 2000). The figures of the three are assumed: they exercise gates and charts and say nothing about
/// people.
struct LearningLaw {
    std::string name;
    double first = 0, final = 1;  // chances
    double tau = 5;               // sessions

    double chance(int n) const noexcept { return final - (final - first) * std::exp(-(n - 1) / tau); }
};

/// novice, resident, expert.
const std::vector<LearningLaw>& learningLaws();

/// A course through a curriculum, session after session as CurriculumProgress::next() says, one a day.
struct SimulatedCourse {
    std::vector<StoredSession> sessions;
    std::vector<bool> met;  // by session, as it was drawn: what the gates have to find again
    bool finished = false;  // all gates open
};

/// @param most  sessions, at most
/// Measures are drawn so that a session meets all levels of its exercise or misses one of them. Same seed, same course.
SimulatedCourse simulate(const Curriculum& curriculum, const LearningLaw& law, std::uint64_t seed, int most);

}  // namespace palpate::training
