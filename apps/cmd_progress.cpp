#include <apps/command.h>
#include <base/outputs.h>
#include <command/json.h>
#include <haptics/measures.h>
#include <training/progress_page.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <stdexcept>

namespace palpate::apps {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using training::CurriculumProgress;
using training::ExerciseProgress;
using training::PersonProgress;

constexpr std::size_t recent = 5;  // sessions of which a median is given

struct Options {
    std::vector<std::string> names, groups;
    std::string caseId, exercise;
    fs::path profiles, html, csv, xapi, json;
    bool all = false;
};

/// Curricula that sessions name, read once: what is returned points to them.
class Curricula {
public:
    const training::Curriculum* called(const std::string& id)
    {
        const auto known = all_.find(id);
        if (known != all_.end()) {
            return known->second ? &*known->second : nullptr;
        }
        std::optional<training::Curriculum>& made = all_[id];
        try {
            made = training::findCurriculum(id);
        } catch (const std::runtime_error& e) {
            fmt::print(stderr, "palpate: warning: its sessions count for no curriculum: {}\n", e.what());
        }
        return made ? &*made : nullptr;
    }

private:
    std::map<std::string, std::optional<training::Curriculum>> all_;
};

PersonProgress progressOf(const training::ProfileStore& store, const training::Person& person, Curricula& curricula)
{
    PersonProgress out{person, store.sessions(person), {}};
    std::vector<std::string> named;
    for (const auto& s : out.sessions) {
        if (!s.curriculum.empty() && std::ranges::find(named, s.curriculum) == named.end()) {
            named.push_back(s.curriculum);
        }
    }
    for (const std::string& id : named) {
        if (const auto* const c = curricula.called(id)) {
            out.curricula.push_back(training::progressOf(*c, out.sessions, training::utcNow()));
        }
    }
    return out;
}

double medianOf(std::vector<double> values)
{
    return values.empty() ? NAN : report::quantile(std::move(values), 0.5);
}

// Rows as docs/curriculum.md has them: a person, an exercise, a measure.
void addRows(const PersonProgress& p, const CurriculumProgress& c, const ExerciseProgress& e, json& rows)
{
    if (e.sessions.empty()) {
        return;
    }
    std::vector<std::string> keys{"total"};
    for (const training::Level& level : e.exercise->gate.levels) {
        if (std::ranges::find(keys, level.measure) == keys.end()) {
            keys.push_back(level.measure);
        }
    }
    const auto& last = e.chart.back();
    for (const std::string& key : keys) {
        std::vector<double> values;
        json curve = json::array();
        for (const auto& s : e.sessions) {
            const auto at = s.values.find(key);
            curve.push_back(at == s.values.end() ? json() : json(at->second));
            if (at != s.values.end()) {
                values.push_back(at->second);
            }
        }
        values.erase(values.begin(), values.end() - static_cast<std::ptrdiff_t>(std::min(values.size(), recent)));
        rows.push_back({{"name", p.person.name},
                        {"curriculum", c.curriculum->id},
                        {"exercise", e.exercise->id},
                        {"measure", key},
                        {"trials", e.sessions.size()},
                        {"median_last", medianOf(values)},
                        {"curve", curve},
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

json figures(const std::vector<PersonProgress>& people, const std::vector<report::ScoredGroup>& groups)
{
    json rows = json::array(), next = json::array(), sessions = json::array(), compared = json::array();
    for (const PersonProgress& p : people) {
        for (const CurriculumProgress& c : p.curricula) {
            for (const ExerciseProgress& e : c.exercises) {
                addRows(p, c, e, rows);
            }
            const auto* const n = c.next();
            next.push_back({{"name", p.person.name},
                            {"curriculum", c.curriculum->id},
                            {"exercise", n ? json(n->exercise->id) : json()},
                            {"reason", n ? training::reasonFor(*n) : "all exercises are reached"},
                            {"cusum_plan",
                             {{"p0", c.curriculum->cusum.p0},
                              {"p1", c.curriculum->cusum.p1},
                              {"alpha", c.curriculum->cusum.alpha},
                              {"beta", c.curriculum->cusum.beta}}}});
        }
        for (const auto& s : p.sessions) {
            sessions.push_back({{"name", p.person.name},
                                {"session", s.id},
                                {"started", s.started},
                                {"case", s.caseId},
                                {"curriculum", s.curriculum},
                                {"exercise", s.exercise},
                                {"mode", s.test ? "test" : "practice"},
                                {"record", s.record},
                                {"rating", s.rating},
                                {"note", s.note},
                                {"measures", s.values}});
        }
    }
    for (const report::ScoredGroup& g : groups) {
        json medians;
        for (const haptics::Measure& m : haptics::measures()) {
            medians[m.key] = report::quantile(report::valuesOf(g, m), 0.5);
        }
        compared.push_back({{"name", g.name}, {"n", g.sessions.size()}, {"median", medians}});
    }
    json out = {{"people", rows}, {"next", next}, {"sessions", sessions}, {"groups", compared}};
    if (groups.size() >= 2) {
        for (const haptics::Measure& m : haptics::measures()) {
            out["effect_size"][m.key] = report::cliffsDelta(report::valuesOf(groups[0], m), report::valuesOf(groups[1], m));
        }
    }
    return out;
}

// "experts=anna,bert": all sessions of these people that the filters let through.
report::ScoredGroup groupOf(const Options& o, const std::string& text, const training::ProfileStore& store)
{
    const std::size_t equals = text.find('=');
    if (equals == 0 || equals == std::string::npos || equals + 1 == text.size()) {
        throw std::runtime_error("--group " + text + ": give a name and profiles, as in --group residents=anna,bert");
    }
    report::ScoredGroup group{text.substr(0, equals), {}};
    for (const std::string& name : CLI::detail::split(text.substr(equals + 1), ',')) {
        for (const auto& s : store.sessions(store.find(name))) {
            const bool wanted = (o.caseId.empty() || s.caseId == o.caseId) &&
                                (o.exercise.empty() || s.curriculum + "/" + s.exercise == o.exercise);
            if (wanted) {
                group.sessions.push_back(training::rowOf(s));
            }
        }
    }
    if (group.sessions.empty()) {
        throw std::runtime_error("--group " + text + ": these people have no such sessions");
    }
    return group;
}

void print(const PersonProgress& p)
{
    fmt::print("{} ({} sessions)\n", p.person.name, p.sessions.size());
    for (const CurriculumProgress& c : p.curricula) {
        fmt::print("  {}\n", c.curriculum->title);
        const auto* const next = c.next();
        for (const ExerciseProgress& e : c.exercises) {
            const char* const state = e.refresh     ? "to be refreshed"
                                      : e.gate.open ? "reached"
                                      : &e == next  ? "next"
                                      : e.available ? "open"
                                                    : "locked";
            fmt::print("    {:<40} {:<15} {:>3} sessions, {} of the last {} at the level\n", e.exercise->title, state,
                       e.sessions.size(), e.gate.recentMet, e.gate.recentTried);
        }
        fmt::print("  {}\n", next == nullptr ? "all exercises are reached"
                                             : fmt::format("{} {}", next->exercise->title, training::reasonFor(*next)));
    }
}

void run(const Options& o)
{
    for (const fs::path& file : {o.html, o.csv, o.xapi, o.json}) {
        base::checkOutput(file);
    }
    const training::ProfileStore store(o.profiles.empty() ? training::ProfileStore::standardFile() : o.profiles);
    Curricula curricula;
    std::vector<PersonProgress> people;
    for (const std::string& name : o.names) {
        people.push_back(progressOf(store, store.find(name), curricula));
    }
    if (o.all) {
        for (const training::Person& person : store.people()) {
            people.push_back(progressOf(store, person, curricula));
        }
    }
    std::vector<report::ScoredGroup> groups;
    for (const std::string& text : o.groups) {
        groups.push_back(groupOf(o, text, store));
    }
    if (people.empty() && groups.empty()) {
        throw std::runtime_error("progress: give a profile's name, --all, or --group NAME=PROFILE,PROFILE");
    }
    if (!o.html.empty()) {
        training::writeProgressPage(o.html, people, groups);
    }
    if (!o.csv.empty()) {
        training::writeProgressCsv(o.csv, people);
    }
    if (!o.xapi.empty()) {
        training::writeXapi(o.xapi, people);
    }
    if (!o.json.empty()) {
        command::writeJson(o.json, figures(people, groups));
    }
    if (o.json != "-") {
        for (const PersonProgress& p : people) {
            print(p);
        }
    }
}

}  // namespace

void addProgress(CLI::App& app)
{
    auto o = std::make_shared<Options>();
    CLI::App* const c =
        app.add_subcommand("progress", "Learning curves, what is reached, what to train next; groups compared");
    c->add_option("NAME", o->names, "profiles");
    c->add_flag("--all", o->all, "of everybody")->excludes("NAME");
    c->add_option("--group", o->groups, "a group to compare: NAME=PROFILE,PROFILE; give the option once per group")
        ->allow_extra_args(false);
    c->add_option("--case", o->caseId, "groups: only sessions of this case");
    c->add_option("--exercise", o->exercise, "groups: only sessions of this CURRICULUM/EXERCISE");
    c->add_option("--html", o->html, "write a page here");
    c->add_option("--csv", o->csv, "write a table here, one line per session");
    c->add_option("--xapi", o->xapi, "write xAPI statements here");
    c->add_option("--json", o->json, "write the figures here (- for standard output)");
    c->add_option("--profiles", o->profiles, "file of the profiles");
    c->final_callback([o] { run(*o); });
}

}  // namespace palpate::apps
