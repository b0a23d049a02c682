#include <training/simulate.h>

#include <base/utc.h>

#include <algorithm>
#include <ctime>
#include <map>
#include <random>

namespace palpate::training {

namespace {

constexpr std::time_t firstDay = 1767225600;  // 2026-01-01
constexpr std::time_t day = 86400;

double draw(std::mt19937_64& random)
{
    return static_cast<double>(random() >> 11) * 0x1p-53;
}

// A value that meets the level, or one that misses it, between nothing and as much again beyond its limit.
double valueFor(const Level& level, bool meet, std::mt19937_64& random)
{
    const double fraction = 0.05 + 0.9 * draw(random);
    if (level.atLeast && level.atMost) {
        const double width = std::max(*level.atMost - *level.atLeast, 1.0);
        return meet ? *level.atLeast + fraction * (*level.atMost - *level.atLeast) : *level.atMost + fraction * width;
    }
    const double limit = level.atLeast ? *level.atLeast : *level.atMost;
    const double size = std::max(std::abs(limit), 1.0);
    return limit + (meet == level.atLeast.has_value() ? fraction : -fraction) * size;
}

Values valuesFor(const Gate& gate, bool meet, std::mt19937_64& random)
{
    const std::size_t missed = meet ? gate.levels.size() : random() % gate.levels.size();
    Values values;
    for (std::size_t i = 0; i < gate.levels.size(); ++i) {
        values[gate.levels[i].measure] = valueFor(gate.levels[i], i != missed, random);
    }
    return values;
}

}  // namespace

const std::vector<LearningLaw>& learningLaws()
{
    static const std::vector<LearningLaw> laws{
        {"novice", 0.10, 0.85, 8}, {"resident", 0.35, 0.92, 5}, {"expert", 0.80, 0.97, 3}};
    return laws;
}

SimulatedCourse simulate(const Curriculum& curriculum, const LearningLaw& law, std::uint64_t seed, int most)
{
    std::mt19937_64 random(seed);
    std::map<std::string, int> tried;
    SimulatedCourse course;
    for (int n = 0; n < most; ++n) {
        const std::string now = base::utc(firstDay + n * day);
        const CurriculumProgress progress = progressOf(curriculum, course.sessions, now);
        const ExerciseProgress* const next = progress.next();
        if (next == nullptr) {
            break;
        }
        const Exercise& exercise = *next->exercise;
        const int trial = ++tried[exercise.id];
        const bool meet = draw(random) < law.chance(trial);
        StoredSession s;
        s.id = n + 1;
        s.started = now;
        s.caseId = exercise.caseId;
        s.curriculum = curriculum.id;
        s.exercise = exercise.id;
        s.test = exercise.gate.testOnly;
        s.guidance = guidanceOf(exercise, trial, s.test);
        s.device = "simulated " + law.name;
        s.values = valuesFor(exercise.gate, meet, random);
        course.sessions.push_back(std::move(s));
        course.met.push_back(meet);
    }
    const std::string end = course.sessions.empty() ? base::utc() : course.sessions.back().started;
    course.finished = progressOf(curriculum, course.sessions, end).finished();
    return course;
}

}  // namespace palpate::training
