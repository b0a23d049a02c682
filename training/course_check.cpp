#include <training/course_check.h>

#include <base/error.h>
#include <haptics/record_format.h>

#include <fmt/format.h>

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <random>
#include <utility>

namespace palpate::training {

namespace {

constexpr double negligible = 1e-12;  // chance
constexpr int longestWindow = 12;     // of a gate: what is followed doubles with each session in it

// What a chain is at: the sessions that the gate looks at, a bit each, and the chart's value in units of `cusumTie`.
using Place = std::pair<std::uint64_t, std::int64_t>;
using Chances = std::map<Place, double>;

struct Chain {
    const CusumPlan& plan;
    const Gate& gate;
    double sign, limit;
    Chances next;
    double signals = 0;

    void go(const Place& from, double chance, bool met)
    {
        if (chance < negligible) {
            return;
        }
        const double weight = sign * (met ? plan.successWeight() : plan.failureWeight());
        double value = std::max(0.0, static_cast<double>(from.second) * cusumTie + weight);
        if (value >= limit - cusumTie) {
            signals += chance;
            value = 0;
        }
        const std::uint64_t window = gate.of >= 64 ? ~0ULL : (1ULL << static_cast<unsigned>(gate.of)) - 1;
        const std::uint64_t recent = ((from.first << 1U) | (met ? 1U : 0U)) & window;
        if (std::popcount(recent) < gate.pass) {
            next[{recent, std::llround(value / cusumTie)}] += chance;
        }
    }
};

// When each gate should open, from what was drawn alone.
void checkGates(const Curriculum& curriculum, const SimulatedCourse& course, const std::string& who,
                std::vector<std::string>& faults)
{
    const auto progress = progressOf(curriculum, course.sessions, course.sessions.back().started);
    for (const ExerciseProgress& e : progress.exercises) {
        const Gate& gate = e.exercise->gate;
        std::vector<bool> met;
        int opens = -1;
        for (std::size_t n = 0; n < course.sessions.size(); ++n) {
            if (course.sessions[n].exercise != e.exercise->id) {
                continue;
            }
            met.push_back(course.met[n]);
            const auto window = std::min<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(met.size()), gate.of);
            if (opens < 0 && std::count(met.end() - window, met.end(), true) >= gate.pass) {
                opens = static_cast<int>(met.size()) - 1;
            }
        }
        if (opens != e.gate.openedAt) {
            faults.push_back(fmt::format("{}, {}: the gate should open in session {}, and opened in {}", who,
                                         e.exercise->id, opens + 1, e.gate.openedAt + 1));
        }
    }
}

void countSignals(const Curriculum& curriculum, const SimulatedCourse& course, SignalCount& alarms, SignalCount& learnt)
{
    const auto progress = progressOf(curriculum, course.sessions, course.sessions.back().started);
    for (const ExerciseProgress& e : progress.exercises) {
        const auto until = e.gate.openedAt < 0 ? e.chart.size() : static_cast<std::size_t>(e.gate.openedAt) + 1;
        for (std::size_t n = 0; n < until; ++n) {
            alarms.counted += e.chart[n].alarmed ? 1 : 0;
            learnt.counted += e.chart[n].proficient ? 1 : 0;
        }
    }
}

// What is not stored yet, in a row; says after each session that it is stored.
void storeSessions(const std::filesystem::path& file, const std::vector<SimulatedCourse>& courses, int out)
{
    ProfileStore store(file);
    for (std::size_t k = 0; k < courses.size(); ++k) {
        const Person person = store.find(learningLaws()[k].name);
        const auto& sessions = courses[k].sessions;
        for (auto n = static_cast<std::size_t>(person.sessions); n < sessions.size(); ++n) {
            store.store(person, sessions[n]);
            base::failIf(::write(out, "s", 1) != 1, "nobody listens");
        }
    }
}

[[noreturn]] void storeTheRest(const std::filesystem::path& file, const std::vector<SimulatedCourse>& courses, int out)
{
    try {
        storeSessions(file, courses, out);
        ::close(out);  // all is stored
        ::pause();
    } catch (...) {
        ::_exit(2);
    }
    ::_exit(0);
}

std::string integrityOf(const std::filesystem::path& file)
{
    haptics::format::Database database(file.string(), SQLITE_OPEN_READWRITE);
    haptics::format::Statement check(database, "PRAGMA integrity_check");
    return check.step() ? std::string(check.text(0)) : "no answer";
}

// Nothing but the beginnings of the courses may be in the file. Returns how many sessions there are.
std::size_t compare(const std::filesystem::path& file, const std::vector<SimulatedCourse>& courses, int kill,
                    std::vector<std::string>& faults)
{
    if (const std::string whole = integrityOf(file); whole != "ok") {
        faults.push_back(fmt::format("kill {}: the file is damaged: {}", kill, whole));
    }
    const ProfileStore store(file);
    std::size_t count = 0;
    for (std::size_t k = 0; k < courses.size(); ++k) {
        const auto stored = store.sessions(store.find(learningLaws()[k].name));
        for (std::size_t n = 0; n < stored.size(); ++n) {
            const bool same = n < courses[k].sessions.size() && stored[n].started == courses[k].sessions[n].started &&
                              stored[n].exercise == courses[k].sessions[n].exercise &&
                              stored[n].values == courses[k].sessions[n].values;
            if (!same) {
                faults.push_back(
                    fmt::format("kill {}: session {} of {} is not as it was stored", kill, n + 1, learningLaws()[k].name));
            }
        }
        count += stored.size();
    }
    return count;
}

// A process that stores, killed at a random moment: after some sessions, and then at any point of the next ones. Returns
// how many it said that it had stored.
std::size_t storeAndKill(const std::filesystem::path& file, const std::vector<SimulatedCourse>& courses,
                         std::mt19937_64& random)
{
    constexpr int maxHeard = 7;
    constexpr useconds_t longest = 12000;  // about two sessions [us]
    int ends[2];
    base::failIf(::pipe(ends) != 0, "no pipe can be made to a process that stores");
    const pid_t child = ::fork();
    base::failIf(child < 0, "no process can be started that stores");
    if (child == 0) {
        ::close(ends[0]);
        storeTheRest(file, courses, ends[1]);
    }
    ::close(ends[1]);
    const auto wanted = random() % maxHeard;
    std::size_t said = 0;
    char c = 0;
    while (said < wanted && ::read(ends[0], &c, 1) == 1) {
        ++said;
    }
    ::usleep(static_cast<useconds_t>(random() % longest));
    ::kill(child, SIGKILL);
    int status = 0;
    ::waitpid(child, &status, 0);
    const bool failed = WIFEXITED(status);  // one that stored all waits to be killed
    while (::read(ends[0], &c, 1) == 1) {
        ++said;
    }
    ::close(ends[0]);
    base::failIf(failed, "{}: sessions cannot be stored there: is the disk full?", file.native());
    return said;
}

}  // namespace

double expectedSignals(const CusumPlan& plan, const Gate& gate, const LearningLaw& law, CusumChart chart, int most)
{
    const bool alarm = chart == CusumChart::alarm;
    Chain chain{plan, gate, alarm ? 1.0 : -1.0, alarm ? plan.alarmLimit() : plan.learningLimit(), {}, 0};
    Chances now{{{0, 0}, 1.0}};
    for (int n = 1; n <= most && !now.empty(); ++n) {
        chain.next.clear();
        const double met = law.chance(n);
        for (const auto& [place, chance] : now) {
            chain.go(place, chance * met, true);
            chain.go(place, chance * (1 - met), false);
        }
        std::swap(now, chain.next);
    }
    return chain.signals;
}

CourseCheck checkCourses(const Curriculum& curriculum, int people, std::uint64_t seed, int most)
{
    for (const Exercise& e : curriculum.exercises) {
        base::failIf(e.gate.of > longestWindow,
                     "exercise {}: its gate looks at the last {} sessions; verify follows {} at most", e.id, e.gate.of,
                     longestWindow);
    }
    CourseCheck check;
    for (const LearningLaw& law : learningLaws()) {
        SignalCount alarms{law.name, CusumChart::alarm, 0, 0}, learnt{law.name, CusumChart::learning, 0, 0};
        for (int k = 0; k < people; ++k) {
            const SimulatedCourse course = simulate(curriculum, law, seed + static_cast<std::uint64_t>(k), most);
            check.sessions += course.sessions.size();
            check.finished += course.finished ? 1 : 0;
            checkGates(curriculum, course, fmt::format("{} {}", law.name, k + 1), check.gateFaults);
            countSignals(curriculum, course, alarms, learnt);
        }
        for (SignalCount* count : {&alarms, &learnt}) {
            for (const Exercise& e : curriculum.exercises) {
                count->expected += people * expectedSignals(curriculum.cusum, e.gate, law, count->chart, most);
            }
            check.signals.push_back(*count);
        }
    }
    return check;
}

KillCheck checkKills(const Curriculum& curriculum, const std::filesystem::path& folder, int kills, std::uint64_t seed)
{
    constexpr int most = 500;  // sessions of a person
    KillCheck check;
    const std::filesystem::path file = folder / "killed.db";
    std::vector<SimulatedCourse> courses;
    std::size_t all = 0;
    {
        ProfileStore store(file);
        for (const LearningLaw& law : learningLaws()) {
            store.add(law.name, Hand::right);
            courses.push_back(simulate(curriculum, law, seed, most));
            all += courses.back().sessions.size();
        }
    }
    std::mt19937_64 random(seed);
    for (check.kills = 0; check.kills < kills;) {
        const std::size_t said = storeAndKill(file, courses, random);
        ++check.kills;
        const std::size_t now = compare(file, courses, check.kills, check.faults);
        if (now < check.sessions + said || now > check.sessions + said + 1) {
            check.faults.push_back(fmt::format("kill {}: {} sessions are there; {} were before, and {} said to be stored",
                                               check.kills, now, check.sessions, said));
        }
        check.sessions = now;
    }
    // And to its end.
    while (check.sessions < all && check.faults.empty()) {
        storeAndKill(file, courses, random);
        check.sessions = compare(file, courses, check.kills, check.faults);
    }
    return check;
}

}  // namespace palpate::training
