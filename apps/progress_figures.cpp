#include <apps/progress_figures.h>

#include <base/mapped.h>
#include <haptics/measures.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>

namespace palpate::apps {

using nlohmann::json;
using training::CurriculumProgress;
using training::ExerciseProgress;
using training::PersonProgress;
using training::StoredSession;

namespace {

constexpr std::size_t recent = 5;  // sessions of which a median is given

// A value for each session; null where there is none.
json curveOf(const ExerciseProgress& e, std::string_view key)
{
    return base::mapped<json>(e.sessions, [&](const StoredSession& s) { return training::valueIn(s.values, key); });
}

// Rows as docs/curriculum.md has them: a person, an exercise, a measure.
void addRows(const PersonProgress& p, const CurriculumProgress& c, const ExerciseProgress& e, json& rows)
{
    if (e.sessions.empty()) {
        return;
    }
    const auto& last = e.chart.back();
    for (const std::string& key : training::measuresOf(*e.exercise)) {
        auto values = base::mapped<double>(e.sessions, [&](const auto& s) { return training::valueIn(s.values, key); });
        std::erase_if(values, [](double value) { return std::isnan(value); });
        values.erase(values.begin(), values.end() - static_cast<std::ptrdiff_t>(std::min(values.size(), recent)));
        rows.push_back({{"name", p.person.name},
                        {"curriculum", c.curriculum->id},
                        {"exercise", e.exercise->id},
                        {"measure", key},
                        {"trials", e.sessions.size()},
                        {"median_last", report::quantile(values, 0.5)},
                        {"curve", curveOf(e, key)},
                        {"cusum",
                         {{"alarm", last.alarm},
                          {"learning", last.learning},
                          {"alarms", std::ranges::count_if(e.chart, &training::CusumPoint::alarmed)},
                          {"learnt", std::ranges::any_of(e.chart, &training::CusumPoint::proficient)}}},
                        {"proficient", e.gate.open},
                        {"days_since", e.daysSince ? json(*e.daysSince) : json()},
                        {"refresh", e.refresh}});
    }
}

json levelsOf(const training::Gate& gate)
{
    return base::mapped<json>(gate.levels, [](const training::Level& level) {
        return json{{"measure", level.measure},
                    {"at_least", level.atLeast ? json(*level.atLeast) : json()},
                    {"at_most", level.atMost ? json(*level.atMost) : json()}};
    });
}

// Where somebody stands in an exercise, and the charts of it; also of one that was not begun.
json standing(const PersonProgress& p, const CurriculumProgress& c, const ExerciseProgress& e, bool next)
{
    json curves = json::object();
    for (const std::string& key : training::measuresOf(*e.exercise)) {
        curves[key] = curveOf(e, key);
    }
    const training::CusumPlan& plan = c.curriculum->cusum;
    return {{"name", p.person.name},
            {"curriculum", c.curriculum->id},
            {"curriculum_title", c.curriculum->title},
            {"exercise", e.exercise->id},
            {"title", e.exercise->title},
            {"case", e.exercise->caseId},
            {"state", e.refresh     ? "refresh"
                      : e.gate.open ? "reached"
                      : next        ? "next"
                      : e.available ? "open"
                                    : "locked"},
            {"next", next},
            {"test", e.exercise->gate.testOnly},
            {"sessions", e.sessions.size()},
            {"recent_met", e.gate.recentMet},
            {"recent_tried", e.gate.recentTried},
            {"pass", e.exercise->gate.pass},
            {"of", e.exercise->gate.of},
            {"days_since", e.daysSince ? json(*e.daysSince) : json()},
            {"met", e.met},
            {"levels", levelsOf(e.exercise->gate)},
            {"curves", curves},
            {"cusum",
             {{"p0", plan.p0},
              {"p1", plan.p1},
              {"alarm", base::mapped<json>(e.chart, &training::CusumPoint::alarm)},
              {"learning", base::mapped<json>(e.chart, &training::CusumPoint::learning)},
              {"alarm_limit", plan.alarmLimit()},
              {"learning_limit", plan.learningLimit()}}}};
}

json nextOf(const PersonProgress& p, const CurriculumProgress& c)
{
    const auto* const n = c.next();
    return {{"name", p.person.name},
            {"curriculum", c.curriculum->id},
            {"exercise", n ? json(n->exercise->id) : json()},
            {"reason", n ? training::reasonFor(*n) : "all exercises are reached"},
            {"cusum_plan",
             {{"p0", c.curriculum->cusum.p0},
              {"p1", c.curriculum->cusum.p1},
              {"alpha", c.curriculum->cusum.alpha},
              {"beta", c.curriculum->cusum.beta}}}};
}

json sessionOf(const PersonProgress& p, const StoredSession& s)
{
    return {{"name", p.person.name},
            {"session", s.id},
            {"started", s.started},
            {"case", s.caseId},
            {"curriculum", s.curriculum},
            {"exercise", s.exercise},
            {"scene", s.scene},
            {"mode", s.test ? "test" : "practice"},
            {"record", s.record},
            {"rating", s.rating},
            {"note", s.note},
            {"measures", s.values}};
}

}  // namespace

json groupFigures(const report::ScoredGroup& g)
{
    json median, lower, upper, values;
    for (const haptics::Measure& m : haptics::measures()) {
        const auto all = report::valuesOf(g, m);
        median[m.key] = report::quantile(all, 0.5);
        lower[m.key] = report::quantile(all, 0.25);
        upper[m.key] = report::quantile(all, 0.75);
        values[m.key] = all;
    }
    return {{"name", g.name},          {"n", g.sessions.size()},  {"median", median},
            {"lower_quartile", lower}, {"upper_quartile", upper}, {"values", values}};
}

json effectFigures(const report::ScoredGroup& a, const report::ScoredGroup& b)
{
    json out;
    for (const haptics::Measure& m : haptics::measures()) {
        const auto delta = report::effectSize(a, b, m);
        out[m.key] = delta ? json(*delta) : json();
    }
    return out;
}

json progressFigures(const std::vector<PersonProgress>& people, const std::vector<report::ScoredGroup>& groups)
{
    json rows = json::array(), exercises = json::array(), next = json::array(), sessions = json::array(),
         measures = json::array();
    for (const PersonProgress& p : people) {
        for (const CurriculumProgress& c : p.curricula) {
            const auto* const n = c.next();
            for (const ExerciseProgress& e : c.exercises) {
                addRows(p, c, e, rows);
                exercises.push_back(standing(p, c, e, &e == n));
            }
            next.push_back(nextOf(p, c));
        }
        for (const StoredSession& s : p.sessions) {
            sessions.push_back(sessionOf(p, s));
        }
    }
    for (const haptics::Measure& m : haptics::measures()) {
        measures.push_back({{"key", m.key}, {"label", m.label}, {"unit", m.unit}, {"decimals", m.decimals}});
    }
    json out = {{"people", rows},
                {"exercises", exercises},
                {"next", next},
                {"sessions", sessions},
                {"groups", base::mapped<json>(groups, groupFigures)},
                {"measures", measures}};
    if (groups.size() >= 2) {
        out["effect_size"] = effectFigures(groups[0], groups[1]);
    }
    return out;
}

}  // namespace palpate::apps
