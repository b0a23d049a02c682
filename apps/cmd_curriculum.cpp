#include <apps/command.h>
#include <apps/listed.h>
#include <apps/session_curricula.h>
#include <base/error.h>
#include <base/mapped.h>
#include <base/shell_word.h>
#include <base/temporary_folder.h>
#include <base/utc.h>
#include <command/json.h>
#include <command/options.h>
#include <command/progress.h>
#include <report/groups.h>
#include <training/course_check.h>
#include <training/folders.h>
#include <training/progress.h>
#include <training/simulate.h>
#include <training/store.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

namespace palpate::apps {

namespace {

namespace fs = std::filesystem;
using training::Curriculum;
using training::CusumChart;

struct CurriculumArguments {
    std::string id, profile;
    fs::path json, profiles;
    int people = 200, most = 500, kills = 50;
    std::uint64_t seed = 1;
};

std::string levelInWords(const training::Level& level)
{
    std::string words = level.measure;
    words += level.atLeast ? fmt::format(" at least {:g}", *level.atLeast) : "";
    words += level.atLeast && level.atMost ? " and" : "";
    return words + (level.atMost ? fmt::format(" at most {:g}", *level.atMost) : "");
}

void listCurricula(const CurriculumArguments& o)
{
    const auto all = listed("curricula", training::allCurricula);
    const auto figures = base::mapped<nlohmann::json>(all, [](const Curriculum& c) -> nlohmann::json {
        const std::size_t count = c.exercises.size();
        return {{"id", c.id}, {"title", c.title}, {"about", c.about}, {"exercises", count}, {"file", c.file.string()}};
    });
    command::writeJson(o.json, {{"curricula", figures}});
    if (o.json != "-") {
        for (const Curriculum& c : all) {
            fmt::print("{:<22} {} exercises: {}\n{:<22} {}\n", c.id, c.exercises.size(), c.title, "", c.about);
        }
    }
}

std::string sessionsInWords(double n)
{
    return std::isfinite(n) ? fmt::format("{:.0f} sessions", n) : "never";
}

void checkCurriculum(const CurriculumArguments& o)
{
    const Curriculum c = training::findCurriculum(o.id);
    fmt::print("{}: {}\n", c.id, c.title);
    int number = 0;
    for (const training::Exercise& e : c.exercises) {
        fmt::print("  {}. {} ({}), case {}; {}{} session{}:\n", ++number, e.title, e.id, e.caseId,
                   e.gate.of == 1 ? "the last" : fmt::format("{} of the last {}", e.gate.pass, e.gate.of),
                   e.gate.testOnly ? " test" : "", e.gate.of == 1 ? "" : "s");
        for (const training::Level& level : e.gate.levels) {
            fmt::print("       {}\n", levelInWords(level));
        }
    }
    const training::CusumPlan& plan = c.cusum;
    fmt::print("CUSUM: p0 {:g}, p1 {:g}, alpha {:g}, beta {:g}\n", plan.p0, plan.p1, plan.alpha, plan.beta);
    for (const double p : {plan.p0, plan.p1}) {
        fmt::print("  fails {:.0f} % of the time: {} to an alarm, {} to \"has learnt it\" (means)\n", 100 * p,
                   sessionsInWords(averageRunLength(plan, CusumChart::alarm, p)),
                   sessionsInWords(averageRunLength(plan, CusumChart::learning, p)));
    }
    const std::vector<std::string> faults = training::faultsOf(c);
    base::failIf(!faults.empty(), "{}", fmt::join(faults, "; "));
    fmt::print("good\n");
}

// That of the last session whose curriculum is there; nothing: none of them.
std::optional<Curriculum> lastPractised(const std::vector<training::StoredSession>& sessions)
{
    Curricula curricula;
    for (auto s = sessions.rbegin(); s != sessions.rend(); ++s) {
        const Curriculum* const last = s->curriculum.empty() ? nullptr : curricula.called(s->curriculum);
        if (last != nullptr) {
            return *last;
        }
    }
    return std::nullopt;
}

void next(const CurriculumArguments& o)
{
    const auto store = training::ProfileStore::toRead(o.profiles);
    const training::Person person = store.find(o.profile);
    const auto sessions = store.sessions(person);
    // The one that was named, else that of the last session, else all.
    std::vector<Curriculum> curricula;
    if (!o.id.empty()) {
        curricula.push_back(training::findCurriculum(o.id));
    } else if (const auto last = lastPractised(sessions)) {
        curricula.push_back(*last);
    } else {
        curricula = listed("curricula", training::allCurricula);
    }
    auto figures = nlohmann::json::array();
    for (const Curriculum& c : curricula) {
        const auto progress = training::progressOf(c, sessions, base::utc());
        const auto* const e = progress.next();
        if (e == nullptr) {
            figures.push_back({{"curriculum", c.id}, {"finished", true}});
            if (o.json != "-") {
                fmt::print("{}: all {} exercises are reached\n", c.id, c.exercises.size());
            }
            continue;
        }
        const std::string reason = training::reasonFor(*e);
        const bool test = e->exercise->gate.testOnly && !e->gate.open;
        const bool inFile = std::filesystem::path(o.id).extension() == ".toml";
        const std::string exercise = base::shellWord(fmt::format("{}/{}", inFile ? o.id : c.id, e->exercise->id));
        const std::string how = fmt::format("palpate train --profile {} --exercise {}{}", base::shellWord(person.name),
                                            exercise, test ? " --test" : "");
        figures.push_back({{"curriculum", c.id},
                           {"finished", false},
                           {"exercise", e->exercise->id},
                           {"title", e->exercise->title},
                           {"case", e->exercise->caseId},
                           {"refresh", e->refresh},
                           {"test", test},
                           {"reason", reason},
                           {"command", how}});
        if (o.json != "-") {
            fmt::print("{}: {} {}\n  {}\n", c.id, e->exercise->title, reason, how);
        }
    }
    command::writeJson(o.json, {{"name", person.name}, {"next", figures}});
}

void simulate(const CurriculumArguments& o)
{
    const Curriculum c = training::findCurriculum(o.id);
    auto figures = nlohmann::json::array();
    if (o.json != "-") {
        fmt::print("{} simulated people of each skill through {}, at most {} sessions each\n{:<10} {:>8}  {}\n", o.people,
                   c.id, o.most, "skill", "finished", "sessions that took: median (quartiles; most)");
    }
    for (const training::LearningLaw& law : training::learningLaws()) {
        std::vector<double> taken;
        for (int k = 0; k < o.people; ++k) {
            const auto course = training::simulate(c, law, o.seed + static_cast<std::uint64_t>(k), o.most);
            if (course.finished) {
                taken.push_back(static_cast<double>(course.sessions.size()));
            }
        }
        nlohmann::json one = {{"skill", law.name}, {"people", o.people}, {"finished", taken.size()}};
        std::string words = "none";
        if (!taken.empty()) {
            const auto at = [&](double fraction) { return report::quantile(taken, fraction); };
            one["sessions"] = {
                {"median", at(0.5)}, {"lower_quartile", at(0.25)}, {"upper_quartile", at(0.75)}, {"max", at(1)}};
            words = fmt::format("{:g} ({:g} to {:g}; {:g})", at(0.5), at(0.25), at(0.75), at(1));
        }
        figures.push_back(one);
        if (o.json != "-") {
            fmt::print("{:<10} {:>8}  {}\n", law.name, taken.size(), words);
        }
    }
    command::writeJson(o.json, {{"curriculum", c.id}, {"skills", figures}});
}

// Gates, alarm rates against theory, and the file of profiles under kill -9.
void verify(const CurriculumArguments& o)
{
    constexpr double allowed = 0.2;  // of a rate
    const Curriculum c = training::findCurriculum(o.id);
    command::Progress line;  // without a thread: the check forks
    line.show("killing processes that store");
    const base::TemporaryFolder folder("a file of profiles");
    const auto kills = training::checkKills(c, folder.path(), o.kills, o.seed);
    line.show("simulating courses");
    const auto courses = training::checkCourses(c, o.people, o.seed, o.most);
    line.clear();
    std::vector<std::string> faults = courses.gateFaults;
    faults.insert(faults.end(), kills.faults.begin(), kills.faults.end());
    std::string text = fmt::format(
        "{} people of each skill, {} sessions, {} of {} people finished\ngates: {} did not open when they should\n{:<10} "
        "{:<16} {:>8} {:>10} {:>7}\n",
        o.people, courses.sessions, courses.finished, 3 * o.people, courses.gateFaults.size(), "skill", "signal", "counted",
        "expected", "ratio");
    auto signals = nlohmann::json::array();
    for (const training::SignalCount& s : courses.signals) {
        const char* const what = s.chart == CusumChart::alarm ? "alarm" : "has learnt it";
        const auto counted = static_cast<double>(s.counted);
        const bool possible = s.expected > 0;  // before the gate opens
        const double ratio = possible ? counted / s.expected : 1;
        text += fmt::format("{:<10} {:<16} {:>8} {:>10.1f} {:>7}\n", s.skill, what, s.counted, s.expected,
                            possible ? fmt::format("{:.3f}", ratio) : "-");
        signals.push_back({{"skill", s.skill}, {"signal", what}, {"counted", s.counted}, {"expected", s.expected}});
        // Of a few signals chance alone takes more: three standard deviations of a count.
        const double most = std::max(allowed * s.expected, 3 * std::sqrt(s.expected));
        if (std::abs(counted - s.expected) > most || (!possible && s.counted > 0)) {
            faults.push_back(
                fmt::format("{}: signals \"{}\" are off by more than {:.0f} % and chance", s.skill, what, 100 * allowed));
        }
    }
    text += fmt::format("kill -9: {} times while {} sessions were stored, {} faults\n", kills.kills, kills.sessions,
                        kills.faults.size());
    if (o.json != "-") {
        fmt::print("{}", text);
    }
    command::writeJson(o.json, {{"people", o.people},
                                {"sessions", courses.sessions},
                                {"finished", courses.finished},
                                {"gate_faults", courses.gateFaults},
                                {"signals", signals},
                                {"kills", kills.kills},
                                {"stored", kills.sessions},
                                {"kill_faults", kills.faults}});
    if (!faults.empty()) {
        throw base::error("{}: {} faults, the first: {}", c.id, faults.size(), faults.front());
    }
}

}  // namespace

void addCurriculum(CLI::App& app)
{
    auto o = std::make_shared<CurriculumArguments>();
    CLI::App* const c = app.add_subcommand("curriculum", "List, check and simulate curricula, and show the next exercise");
    c->require_subcommand(1);
    const auto json = [&](CLI::App* sub) {
        sub->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    };
    CLI::App* const all = c->add_subcommand("list", "List curricula");
    json(all);
    all->final_callback([o] { listCurricula(*o); });

    CLI::App* const checked = c->add_subcommand("check", "Check a curriculum, and show its exercises and gates");
    checked->add_option("CURRICULUM", o->id, "Name or file (.toml) of the curriculum")->required();
    checked->final_callback([o] { checkCurriculum(*o); });

    CLI::App* const after = c->add_subcommand("next", "Show the next exercise of a trainee, and why");
    after->add_option("CURRICULUM", o->id, "Name or file (.toml) of the curriculum (default: that of the last session)");
    after->add_option("--profile", o->profile, "Profile of the trainee")->required();
    after->add_option("--profiles", o->profiles, "File of profiles (default: ~/.local/share/palpate/profiles.db)");
    json(after);
    after->final_callback([o] { next(*o); });

    const auto simulated = [&](CLI::App* sub) {
        sub->add_option("CURRICULUM", o->id, "Name or file (.toml) of the curriculum")->required();
        for (const auto& [name, value, what] :
             {std::tuple("--people", &o->people, "Simulated people per skill"),
              std::tuple("--sessions", &o->most, "Maximum number of sessions per person")}) {
            command::addNumber(*sub, name, *value, what, 1, 100000);
        }
        sub->add_option("--seed", o->seed, "Seed of all random choices")
            ->capture_default_str()
            ->check(command::seedFault, "a whole number");
    };
    CLI::App* const tried =
        c->add_subcommand("simulate", "Count the sessions that simulated people of three skills need, to choose gates");
    simulated(tried);
    json(tried);
    tried->final_callback([o] { simulate(*o); });

    CLI::App* const verified =
        c->add_subcommand("verify", "Test a curriculum with simulated people: gates, CUSUM charts, storage of sessions");
    simulated(verified);
    command::addNumber(*verified, "--kills", o->kills, "How many times a process that stores sessions is killed", 0, 10000);
    json(verified);
    verified->final_callback([o] { verify(*o); });
}

}  // namespace palpate::apps
