#include <trainer/errands.h>

#include <base/outputs.h>
#include <base/said.h>
#include <base/temporary_folder.h>
#include <base/user_files.h>
#include <base/words.h>
#include <trainer/commands.h>
#include <trainer/film.h>
#include <trainer/lists.h>
#include <trainer/pages.h>
#include <trainer/running.h>

#include <algorithm>
#include <list>
#include <map>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

namespace palpate::trainer {

namespace fs = std::filesystem;
using base::said, base::tr;

struct Errands::Impl {
    Impl(fs::path where, ResultSink& to) : programs(std::move(where)), sink(to) {}

    void start(std::optional<Running>& one, const std::string& log, const std::vector<std::string>& words,
               const char* program = "palpate")
    {
        one.emplace(programs / program, words, scratch / (log + ".log"));
    }
    static const char* opening() { return tr("It opens in a window of its own. That may take some seconds."); }
    void startSession(State& state)
    {
        grip.letGo();
        const SessionFiles files = sink.filesFor(chosenCase(state));
        const auto arguments = trainArguments(state, files);
        start(session, "session", arguments);
        ending = false;
        sessionStarted(state, files, asTyped("palpate", arguments));
    }
    // Once: what comes after its end, the profile and the figures, is not to be broken off.
    void endSession(State&)
    {
        if (session && !std::exchange(ending, true)) {
            session->conclude();
        }
    }
    void debriefAlone(State& state)
    {
        state.ghost.clear();
        startDebrief(state);
    }
    void startDebrief(State& state)
    {
        const auto arguments = debriefArguments(state);
        start(replay, "replay", arguments, "palpate-view");
        state.command = asTyped("palpate-view", arguments);
        state.notice.clear();
        state.replaying = true;
    }
    // The body of a case may have changed since its expert's session was made: the next one is new.
    static void forgetExpert(State& state)
    {
        std::error_code none;
        fs::remove(std::exchange(state.ghost, {}), none);
    }
    void listPeople(State& state)
    {
        const auto answer = commands.answer({"profile", "list"}, state.notice);
        if (answer.is_discarded()) {
            state.notice = aboutProfiles(state.notice);
            return;  // who was there stays
        }
        peopleListed(state, peopleOf(answer));
    }
    // What there was stays where the command fails.
    void listCases(State& state)
    {
        if (const auto answer = commands.answer({"case", "list"}, state.notice); !answer.is_discarded()) {
            casesListed(state, casesOf(answer));
            showBest(state);
        }
    }
    // Of who trains, or of the folder's sessions.
    void showBest(State& state)
    {
        for (CaseEntry& c : state.cases) {
            c.best = state.person.empty() ? sink.best(c) : state.progress.best(c.id);
        }
    }
    void listCurricula(State& state)
    {
        if (const auto answer = commands.answer({"curriculum", "list"}, state.notice); !answer.is_discarded()) {
            curricula.clear();
            each(answer, "curricula",
                 [this](const auto& one) { curricula.push_back(one.at("id").template get<std::string>()); });
        }
    }
    std::vector<std::string> progressWords(const std::string& whose) const
    {
        std::vector<std::string> words{"progress", whose};
        for (const std::string& id : curricula) {
            words.insert(words.end(), {"--curriculum", id});
        }
        return words;
    }
    // The curve of who trains, and the best scores.
    void choosePerson(State& state)
    {
        progressLoaded(state, state.person.empty()
                                  ? Progress()
                                  : progressIn(commands.answer(progressWords(state.person), state.notice)));
        if (state.settings.person != state.person) {
            state.settings.person = state.person;
            state.notice = writeSettings(base::trainerSettings(), state.settings);
        }
        showBest(state);
    }
    // What there is may change outside: cases and curricula are listed again where a screen that shows them is entered,
    // people whenever their file changes.
    bool lookAtLists(State& state)
    {
        const bool entered = std::exchange(listedAt, state.screen) != state.screen;
        const bool shows =
            state.screen == Screen::cases || state.screen == Screen::progress || state.screen == Screen::instructor;
        if (entered && shows) {
            listCases(state);
            const auto before = curricula;
            listCurricula(state);
            curricula != before ? choosePerson(state) : void();
        }
        const auto now = writtenAt(profilesFile());
        const bool others = !state.running && std::exchange(profilesRead, now) != now;
        others ? listPeopleAgain(state) : void();
        return others || (entered && shows);
    }
    void listPeopleAgain(State& state)
    {
        const std::string before = state.person;
        state.screen == Screen::instructor ? loadEverybody(state) : listPeople(state);
        if (state.person != before) {
            choosePerson(state);
            state.screen == Screen::progress ? static_cast<void>(goBack(state)) : void();
            // Of a session without a record nothing can be seen again.
            state.screen == Screen::result ? static_cast<void>(dropErased(state.files, state.result, false)) : void();
        }
    }
    void changeHand(State& state)
    {
        if (const PersonEntry* const person = chosenPerson(state)) {
            commands.did({"profile", "hand", person->name, person->leftHanded ? "left" : "right"}, state.notice);
        }
        listPeople(state);
    }
    fs::path output(const std::string& name)
    {
        base::makeFolders(sink.folder());
        return sink.folder() / base::plainName(name);
    }
    void writeProgress(State& state)
    {
        if (!pages.busy()) {
            pages.write(programs, progressWords(state.person), output(base::progressPages(state.person)),
                        scratch / "pages.log");
        }
        state.notice.clear();
        state.told = tr("Page, table and xAPI statements are being written ...");
    }
    void loadEverybody(State& state)
    {
        listPeople(state);
        const auto answer = state.people.empty() ? nlohmann::json() : commands.answer({"progress", "--all"}, state.notice);
        everybodyLoaded(state, answer.is_discarded() ? state.instructor.everybody : progressIn(answer));
    }
    void watchSession(State& state) { watch(state, "--session"); }
    void seeKept(State& state) { watch(state, "--replay"); }
    void watch(State& state, const char* what)
    {
        const Instructor& i = state.instructor;
        const std::vector<std::string> words{what,       i.watched,    titleOption(i.watchedTitle),          "--watch",
                                             "--layout", "instructor", "--palette=" + state.settings.palette};
        eyes.emplace_back(programs / "palpate-view", words, scratch / ("watch-" + std::to_string(++watched) + ".log"));
        state.told = opening();
    }
    void keepNote(State& state)
    {
        const Instructor& i = state.instructor;
        if (i.chosen < i.everybody.sessions.size()) {
            const KeptSession& s = i.everybody.sessions[i.chosen];
            if (commands.did({"profile", "note", s.name, std::to_string(s.number), "--text=" + i.note, "--rating",
                              std::to_string(i.rating)},
                             state.notice)) {
                noteKept(state);
                loadEverybody(state);
            }
        }
    }
    void compareGroups(State& state)
    {
        std::vector<std::string> words = comparisonArguments(state);
        if (words.empty()) {
            state.notice = tr("Put somebody into each of the two groups.");
            return;
        }
        const fs::path page = freshFile(output("groups"), ".html");
        if (state.instructor.asPage) {
            words.insert(words.end(), {"--html", page.string()});
        }
        state.notice.clear();
        state.instructor.comparison = comparisonIn(commands.answer(words, state.notice));
        if (state.instructor.asPage && state.notice.empty()) {
            state.told = said(tr("Written to {}"), page.string());
            openPage(page);
        }
    }
    // Looks at the sessions that run as long as somebody looks at them.
    bool lookAtLive(State& state)
    {
        if (state.screen != Screen::instructor || state.instructor.page != InstructorPage::live) {
            live.reset();
            state.instructor.live.clear();
            return false;
        }
        const fs::path file = scratch / "live.json";
        std::error_code none;
        if (!live || live->ended()) {
            fs::remove(file, none);
            start(live, "live", {"sessions", "--every", "0.5", "--json", file});
        }
        if (const auto written = fs::last_write_time(file, none); !none && written != liveRead) {
            liveRead = written;
            state.instructor.live = liveIn(parsed(file));
            return true;
        }
        return false;
    }
    void addPerson(State& state)
    {
        const std::string name = state.newPerson;
        commands.did({"profile", "new", "--", name}, state.notice);
        state.notice = aboutProfiles(state.notice);
        listPeople(state);
        if (std::ranges::find(state.people, name, &PersonEntry::name) != state.people.end()) {
            state.person = name;
            state.newPerson.clear();
            choosePerson(state);
        }
    }
    void checkDevices(State& state)
    {
        state.devices = {};
        grip.letGo();
        fs::remove(scratch / "devices.json");
        start(devices, "devices", {"devices", "--json", scratch / "devices.json"});
    }

    void testForce(State& state)
    {
        grip.letGo();
        fs::remove(scratch / "force.json");
        std::vector<std::string> words{"devices", "--force-test", "--json", scratch / "force.json"};
        if (!state.firmware.empty()) {
            words.insert(words.end(), {"--falcon-firmware", state.firmware});
        }
        start(push, "force", words);
        state.pushing = true;
    }
    void tryHand(State& state)
    {
        grip.letGo();
        start(tryout, "tryout", tryoutArguments(state));
        state.trying = true;
    }
    // An expert's session in the anatomy of the case is made once, and kept beside the others.
    void seeExpert(State& state)
    {
        const fs::path record = state.files.record.parent_path() / ("expert-" + chosenCase(state).id + ".db");
        if (fs::exists(record)) {
            state.ghost = record;
            return startDebrief(state);
        }
        const fs::path part = record.string() + ".part";
        fs::remove(part);
        start(expert, "expert", expertArguments(state, part));
        expertOf = record;
        besideExpert = state.files.record;
        state.ghosting = true;
    }
    void makeFilm(State& state)
    {
        film.make(programs, state.files.record, titleOption(chosenCase(state).title), scratch / "film.log");
        state.filming = true;
        state.leaving = false;  // there is more to lose now
    }
    void keepSettings(State& state)
    {
        base::useLanguage(state.settings.language);
        state.notice = writeSettings(base::trainerSettings(), state.settings);
    }

    // Hears a device's buttons as long as they work the window. The file of a firmware is taken once it is typed.
    bool lookAtGrip(State& state)
    {
        if (listensToGrip(state) && !devices) {
            firmware = state.screen == Screen::devices ? firmware : state.firmware;
            grip.listen(firmware);
        } else {
            grip.letGo();
        }
        const bool before = std::exchange(state.gripReady, grip.ready());
        return state.gripReady != before;
    }

    bool lookAtDevices(State& state)
    {
        if (!devices || !devices->ended()) {
            return false;
        }
        devices.reset();
        state.devices = readDevices(scratch / "devices.json");
        state.useFalcon = state.useFalcon && state.devices.falconReady;
        return true;
    }

    bool lookAtSession(State& state)
    {
        if (!session || !session->ended()) {
            return false;
        }
        Result result = readResult(state.files.figures);
        const bool scored = result.problem.empty();
        if (!scored) {
            result.problem = session->message().empty() || result.untouched ? result.problem : session->message();
        } else {
            result.fault = result.fault.empty() && session->failed() ? session->message() : result.fault;
        }
        session.reset();
        const bool left = state.person.empty() || !dropErased(state.files, result);
        sessionEnded(state, result);  // also where it cannot be kept
        if (scored && left) {
            sink.keep(chosenCase(state), state.files, result);
        }
        return true;
    }

    bool lookAtReplay(State& state)
    {
        if (!replay || !replay->ended()) {
            return false;
        }
        if (replay->failed()) {
            state.notice = replay->message();
            forgetExpert(state);
        }
        replay.reset();
        state.replaying = false;
        return true;
    }

    void takeExpert(State& state)
    {
        const bool failed = expert->failed();
        state.notice = failed ? expert->message() : "";
        state.ghosting = false;
        expert.reset();
        std::error_code gone;
        if (!failed) {
            fs::rename(expertOf.string() + ".part", expertOf, gone);
            state.notice = gone ? expertOf.string() + ": " + gone.message() : "";
        }
        // Whoever has gone on in the meantime did not ask for this any more.
        if (!failed && !gone && state.screen == Screen::result && state.files.record == besideExpert && !replay) {
            state.ghost = expertOf;
            startDebrief(state);
        }
    }

    // What has ended of all that is beside a session.
    bool lookAtHelpers(State& state)
    {
        bool changed = false;
        const auto over = [&changed](std::optional<Running>& one) {
            const bool ended = one && one->ended();
            changed = changed || ended;
            return ended;
        };
        if (over(push)) {
            push.reset();
            state.pushing = false;
            readForceTest(scratch / "force.json", state.devices);
        }
        if (over(tryout)) {
            state.notice = tryout->failed() ? tryout->message() : "";
            tryout.reset();
            state.trying = false;
        }
        if (over(expert)) {
            takeExpert(state);
        }
        eyes.remove_if([&](Running& one) {
            const bool ended = one.ended();
            if (ended) {
                state.notice = one.failed() ? one.message() : state.notice;
                state.told = state.told == opening() ? "" : state.told;
            }
            changed = changed || ended;
            return ended;
        });
        if (film.ended()) {
            state.leaving ? state.notice.clear() : void();  // it was said what would be lost
            film.take(state.told, state.notice);
            state.filming = state.leaving = false;
            changed = true;
        }
        if (pages.ended()) {
            state.told.clear();
            pages.take(state.told, state.notice);
            changed = true;
        }
        return changed;
    }

    fs::path expertOf, besideExpert;  // record of the expert that is made, and of the session that it is for
    fs::path programs;
    const base::TemporaryFolder scratch{tr("what the commands print")};  // goes after those that run
    const Commands commands{programs, scratch.path()};
    ResultSink& sink;
    std::vector<std::string> curricula;                           // that there are
    Screen listedAt = Screen::cases;                              // when cases were last listed
    fs::file_time_type profilesRead = writtenAt(profilesFile());  // when the people were
    std::optional<Running> session, devices, replay, push, tryout, expert, live;
    Film film;
    Pages pages;
    bool ending = false;  // the session was told to end
    fs::file_time_type liveRead;
    std::list<Running> eyes;  // viewers of the instructor
    int watched = 0;          // how many there were
    Grip grip{programs, scratch / "grip.log"};
    std::string firmware;  // that the grip was last listened to with
};

Errands::Errands(fs::path programs, ResultSink& sink) : impl_(std::make_unique<Impl>(std::move(programs), sink)) {}

Errands::~Errands() = default;

void Errands::list(State& state)
{
    try {
        impl_->profilesRead = writtenAt(profilesFile());
        impl_->listCases(state);
        state.person = state.settings.person;
        impl_->listPeople(state);
        impl_->listCurricula(state);
        impl_->choosePerson(state);
        const std::string why = whyNoSessions(impl_->sink.folder()) + littleRoom(impl_->sink.folder());
        state.notice += (state.notice.empty() || why.empty() ? "" : "\n") + why;
    } catch (const std::exception& e) {
        state.notice = e.what();
    }
}

void Errands::run(Errand errand, State& state)
{
    using Do = void (Impl::*)(State&);
    static const std::map<Errand, Do> all{{Errand::addPerson, &Impl::addPerson},
                                          {Errand::choosePerson, &Impl::choosePerson},
                                          {Errand::changeHand, &Impl::changeHand},
                                          {Errand::writeProgress, &Impl::writeProgress},
                                          {Errand::loadEverybody, &Impl::loadEverybody},
                                          {Errand::watchSession, &Impl::watchSession},
                                          {Errand::seeKept, &Impl::seeKept},
                                          {Errand::keepNote, &Impl::keepNote},
                                          {Errand::compareGroups, &Impl::compareGroups},
                                          {Errand::checkDevices, &Impl::checkDevices},
                                          {Errand::startSession, &Impl::startSession},
                                          {Errand::endSession, &Impl::endSession},
                                          {Errand::testForce, &Impl::testForce},
                                          {Errand::tryHand, &Impl::tryHand},
                                          {Errand::seeExpert, &Impl::seeExpert},
                                          {Errand::makeFilm, &Impl::makeFilm},
                                          {Errand::keepSettings, &Impl::keepSettings},
                                          {Errand::startDebrief, &Impl::debriefAlone}};
    try {
        if (const auto at = all.find(errand); at != all.end()) {
            state.told.clear();
            ((*impl_).*at->second)(state);
        }
        errand == Errand::keepSettings ? list(state) : void();
    } catch (const std::exception& e) {
        state.notice = e.what();
    }
}

std::vector<Press> Errands::pressed()
{
    return impl_->grip.heard();
}

bool Errands::look(State& state)
{
    using Look = bool (Impl::*)(State&);
    bool changed = false;
    for (const Look part : {&Impl::lookAtLists, &Impl::lookAtDevices, &Impl::lookAtSession, &Impl::lookAtHelpers,
                            &Impl::lookAtLive, &Impl::lookAtGrip, &Impl::lookAtReplay}) {
        try {
            changed = ((*impl_).*part)(state) || changed;
        } catch (const std::exception& e) {
            // A session that runs goes on.
            changed = changed || state.notice != e.what();
            state.notice = e.what();
        }
    }
    return changed;
}

}  // namespace palpate::trainer
