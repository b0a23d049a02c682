#pragma once

#include <trainer/case_entry.h>
#include <trainer/instructor.h>
#include <trainer/progress.h>
#include <trainer/settings.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace palpate::trainer {

enum class Screen { cases, devices, briefing, session, result, progress, instructor };

/// "Case", "Device", "Briefing", "Session", "Result", "Progress", "Instructor", in the user's language.
const char* nameOf(Screen screen) noexcept;

/// What was found of devices, in words.
struct DeviceCheck {
    bool done = false;
    bool falconReady = false;
    std::string falcon;  // what was found
    std::string remedy;  // what to do about it; empty: nothing
    std::string push;    // what came of the force test; empty: there was none
    bool pushed = false;
};

struct PartOfScore {
    std::string name;
    double points = 0, most = 0;
};

struct LossOfPoints {
    double points = 0;
    std::string words;
    std::optional<double> at;  // its moment in the session [s]; nothing: at no one moment
};

/// What a session came to, or why it did not.
struct Result {
    std::string problem;     // not empty: the session failed, and there is no score
    std::string fault;       // what else went wrong, e.g. with the record; empty: nothing
    bool notKept = false;    // and so the session is not in the person's profile
    bool untouched = false;  // and that is why: the tool never touched the body
    double total = 0;        // of 100
    std::vector<PartOfScore> parts;
    std::vector<LossOfPoints> losses;                           // the largest first
    std::vector<std::pair<std::string, std::string>> measures;  // label, value with unit
};

/// Where a session's files are.
struct SessionFiles {
    std::filesystem::path record, figures;
};

/// What an instructor looks at.
enum class InstructorPage { live, sessions, groups };

struct Instructor {
    InstructorPage page = InstructorPage::live;
    std::vector<LiveSession> live;
    // A session that a viewer is to be opened on, and its heading.
    std::string watched, watchedTitle;
    Progress everybody;      // sessions of all profiles
    std::size_t chosen = 0;  // of everybody.sessions
    std::string note;        // of the chosen one, as it is typed
    int rating = 0;          // 1 to 5; 0: none
    // Notes and ratings that were typed and not kept yet, by name and number of their session.
    std::map<std::pair<std::string, std::int64_t>, std::pair<std::string, int>> drafts;
    std::map<std::string, int> groups;  // 1 or 2, by name; who is in none is not in it
    std::string caseId;                 // only sessions of this case are compared; empty: all
    bool asPage = false;                // the comparison is wanted as a page, too
    Comparison comparison;
};

/// Everything that the window shows. The functions below are all that changes its screen; drawing changes nothing but the
/// choices.
struct State {
    Screen screen = Screen::cases;
    std::vector<CaseEntry> cases;
    std::size_t chosen = 0;
    std::vector<PersonEntry> people;  // profiles
    std::string person;               // whose session it is; empty: nobody's
    std::string newPerson;            // a name that is being typed
    Progress progress;                // of that person
    std::size_t exerciseShown = 0;    // of progress.exercises
    std::size_t curveShown = 0;       // of its curves
    std::string exercise;             // that the session is of, "CURRICULUM/EXERCISE"; empty: none
    Instructor instructor;
    DeviceCheck devices;
    bool listening = false;  // keys go to this window, and so do the buttons of a device
    bool gripReady = false;  // there is a device whose buttons work this window
    bool useFalcon = false;  // else the mouse
    std::string firmware;    // of the Falcon, a file
    bool test = false;       // without hints
    SessionFiles files;      // of the last session
    std::string command;     // that runs, or ran last, as one would type it
    bool running = false;    // a session is going on
    bool trying = false;     // the hand is being tried
    bool pushing = false;    // the force test is going on
    Result result;
    bool replaying = false;       // the debrief is open
    std::optional<double> from;   // where it begins [s]
    std::filesystem::path ghost;  // record of an expert that is shown beside it; empty: none
    bool filming = false;         // a film of the session is being made
    bool ghosting = false;        // an expert's session is being made
    std::string notice;           // something that went wrong outside a session
    std::string told;             // what an errand has come to, or that it is at work
    bool popup = false;           // something lies over the screen
    bool leaving = false;         // it was said what would be lost
    Settings settings;
};

/// What has to be done outside the window.
enum class Errand {
    none,
    addPerson,
    choosePerson,
    changeHand,
    writeProgress,
    loadEverybody,
    watchSession,
    seeKept,
    keepNote,
    compareGroups,
    checkDevices,
    testForce,
    tryHand,
    startSession,
    endSession,
    startDebrief,
    seeExpert,
    makeFilm,
    keepSettings,
    quit
};

/// The screen's main button. @returns  what has to be done for it
Errand advance(State& state);
/// Back to the screen before; quits from the first.
Errand goBack(State& state);
/// The window is to close. Quits, but for the first time that something would be lost with it: the notice says what.
Errand leave(State& state);
/// Result screen: the same case again.
Errand again(State& state);
/// Result screen: replay of the session, from the beginning or from the moment of a loss of points.
Errand debrief(State& state, std::optional<double> at = std::nullopt);

/// Whether buttons of a device work the window now: nobody else has the device, and keys go to the window.
bool listensToGrip(const State& state) noexcept;

/// Where somebody stands. Nothing where nobody is chosen.
Errand showProgress(State& state);
/// Progress screen: an exercise, with its case, begins. Nothing for one whose gate is shut.
Errand trainExercise(State& state, std::size_t exercise);
Errand showInstructor(State& state);
/// Instructor's screen: a session that was kept, its note and rating, or what was typed in their place and not kept yet.
void chooseKept(State& state, std::size_t session);
/// Instructor's screen: note or rating of the chosen session may have changed. Until it is kept it stays, whatever else is
/// chosen.
void noteTyped(State& state);
/// Instructor's screen: note and rating of the chosen session, as they were typed, are kept.
/// @pre  there is one
void noteKept(State& state);
/// What `palpate case list` has said. The chosen case stays chosen.
void casesListed(State& state, std::vector<CaseEntry> cases);
/// What `palpate profile list` has said. Whoever is in a group and has no profile any more leaves it, and a comparison
/// goes.
void peopleListed(State& state, std::vector<PersonEntry> people);
/// What `palpate progress --all` has learnt, the newest session first. The chosen session stays chosen.
void everybodyLoaded(State& state, Progress everybody);
/// Whether something that was typed for this session is not kept yet.
bool hasDraft(const Instructor& instructor, const KeptSession& session);
/// Instructor's screen: the group (1 or 2) that a person is in; 0: none.
int groupOf(const Instructor& instructor, const std::string& person);
/// A person goes into a group (1 or 2), or into none (0). A comparison of other groups goes.
void putIntoGroup(State& state, const std::string& person, int group);
/// Instructor's screen: only sessions of this case are compared; empty: all. A comparison of others goes.
void compareCase(State& state, const std::string& caseId);
/// What `palpate progress` has learnt of the person.
void progressLoaded(State& state, Progress progress);
/// Null where nobody is chosen.
PersonEntry* chosenPerson(State& state) noexcept;

void sessionStarted(State& state, SessionFiles files, std::string command);
/// The best score of the case follows.
void sessionEnded(State& state, Result result);

const CaseEntry& chosenCase(const State& state);
/// Of the chosen case, for what will be held.
std::vector<std::string> stepsOf(const State& state);
/// What the main button of the screen says.
const char* mainButton(const State& state) noexcept;

/// `palpate train ...` for the chosen case.
std::vector<std::string> trainArguments(const State& state, const SessionFiles& files);
/// `palpate progress --group ...` for the groups that the instructor has made; empty where one of them has nobody.
std::vector<std::string> comparisonArguments(const State& state);
/// Of palpate-view: what its picture is called.
std::string titleOption(const std::string& title);
/// `palpate-view --replay ...` for the last session.
std::vector<std::string> debriefArguments(const State& state);
/// `palpate train --tryout`.
std::vector<std::string> tryoutArguments(const State& state);
/// `palpate train` by a simulated expert in the anatomy of the chosen case.
std::vector<std::string> expertArguments(const State& state, const std::filesystem::path& record);
/// Words as one would type them in a shell.
std::string asTyped(const std::string& program, const std::vector<std::string>& arguments);

}  // namespace palpate::trainer
