#include <trainer/example.h>

#include <base/said.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace palpate::trainer {

namespace {

using base::said;
using base::tr;

constexpr std::size_t people = 12, kept = 300;

// Values that fall with practice, with the scatter that people have.
std::vector<double> learnt(std::mt19937& random, std::size_t count, double from, double to)
{
    std::uniform_real_distribution<double> scatter(0.8, 1.2);
    std::vector<double> values(count);
    for (std::size_t i = 0; i < count; ++i) {
        values[i] = scatter(random) * (to + (from - to) * std::exp(-0.1 * static_cast<double>(i)));
    }
    return values;
}

ExerciseEntry exercise(std::mt19937& random, const CaseEntry& of, std::size_t number)
{
    constexpr int sessions = 40;
    ExerciseEntry e;
    e.curriculum = "example";
    e.curriculumTitle = "Example";
    e.id = of.id;
    e.title = of.title;
    e.caseId = of.id;
    e.standing = number == 0 ? ExerciseEntry::Standing::next : ExerciseEntry::Standing::reached;
    e.next = number == 0;
    e.sessions = sessions;
    for (const char* label : {tr("Targeting error"), tr("Path of the tip inside"), tr("Time")}) {
        e.curves.push_back({label, "mm", learnt(random, sessions, 12, 2), std::nullopt, 4});
    }
    e.alarm = {"", "", learnt(random, sessions, 3, 1), std::nullopt, 4};
    e.learning = {"", "", learnt(random, sessions, 3, 0), std::nullopt, 3};
    e.p0 = 0.1;
    e.p1 = 0.3;
    return e;
}

Result result()
{
    Result r;
    r.total = 64;
    r.parts = {{tr("Core"), 31, 50}, {tr("Vital structures"), 20, 25}, {tr("Technique"), 13, 25}};
    for (const double at : {3.1, 5.2, 8.4}) {
        r.losses.push_back({9, said("{}: 14 mm", tr("Path of the tip inside")), at});
    }
    for (int i = 0; i < 12; ++i) {
        r.measures.emplace_back(tr("Nearest to a vital structure"), "12.3 mm");
    }
    return r;
}

Comparison comparison(std::mt19937& random)
{
    constexpr std::size_t sessions = 60;
    Comparison c{{"group 1", "group 2"}, {sessions, sessions}, {}, {}};
    for (int i = 0; i < 12; ++i) {
        ComparedMeasure m{fmt::format("Measure {}", i + 1), "mm", 1, {}, 0.3};
        for (int group = 0; group < 2; ++group) {
            Spread s{4, 3, 6, learnt(random, sessions, 12, 2)};
            m.groups.push_back(std::move(s));
        }
        c.measures.push_back(std::move(m));
    }
    return c;
}

void fillInstructor(std::mt19937& random, State& state)
{
    Instructor& i = state.instructor;
    for (std::size_t n = 0; n < people; ++n) {
        state.people.push_back({fmt::format("Resident {}", n + 1), n % 5 == 0});
        putIntoGroup(state, state.people.back().name, static_cast<int>(n % 3));
    }
    for (int n = 0; n < 5; ++n) {
        LiveSession live;
        live.session = fmt::format("train-{}", n);
        live.who = fmt::format("Resident {}", n + 1);
        live.scene = "breast";
        live.doing = "inserted";
        live.warning = "artery";
        live.touching = n == 0;
        live.target = live.vital = 4.2;
        live.cores = 1;
        i.live.push_back(std::move(live));
    }
    for (std::size_t n = 0; n < kept; ++n) {
        KeptSession k;
        k.name = state.people[n % people].name;
        k.number = static_cast<std::int64_t>(n);
        k.started = "2026-11-22T09:14:05Z";
        k.caseId = state.cases.empty() ? "" : state.cases[n % state.cases.size()].id;
        k.record = "session.db";
        k.note = tr("Technique");
        k.rating = static_cast<int>(n % 6);
        k.total = 60;
        i.everybody.sessions.push_back(std::move(k));
    }
    i.comparison = comparison(random);
}

}  // namespace

std::vector<std::pair<std::string, State>> exampleScreens(const State& listed)
{
    std::mt19937 random(24);
    State base;
    base.cases = listed.cases;
    base.settings = listed.settings;
    base.devices = {true, true, tr("A Novint Falcon is ready"), "", "", false};
    base.result = result();
    base.files.record = "/home/resident/.local/share/palpate/sessions/near-vessel-20261122-091405.db";
    fillInstructor(random, base);
    base.person = base.people.front().name;
    for (std::size_t n = 0; n < std::min<std::size_t>(base.cases.size(), 16); ++n) {
        base.progress.exercises.push_back(exercise(random, base.cases[n], n));
    }
    std::vector<std::pair<std::string, State>> screens;
    const auto add = [&](const char* name, Screen screen, InstructorPage page = InstructorPage::live) {
        screens.emplace_back(name, base);
        screens.back().second.screen = screen;
        screens.back().second.instructor.page = page;
        screens.back().second.running = screen == Screen::session;
    };
    add("case", Screen::cases);
    add("device", Screen::devices);
    add("briefing", Screen::briefing);
    add("session", Screen::session);
    add("result", Screen::result);
    add("progress", Screen::progress);
    add("instructor, live", Screen::instructor, InstructorPage::live);
    add("instructor, kept", Screen::instructor, InstructorPage::sessions);
    add("instructor, groups", Screen::instructor, InstructorPage::groups);
    std::erase_if(screens, [](const auto& s) { return s.second.cases.empty() && s.second.screen == Screen::briefing; });
    return screens;
}

}  // namespace palpate::trainer
