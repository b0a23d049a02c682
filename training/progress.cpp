#include <training/progress.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>

namespace palpate::training {

std::optional<double> daysOf(const std::string& utc)
{
    std::tm parts{};
    const char* const end = ::strptime(utc.c_str(), "%Y-%m-%dT%H:%M:%SZ", &parts);
    if (end == nullptr || *end != 0) {
        return std::nullopt;
    }
    return static_cast<double>(::timegm(&parts)) / 86400.0;
}

namespace {

ExerciseProgress exerciseProgress(const Curriculum& curriculum, const Exercise& exercise,
                                  const std::vector<StoredSession>& all, const std::string& now)
{
    ExerciseProgress p;
    p.exercise = &exercise;
    std::vector<Trial> trials;
    std::vector<bool> failed;
    for (const StoredSession& s : all) {
        if (s.curriculum != curriculum.id || s.exercise != exercise.id) {
            continue;
        }
        p.sessions.push_back(s);
        p.met.push_back(meets(exercise.gate, s.values));
        failed.push_back(!p.met.back());
        trials.push_back({s.values, s.test});
    }
    p.chart = cusum(curriculum.cusum, failed);
    p.gate = stateOf(exercise.gate, trials);
    const auto last = p.sessions.empty() ? std::nullopt : daysOf(p.sessions.back().started);
    if (const auto today = daysOf(now); last && today) {
        p.daysSince = std::max(0.0, *today - *last);
    }
    p.refresh = p.gate.open && p.daysSince && *p.daysSince > curriculum.refreshDays;
    return p;
}

}  // namespace

CurriculumProgress progressOf(const Curriculum& curriculum, const std::vector<StoredSession>& all, const std::string& now)
{
    CurriculumProgress out{&curriculum, {}};
    for (const Exercise& exercise : curriculum.exercises) {
        ExerciseProgress p = exerciseProgress(curriculum, exercise, all, now);
        p.available = std::ranges::all_of(exercise.after, [&](const std::string& before) {
            return std::ranges::any_of(out.exercises,
                                       [&](const ExerciseProgress& e) { return e.exercise->id == before && e.gate.open; });
        });
        out.exercises.push_back(std::move(p));
    }
    return out;
}

const ExerciseProgress* CurriculumProgress::next() const noexcept
{
    const ExerciseProgress* stale = nullptr;
    for (const ExerciseProgress& e : exercises) {
        const bool longer = stale == nullptr || e.daysSince.value_or(0) > stale->daysSince.value_or(0);
        stale = e.refresh && longer ? &e : stale;
    }
    if (stale != nullptr) {
        return stale;
    }
    const auto at = std::ranges::find_if(exercises, [](const ExerciseProgress& e) { return e.available && !e.gate.open; });
    return at == exercises.end() ? nullptr : &*at;
}

bool CurriculumProgress::finished() const noexcept
{
    return std::ranges::all_of(exercises, [](const ExerciseProgress& e) { return e.gate.open; });
}

std::string reasonFor(const ExerciseProgress& next)
{
    if (next.refresh) {
        return fmt::format("was reached, and not practised for {:.0f} days", std::floor(*next.daysSince));
    }
    const Gate& gate = next.exercise->gate;
    const std::string_view what = gate.testOnly ? "tests" : "sessions";
    if (next.gate.recentTried == 0) {
        return fmt::format("{}: {} of {} {} at its level open the gate",
                           next.sessions.empty() ? "is next" : "is not reached yet, with no test so far", gate.pass,
                           gate.of, what);
    }
    const std::string recent =
        next.gate.recentTried == 1
            ? fmt::format("the last {} was {}at its level", gate.testOnly ? "test" : "session",
                          next.gate.recentMet == 1 ? "" : "not ")
            : fmt::format("{} of the last {} {} at its level", next.gate.recentMet, next.gate.recentTried, what);
    return fmt::format("is not reached yet: {}, {} of {} {} asked for", recent, gate.pass, gate.of,
                       gate.of == 1 ? "is" : "are");
}

}  // namespace palpate::training
