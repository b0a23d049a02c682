#include <apps/command.h>
#include <apps/progress_figures.h>
#include <apps/session_curricula.h>
#include <base/counted.h>
#include <base/error.h>
#include <base/mapped.h>
#include <base/outputs.h>
#include <base/utc.h>
#include <command/json.h>
#include <report/measure_table.h>
#include <training/case.h>
#include <training/curriculum.h>
#include <training/progress_page.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <memory>
#include <utility>

namespace palpate::apps {

namespace {

namespace fs = std::filesystem;
using training::CurriculumProgress;
using training::ExerciseProgress;
using training::PeopleGroup;
using training::PersonProgress;

struct ProgressArguments {
    std::vector<std::string> names, groups, curricula;
    std::string caseId, exercise;
    fs::path profiles, html, csv, xapi, json;
    bool all = false;
};

/// @param asked  curricula that are shown also where the person has not begun them
PersonProgress progressOf(const training::ProfileStore& store, const training::Person& person,
                          const std::vector<std::string>& asked, Curricula& curricula)
{
    PersonProgress out{person, store.sessions(person), {}};
    std::vector<std::string> named = asked;
    for (const auto& s : out.sessions) {
        if (!s.curriculum.empty() && std::ranges::find(named, s.curriculum) == named.end()) {
            named.push_back(s.curriculum);
        }
    }
    for (const std::string& id : named) {
        if (const auto* const c = curricula.called(id)) {
            out.curricula.push_back(training::progressOf(*c, out.sessions, base::utc()));
        }
    }
    return out;
}

// A name that holds a comma is one name where somebody has it.
std::vector<std::string> namesIn(const std::string& text, const training::ProfileStore& store)
{
    const auto people = store.people();
    const bool isOne = std::ranges::find(people, text, &training::Person::name) != people.end();
    return isOne ? std::vector{text} : CLI::detail::split(text, ',');
}

// "experts=anna,bert": all sessions of these people that the filters let through, added to the group of this name.
void addToGroup(const ProgressArguments& o, const std::string& text, const training::ProfileStore& store,
                Curricula& curricula, std::vector<PeopleGroup>& groups)
{
    const std::size_t equals = text.find('=');
    base::failIf(equals == 0 || equals == std::string::npos || equals + 1 == text.size(),
                 "--group {}: give a name and profiles, as in --group residents=anna,bert", text);
    const std::string called = text.substr(0, equals);
    auto group = std::ranges::find(groups, called, &PeopleGroup::name);
    group = group != groups.end() ? group : groups.insert(groups.end(), {called, {}});
    const bool tables = !o.csv.empty() || !o.xapi.empty();  // which say whether levels were met
    for (const std::string& name : namesIn(text.substr(equals + 1), store)) {
        const training::Person person = store.find(name);
        const auto isPerson = [&](const PersonProgress& other) { return other.person.id == person.id; };
        base::failIf(std::ranges::any_of(group->people, isPerson),
                     "--group {}: {} is in this group already: name each profile once", text, person.name);
        PersonProgress p =
            tables ? progressOf(store, person, {}, curricula) : PersonProgress{person, store.sessions(person), {}};
        std::erase_if(p.sessions, [&](const training::StoredSession& s) {
            return (!o.caseId.empty() && s.caseId != o.caseId) ||
                   (!o.exercise.empty() && s.curriculum + "/" + s.exercise != o.exercise);
        });
        group->people.push_back(std::move(p));
    }
}

// What nobody has done has to be there at least. A case may be gone that somebody has done.
void checkFilters(const ProgressArguments& o, const training::ProfileStore& store)
{
    bool ofCase = o.caseId.empty(), ofExercise = o.exercise.empty();
    for (const training::Person& person : store.people()) {
        for (const training::StoredSession& s : store.sessions(person)) {
            ofCase = ofCase || s.caseId == o.caseId;
            ofExercise = ofExercise || s.curriculum + "/" + s.exercise == o.exercise;
        }
    }
    if (!ofCase) {
        static_cast<void>(training::findCase(o.caseId));
    }
    if (!ofExercise) {
        static_cast<void>(training::findExercise(o.exercise));
    }
}

std::vector<PeopleGroup> groupsOf(const ProgressArguments& o, const training::ProfileStore& store, Curricula& curricula)
{
    std::vector<PeopleGroup> groups;
    for (const std::string& text : o.groups) {
        addToGroup(o, text, store, curricula, groups);
    }
    return groups;
}

report::ScoredGroup scored(const PeopleGroup& group)
{
    report::ScoredGroup out{group.name, {}};
    for (const PersonProgress& p : group.people) {
        std::ranges::transform(p.sessions, std::back_inserter(out.sessions), training::rowOf);
    }
    base::failIf(out.sessions.empty(), "--group {}: these people have no such sessions", group.name);
    return out;
}

std::string levelInWords(const ExerciseProgress& e)
{
    if (e.sessions.empty()) {
        return "no session yet";
    }
    const std::string count = fmt::format("{:>12}, ", base::counted(e.sessions.size(), "session"));
    switch (e.gate.recentTried) {
        case 0:
            return count + "no test yet";
        case 1:
            return count + (e.gate.recentMet == 1 ? "the last one at the level" : "the last one not at the level");
        default:
            return count + fmt::format("{} of the last {} at the level", e.gate.recentMet, e.gate.recentTried);
    }
}

void printPerson(const PersonProgress& p)
{
    fmt::print("{} ({})\n", p.person.name, base::counted(p.sessions.size(), "session"));
    for (const CurriculumProgress& c : p.curricula) {
        fmt::print("  {}\n", c.curriculum->title);
        const auto* const next = c.next();
        for (const ExerciseProgress& e : c.exercises) {
            const char* const state = e.refresh     ? "to be refreshed"
                                      : e.gate.open ? "reached"
                                      : &e == next  ? "next"
                                      : e.available ? "open"
                                                    : "locked";
            fmt::print("    {:<40} {:<15} {}\n", e.exercise->title, state, levelInWords(e));
        }
        fmt::print("  {}\n", next == nullptr ? "all exercises are reached"
                                             : fmt::format("{} {}", next->exercise->title, training::reasonFor(*next)));
    }
}

// With the numbers that palpate profile note asks for.
void printSessionsOf(const PersonProgress& p)
{
    if (p.sessions.empty()) {
        return;
    }
    fmt::print("  {:>7}  {:<20}  {:<22}  {:>5}  {}\n", "session", "started (UTC)", "case", "total", "kept under");
    for (const training::StoredSession& s : p.sessions) {
        std::string started = s.started.substr(0, 16);
        std::ranges::replace(started, 'T', ' ');
        const double total = training::valueIn(s.values, "total");
        fmt::print("  {:>7}  {:<20}  {:<22}  {:>5}  {}{}\n", s.id, started, s.caseId.empty() ? s.scene : s.caseId,
                   std::isnan(total) ? "-" : fmt::format("{:.0f}", total),
                   s.exercise.empty() ? "free practice" : s.curriculum + "/" + s.exercise, s.test ? " (test)" : "");
    }
}

void print(const ProgressArguments& o, const std::vector<PersonProgress>& people,
           const std::vector<report::ScoredGroup>& groups)
{
    for (const PersonProgress& p : people) {
        printPerson(p);
        if (!o.all) {
            printSessionsOf(p);
        }
    }
    if (!groups.empty()) {
        fmt::print("{}\n", report::groupTable(groups));
    }
}

void run(const ProgressArguments& o)
{
    const auto store = training::ProfileStore::toRead(o.profiles);
    base::checkNames({o.html, o.csv, o.xapi});
    base::checkOutputs({o.html, o.csv, o.xapi, o.json}, {store.file()});
    Curricula curricula;
    const auto asked = base::mapped<std::string>(o.curricula, [&](const std::string& id) { return curricula.add(id); });
    const auto shown = o.all ? store.people()
                             : base::mapped<training::Person>(o.names, [&](const auto& name) { return store.find(name); });
    const auto people =
        base::mapped<PersonProgress>(shown, [&](const auto& who) { return progressOf(store, who, asked, curricula); });
    checkFilters(o, store);
    const std::vector<PeopleGroup> grouped = groupsOf(o, store, curricula);
    const auto groups = base::mapped<report::ScoredGroup>(grouped, scored);
    base::failIf(people.empty() && groups.empty(),
                 "progress: give a profile's name, --all, or --group NAME=PROFILE,PROFILE");
    // First what a file that cannot be written takes from nobody.
    if (o.json != "-") {
        print(o, people, groups);
    }
    if (!o.html.empty()) {
        training::writeProgressPage(o.html, people, groups);
    }
    if (!o.csv.empty()) {
        training::writeProgressCsv(o.csv, people, grouped);
    }
    if (!o.xapi.empty()) {
        training::writeXapi(o.xapi, people, grouped);
    }
    command::writeJson(o.json, progressFigures(people, groups));
    for (const auto& [what, file] : {std::pair{"page", o.html}, {"table", o.csv}, {"statements", o.xapi}}) {
        if (!file.empty() && file != "-" && o.json != "-") {
            fmt::print("{}: {}\n", what, file.string());
        }
    }
}

}  // namespace

void addProgress(CLI::App& app)
{
    auto o = std::make_shared<ProgressArguments>();
    CLI::App* const c =
        app.add_subcommand("progress", "Show learning curves, exercises reached and the next exercise; compare groups");
    c->add_option("NAME", o->names, "Profiles to show");
    c->add_flag("--all", o->all, "Show all profiles")->excludes("NAME");
    c->add_option("--group", o->groups,
                  "Group to compare, as NAME=PROFILE,PROFILE; repeat the option for each group, or to add to one")
        ->allow_extra_args(false);
    c->add_option("--curriculum", o->curricula, "Show this curriculum also if it was not begun; may be repeated")
        ->allow_extra_args(false);
    c->add_option("--case", o->caseId, "With --group: only sessions of this case")->needs("--group");
    c->add_option("--exercise", o->exercise, "With --group: only sessions of this CURRICULUM/EXERCISE")->needs("--group");
    c->add_option("--html", o->html, "Write a page (HTML) to this file");
    c->add_option("--csv", o->csv, "Write a table (CSV) to this file, one row per session; with --group also theirs");
    c->add_option("--xapi", o->xapi, "Write xAPI statements to this file");
    c->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    c->add_option("--profiles", o->profiles, "File of profiles (default: ~/.local/share/palpate/profiles.db)");
    c->final_callback([o] { run(*o); });
}

}  // namespace palpate::apps
