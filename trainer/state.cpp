#include <trainer/state.h>

#include <base/said.h>
#include <base/shell_word.h>
#include <base/user_files.h>
#include <trainer/results.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <functional>
#include <tuple>
#include <utility>

namespace palpate::trainer {

using base::marked;
using base::said;
using base::tr;

namespace {

// Of the viewer's window.
// Words of a command, of which some are added only where they are asked for.
struct Words : std::vector<std::string> {
    void add(bool asked, std::initializer_list<std::string> more)
    {
        insert(end(), more.begin(), asked ? more.end() : more.begin());
    }
    void addLook(const State& state)
    {
        add(state.settings.palette != "standard", {"--palette", state.settings.palette});
        add(state.settings.sounds, {"--sounds"});
    }
    void addDevice(const State& state)
    {
        add(true, {"--device", state.useFalcon ? "falcon" : "mouse"});
        add(state.useFalcon && !state.firmware.empty(), {"--falcon-firmware", state.firmware});
    }
};

// What was said on one screen is not said on the next.
void turnTo(State& state, Screen screen)
{
    state.screen = screen;
    state.notice.clear();
    state.told.clear();
    state.leaving = false;
}

}  // namespace

const CaseEntry& chosenCase(const State& state)
{
    assert(!state.cases.empty());
    return state.cases[std::min(state.chosen, state.cases.size() - 1)];
}

std::vector<std::string> stepsOf(const State& state)
{
    const CaseEntry& c = chosenCase(state);
    std::vector<std::string> steps;
    if (state.useFalcon) {
        steps.emplace_back(c.palpation ? tr("Hold the centre button of the grip: you hold the fingertip. Push to press.")
                                       : tr("Hold the centre button of the grip: you hold the needle. Push it in."));
        steps.front() += c.core ? " " + std::string(tr("The forward button fires, once the needle is inside.")) : "";
    } else {
        steps.emplace_back(c.palpation ? tr("Hold the mouse button of your index finger in the picture, or press Enter: "
                                            "you hold the fingertip. The wheel forward, or Page down, presses.")
                                       : tr("Hold the mouse button of your index finger in the picture, or press Enter: "
                                            "you hold the needle. The wheel forward, or Page down, pushes it in by 1 mm."));
        steps.front() += c.core ? " " + std::string(tr("Space fires, once the needle is inside.")) : "";
    }
    steps.insert(steps.end(), c.steps.begin(), c.steps.end());
    if (state.useFalcon) {
        steps.emplace_back(c.palpation
                               ? tr("The right button marks. The left one, held for a second, ends the session. S pauses.")
                               : tr("The left button, held for a second, ends the session. S pauses."));
    } else {
        steps.emplace_back(c.palpation ? tr("M marks, Shift M takes the last mark back, S pauses, E ends the session.")
                                       : tr("S pauses, E ends the session."));
    }
    return steps;
}

const char* nameOf(Screen screen) noexcept
{
    constexpr std::array names{marked("Case"),   marked("Device"),   marked("Briefing"),  marked("Session"),
                               marked("Result"), marked("Progress"), marked("Instructor")};
    return tr(names[static_cast<std::size_t>(screen)]);
}

const char* mainButton(const State& state) noexcept
{
    constexpr std::array words{marked("Choose this case"), marked("Go on"),     marked("Start"),
                               marked("End the session"),  marked("Next case"), marked("Train this exercise"),
                               marked("Choose a case")};
    const bool inCurriculum = state.screen == Screen::result && !state.exercise.empty();
    return inCurriculum ? tr("What is next") : tr(words[static_cast<std::size_t>(state.screen)]);
}

Errand advance(State& state)
{
    switch (state.screen) {
        case Screen::cases:
            if (state.cases.empty()) {
                return Errand::none;
            }
            state.exercise.clear();
            state.test = false;  // that of the case before
            turnTo(state, Screen::devices);
            return Errand::checkDevices;
        case Screen::progress:
            return trainExercise(state, state.exerciseShown);
        case Screen::instructor:
            turnTo(state, Screen::cases);
            return Errand::none;
        case Screen::devices:
            turnTo(state, Screen::briefing);
            return Errand::none;
        case Screen::briefing:
            return state.running || state.trying || state.pushing ? Errand::none : Errand::startSession;
        case Screen::session:
            return state.running ? Errand::endSession : Errand::none;
        case Screen::result:
            break;
    }
    if (!state.exercise.empty()) {
        return showProgress(state);
    }
    // The next one in the list; from the last one back to the list's beginning.
    state.chosen = (state.chosen + 1) % std::max<std::size_t>(state.cases.size(), 1);
    turnTo(state, Screen::cases);
    return Errand::none;
}

Errand goBack(State& state)
{
    switch (state.screen) {
        case Screen::cases:
            return leave(state);
        case Screen::devices:
        case Screen::result:
        case Screen::progress:
        case Screen::instructor:
            turnTo(state, Screen::cases);
            return Errand::none;
        case Screen::briefing:
            turnTo(state, Screen::devices);
            return Errand::none;
        case Screen::session:
            break;
    }
    return state.running ? Errand::endSession : Errand::none;
}

Errand leave(State& state)
{
    std::string lost;
    const auto add = [&lost](bool now, const char* what) {
        lost += now ? (lost.empty() ? "" : "\n") + std::string(what) : "";
    };
    add(state.running, tr("A session still runs: end it first, or close again to break it off."));
    add(state.filming, tr("A film is still being made: wait for it, or close again to lose it."));
    add(!state.instructor.drafts.empty(), tr("There are notes that are not kept yet (Instructor, Sessions that were kept). "
                                             "Close again to lose them."));
    if (state.leaving || lost.empty()) {
        return Errand::quit;
    }
    state.leaving = true;
    state.notice = lost;
    return Errand::none;
}

Errand again(State& state)
{
    if (state.screen == Screen::result) {
        turnTo(state, Screen::briefing);
    }
    return Errand::none;
}

Errand debrief(State& state, std::optional<double> at)
{
    state.from = at;
    return state.screen == Screen::result && state.result.problem.empty() && !state.replaying ? Errand::startDebrief
                                                                                              : Errand::none;
}

bool listensToGrip(const State& state) noexcept
{
    const bool taken =
        state.running || state.trying || state.pushing || (state.screen == Screen::devices && !state.devices.done);
    return state.listening && !taken && state.screen != Screen::session;
}

PersonEntry* chosenPerson(State& state) noexcept
{
    const auto at = std::ranges::find(state.people, state.person, &PersonEntry::name);
    return at == state.people.end() ? nullptr : &*at;
}

Errand showProgress(State& state)
{
    if (chosenPerson(state) == nullptr || state.running) {
        return Errand::none;
    }
    turnTo(state, Screen::progress);
    state.exerciseShown = state.curveShown = 0;
    return Errand::choosePerson;
}

void progressLoaded(State& state, Progress progress)
{
    const bool first = state.exerciseShown == 0;
    state.progress = std::move(progress);
    const std::size_t count = state.progress.exercises.size();
    state.exerciseShown =
        first ? state.progress.next().value_or(0) : std::min(state.exerciseShown, std::max<std::size_t>(count, 1) - 1);
    state.curveShown = 0;
}

Errand trainExercise(State& state, std::size_t exercise)
{
    if (exercise >= state.progress.exercises.size() || state.running) {
        return Errand::none;
    }
    const ExerciseEntry& e = state.progress.exercises[exercise];
    const auto at = std::ranges::find(state.cases, e.caseId, &CaseEntry::id);
    if (e.standing == ExerciseEntry::Standing::locked || at == state.cases.end()) {
        state.notice = reasonFor(e);
        return Errand::none;
    }
    state.chosen = static_cast<std::size_t>(at - state.cases.begin());
    state.exercise = e.curriculum + "/" + e.id;
    state.test = e.test;
    turnTo(state, Screen::devices);
    return Errand::checkDevices;
}

Errand showInstructor(State& state)
{
    if (state.running) {
        return Errand::none;
    }
    turnTo(state, Screen::instructor);
    return Errand::loadEverybody;
}

void chooseKept(State& state, std::size_t session)
{
    Instructor& i = state.instructor;
    if (session < i.everybody.sessions.size()) {
        i.chosen = session;
        i.note = i.everybody.sessions[session].note;
        i.rating = i.everybody.sessions[session].rating;
        const KeptSession& s = i.everybody.sessions[session];
        if (const auto draft = i.drafts.find({s.name, s.number}); draft != i.drafts.end()) {
            std::tie(i.note, i.rating) = draft->second;
        }
    }
}

void noteTyped(State& state)
{
    Instructor& i = state.instructor;
    if (i.chosen >= i.everybody.sessions.size()) {
        return;
    }
    const KeptSession& s = i.everybody.sessions[i.chosen];
    if (i.note != s.note || i.rating != s.rating) {
        i.drafts[{s.name, s.number}] = {i.note, i.rating};
    } else {
        i.drafts.erase({s.name, s.number});
    }
}

void noteKept(State& state)
{
    Instructor& i = state.instructor;
    assert(i.chosen < i.everybody.sessions.size());
    KeptSession& s = i.everybody.sessions[i.chosen];
    s.note = i.note;
    s.rating = i.rating;
    noteTyped(state);
}

void casesListed(State& state, std::vector<CaseEntry> cases)
{
    const std::string id = state.cases.empty() ? "" : chosenCase(state).id;
    state.cases = std::move(cases);
    const auto at = std::ranges::find(state.cases, id, &CaseEntry::id);
    state.chosen = at != state.cases.end() ? static_cast<std::size_t>(at - state.cases.begin()) : 0;
}

void peopleListed(State& state, std::vector<PersonEntry> people)
{
    state.people = std::move(people);
    state.person = chosenPerson(state) == nullptr ? "" : state.person;
    Instructor& i = state.instructor;
    const auto isGone = [&](const auto& member) {
        return std::ranges::find(state.people, member.first, &PersonEntry::name) == state.people.end();
    };
    if (std::erase_if(i.groups, isGone) > 0) {
        i.comparison = {};
    }
}

void everybodyLoaded(State& state, Progress everybody)
{
    Instructor& i = state.instructor;
    std::ranges::stable_sort(everybody.sessions, std::greater(), &KeptSession::started);
    const auto before = std::exchange(i.everybody, std::move(everybody)).sessions;
    const auto& sessions = i.everybody.sessions;
    // By name and number: other sessions may have ended meanwhile.
    const auto same = [&](const KeptSession& s) {
        return i.chosen < before.size() && s.name == before[i.chosen].name && s.number == before[i.chosen].number;
    };
    const auto at = static_cast<std::size_t>(std::ranges::find_if(sessions, same) - sessions.begin());
    chooseKept(state, at < sessions.size() ? at : std::min(i.chosen, std::max<std::size_t>(sessions.size(), 1) - 1));
}

bool hasDraft(const Instructor& instructor, const KeptSession& session)
{
    return instructor.drafts.contains({session.name, session.number});
}

int groupOf(const Instructor& instructor, const std::string& person)
{
    const auto of = instructor.groups.find(person);
    return of != instructor.groups.end() ? of->second : 0;
}

void putIntoGroup(State& state, const std::string& person, int group)
{
    Instructor& i = state.instructor;
    if (groupOf(i, person) == group) {
        return;
    }
    i.comparison = {};
    i.groups[person] = group;
    std::erase_if(i.groups, [](const auto& member) { return member.second == 0; });
}

void compareCase(State& state, const std::string& caseId)
{
    if (std::exchange(state.instructor.caseId, caseId) != caseId) {
        state.instructor.comparison = {};
    }
}

void sessionStarted(State& state, SessionFiles files, std::string command)
{
    state.files = std::move(files);
    state.command = std::move(command);
    state.result = {};
    state.notice = littleRoom(state.files.record.parent_path());
    state.told.clear();
    state.running = true;
    state.leaving = false;
    state.screen = Screen::session;
}

void sessionEnded(State& state, Result result)
{
    state.running = state.leaving = false;
    state.notice.clear();
    state.told.clear();
    state.result = std::move(result);
    state.screen = Screen::result;
    const bool counts = state.result.problem.empty() && (state.person.empty() || !state.result.notKept);
    if (counts && !state.cases.empty()) {
        auto& best = state.cases[std::min(state.chosen, state.cases.size() - 1)].best;
        best = std::max(best.value_or(0), state.result.total);
        // The list of cases takes the best from the figures of who trains, which are read again with the progress.
        KeptSession kept;
        kept.caseId = chosenCase(state).id;
        kept.total = state.result.total;
        state.progress.sessions.push_back(std::move(kept));
    }
}

std::vector<std::string> trainArguments(const State& state, const SessionFiles& files)
{
    Words words{{"train"}};
    words.add(state.exercise.empty(), {"--case", chosenCase(state).id});
    words.add(!state.exercise.empty(), {"--exercise", state.exercise});
    words.add(!state.person.empty(), {"--profile", state.person});
    words.addDevice(state);
    words.add(true, {"--view", "--close-at-end"});
    words.addLook(state);
    words.add(state.test, {"--test"});
    words.add(true, {"--record", files.record.string(), "--json", files.figures.string()});
    return words;
}

std::vector<std::string> comparisonArguments(const State& state)
{
    Words words{{"progress"}};
    for (int group = 1; group <= 2; ++group) {
        const std::size_t before = words.size();
        for (const auto& [name, of] : state.instructor.groups) {
            words.add(of == group,
                      {"--group", said(tr("group {}"), group) + "=" + name});  // one by one: a name may have a comma
        }
        if (words.size() == before) {
            return {};
        }
    }
    words.add(!state.instructor.caseId.empty(), {"--case", state.instructor.caseId});
    return words;
}

std::string titleOption(const std::string& title)
{
    return "--title=" + title;
}

std::vector<std::string> debriefArguments(const State& state)
{
    Words words{{"--replay", state.files.record.string(), titleOption(chosenCase(state).title), "--layout", "trainee",
                 "--images", base::imagesBeside(state.files.record).string()}};
    words.addLook(state);
    words.add(state.from.has_value(), {"--at", fmt::format("{:.2f}", state.from.value_or(0))});
    words.add(!state.ghost.empty(), {"--ghost", state.ghost.string()});
    return words;
}

std::vector<std::string> tryoutArguments(const State& state)
{
    Words words{{"train", "--tryout"}};
    words.addDevice(state);
    const auto person = std::ranges::find(state.people, state.person, &PersonEntry::name);
    words.add(person != state.people.end() && person->leftHanded, {"--hand", "left"});
    words.addLook(state);
    return words;
}

std::vector<std::string> expertArguments(const State& state, const std::filesystem::path& record)
{
    return {"train", "--case", chosenCase(state).id, "--trainee", "expert", "--unpaced", "--record", record.string()};
}

std::string asTyped(const std::string& program, const std::vector<std::string>& arguments)
{
    std::string line = program;
    for (const std::string& word : arguments) {
        line += " " + base::shellWord(word);
    }
    return line;
}

}  // namespace palpate::trainer
