#include <tests/folder.h>
#include <trainer/errands.h>
#include <trainer/pages.h>

#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <regex>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <tuple>

namespace palpate::trainer {
using tests::Folder;

namespace {

void makeScript(const std::filesystem::path& file, const std::string& lines)
{
    std::ofstream(file) << "#!/bin/sh\n" << lines << "\n";
    std::filesystem::permissions(file, std::filesystem::perms::owner_all);
}

// A program that prints a line, and ends with this status.
void makeProgram(const std::filesystem::path& file, const std::string& line, int status)
{
    makeScript(file, "echo '" + line + "' >&2\nexit " + std::to_string(status));
}

// As the window does it, until this holds.
void lookUntil(Errands& errands, State& state, const std::function<bool()>& holds)
{
    for (int i = 0; !holds() && i < 1000; ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        errands.look(state);
    }
    EXPECT_TRUE(holds());
}

CaseEntry caseCalled(const std::string& id)
{
    CaseEntry c;
    c.id = id;
    return c;
}

// The debrief's window cannot say itself why it did not open.
TEST(Errands, AReplayThatFailedSaysWhy)
{
    const Folder folder;
    SessionFolder sink(folder / "sessions");
    Errands errands(folder.path(), sink);
    State state;
    state.cases.emplace_back();
    const auto replay = [&](const std::string& line, int status) {
        makeProgram(folder / "palpate-view", line, status);
        errands.run(Errand::startDebrief, state);
        lookUntil(errands, state, [&] { return !state.replaying; });
        return state.notice;
    };
    const std::string why = "palpate-view: --ghost e.db: is a session in another body";
    EXPECT_EQ(replay(why, 1), why);
    EXPECT_EQ(replay("palpate-view: all is well", 0), "") << "and what was wrong before is gone";
}

// Erased between the viewer's last look at the record and the window's.
TEST(Errands, OfARecordThatIsErasedMeanwhileNoFilmIsKept)
{
    const Folder folder;
    SessionFolder sink(folder / "sessions");
    Errands errands(folder.path(), sink);
    State state;
    state.cases.emplace_back();
    state.files.record = folder / "s.db";
    const auto film = [&](const std::string& meanwhile) {
        std::ofstream(state.files.record) << "x";
        makeScript(folder / "palpate-view", meanwhile + "\nfor last; do :; done\necho x >\"$last\"");
        errands.run(Errand::makeFilm, state);
        lookUntil(errands, state, [&] { return !state.filming; });
        return std::filesystem::exists(folder / "s.mp4") || std::filesystem::exists(folder / "s.pictures");
    };
    EXPECT_TRUE(film("")) << state.notice;
    EXPECT_FALSE(film("rm \"$2\""));
    EXPECT_NE(state.notice.find("no film of it is kept"), std::string::npos) << state.notice;
    EXPECT_EQ(state.told, "");
}

// Where the home cannot be written, the first screen says it in the user's words, not in those of a command.
TEST(Errands, AHomeThatCannotBeWrittenIsSaidInWords)
{
    const Folder folder;
    std::ofstream(folder / "file") << "";
    makeScript(folder / "palpate",
               "if [ $1 = profile ]; then echo 'palpate: this folder cannot be made' >&2; exit 1; fi\n"
               "for file; do :; done; echo '{}' >\"$file\"");
    SessionFolder sink(folder / "file/palpate/sessions");
    Errands errands(folder.path(), sink);
    State state;
    const char* const before = std::getenv("XDG_DATA_HOME");
    const std::string kept = before != nullptr ? before : "";
    ::setenv("XDG_DATA_HOME", (folder / "file").c_str(), 1);
    errands.list(state);
    before != nullptr ? ::setenv("XDG_DATA_HOME", kept.c_str(), 1) : ::unsetenv("XDG_DATA_HOME");
    EXPECT_NE(state.notice.find("no profiles can be kept"), std::string::npos) << state.notice;
    EXPECT_NE(state.notice.find("--sessions"), std::string::npos) << state.notice;
}

// A command that fails, e.g. without space on the disk, takes nothing from the window.
TEST(Errands, WhatWasListedStaysWhereTheNextListFails)
{
    const Folder folder;
    const auto broken = [&](const std::string& command) { return folder.path() / ("broken-" + command); };
    makeScript(folder / "palpate", "cd '" + folder.path().string() + R"('
test -e broken-$1 && exit 1
test $1 = progress && echo "$@" > asked
for last; do :; done
echo '{"cases": [{"id": "a", "title": "A", "picture": "", "difficulty": 1, "trains": [], "measures": [], "briefing": []}],
       "profiles": [{"name": "ada", "hand": "left"}], "curricula": [{"id": "basics"}], "sessions": [{"name": "ada",
       "session": 1, "started": "", "case": "a", "scene": "", "record": "", "note": "", "rating": 0, "mode": "test",
       "measures": {}}]}' > "$last")");
    SessionFolder sink(folder / "sessions");
    Errands errands(folder.path(), sink);
    State state;
    state.settings.person = "ada";
    const auto isWhole = [&] {
        std::ifstream asked(folder / "asked");
        std::string words;
        std::getline(asked, words);
        EXPECT_NE(words.find("--curriculum basics"), std::string::npos) << words;
        EXPECT_EQ(state.cases.size(), 1U);
        EXPECT_EQ(state.people.size(), 1U);
        EXPECT_EQ(state.instructor.everybody.sessions.size(), 1U);
    };
    errands.run(Errand::loadEverybody, state);
    errands.list(state);
    isWhole();
    for (const char* const command : {"case", "profile", "curriculum", "progress"}) {
        std::ofstream(broken(command)) << "\n";
        errands.run(Errand::loadEverybody, state);
        errands.list(state);
        isWhole();
        std::filesystem::remove(broken(command));
    }
}

// A case that was added while the window is open is there when the list is entered again, and the chosen one stays.
TEST(Errands, CasesAreListedAgainWhereTheyAreShown)
{
    const Folder folder;
    const auto offer = [&](const std::string& cases) {
        makeScript(folder / "palpate", "for last; do :; done\necho '{\"cases\": [" + cases + "]}' > \"$last\"");
    };
    const auto entry = [](const std::string& id) {
        return R"({"id": ")" + id +
               R"(", "title": "A", "picture": "", "difficulty": 1, "trains": [], "measures": [], "briefing": []})";
    };
    SessionFolder sink(folder / "sessions");
    Errands errands(folder.path(), sink);
    State state;
    offer(entry("b"));
    errands.list(state);
    ASSERT_EQ(state.cases.size(), 1U) << state.notice;
    offer(entry("a") + ", " + entry("b"));
    EXPECT_FALSE(errands.look(state)) << "nothing runs for a screen that stays";
    EXPECT_EQ(state.cases.size(), 1U);
    state.screen = Screen::result;
    errands.look(state);
    EXPECT_EQ(state.cases.size(), 1U);
    state.screen = Screen::cases;
    EXPECT_TRUE(errands.look(state));
    EXPECT_EQ(state.cases.size(), 2U);
    EXPECT_EQ(chosenCase(state).id, "b");
}

// Of somebody as of nobody: the list is entered after the session, and its figures were read before it.
TEST(Errands, TheBestOfASessionIsInTheListAtOnce)
{
    for (const char* const person : {"anna", ""}) {
        const Folder folder;
        makeScript(folder / "palpate", R"(for last; do :; done
if [ $1 = train ]; then while [ $1 != --record ]; do shift; done; echo > "$2"; fi
echo '{"cases": [{"id": "a", "title": "A", "picture": "", "difficulty": 1, "trains": [], "measures": [], "briefing": []}],
       "score": {"total": 71, "points": {"core": 50, "vital": 21, "technique": 0}}}' > "$last")");
        SessionFolder sink(folder / "sessions");
        Errands errands(folder.path(), sink);
        State state;
        state.cases = {caseCalled("a")};
        state.person = person;
        errands.run(Errand::startSession, state);
        lookUntil(errands, state, [&] { return !state.running; });
        errands.look(state);
        state.screen = Screen::cases;
        EXPECT_TRUE(errands.look(state));
        EXPECT_EQ(state.cases[0].best, 71.0) << person;
    }
}

// Somebody who was erased in a terminal is gone from the window, from its groups and from its curve.
TEST(Errands, WhoWasErasedElsewhereIsGone)
{
    const Folder folder;
    const char* const before = std::getenv("XDG_DATA_HOME");
    const std::string kept = before != nullptr ? before : "";
    ::setenv("XDG_DATA_HOME", folder.path().c_str(), 1);
    std::filesystem::create_directories(profilesFile().parent_path());
    std::ofstream(profilesFile()) << "1";
    const std::filesystem::path programs = folder / "programs";
    std::filesystem::create_directories(programs);
    const auto offer = [&](const std::string& people) {
        makeScript(programs / "palpate",
                   "test \"$2\" = --group && { echo 'palpate: ada: is not there' >&2; exit 1; }\n"
                   "for last; do :; done\necho '{\"profiles\": [" +
                       people + "]}' > \"$last\"");
    };
    const std::string ada = R"({"name": "ada", "hand": "left"})", bert = R"({"name": "bert", "hand": "left"})";
    SessionFolder sink(folder / "sessions");
    Errands errands(programs, sink);
    State state;
    state.settings.person = "ada";
    offer(ada + ", " + bert);
    errands.list(state);
    ASSERT_EQ(state.people.size(), 2U) << state.notice;
    ASSERT_EQ(state.person, "ada");
    putIntoGroup(state, "ada", 1);
    putIntoGroup(state, "bert", 2);
    errands.run(Errand::compareGroups, state);
    // The result of a session is shown; its record goes with the profile.
    state.files = {folder / "a.db", folder / "a.json"};
    std::ofstream(state.files.record) << "r";
    state.screen = Screen::result;
    ASSERT_EQ(debrief(state), Errand::startDebrief);
    EXPECT_EQ(state.notice, "That did not work:\npalpate: ada: is not there");
    errands.look(state);
    EXPECT_EQ(state.people.size(), 2U);
    offer(bert);
    std::filesystem::remove(state.files.record);
    std::filesystem::last_write_time(profilesFile(),
                                     std::filesystem::last_write_time(profilesFile()) + std::chrono::seconds(1));
    EXPECT_TRUE(errands.look(state));
    before != nullptr ? ::setenv("XDG_DATA_HOME", kept.c_str(), 1) : ::unsetenv("XDG_DATA_HOME");
    EXPECT_EQ(state.people.size(), 1U);
    EXPECT_EQ(state.person, "");
    EXPECT_EQ(groupOf(state.instructor, "ada"), 0);
    EXPECT_NE(state.result.problem.find("The profile was erased, and the record"), std::string::npos);
    EXPECT_EQ(debrief(state), Errand::none);
}

TEST(Errands, AKeptNoteIsNoDraftThoughANewerSessionHasEnded)
{
    const Folder folder;
    const std::string end = R"(, "case": "a", "scene": "", "record": "", "rating": 0, "mode": "test", "measures": {}})";
    const auto session = [&](const std::string& number, const std::string& note) {
        return R"({"name": "ada", "session": )" + number + R"(, "note": ")" + note + R"(", "started": ")" + number + "\"" +
               end;
    };
    const auto progress = [&](const std::string& sessions) {
        makeScript(folder / "palpate",
                   "for last; do :; done\ntest $2 = note || echo '{\"profiles\": [{\"name\": \"ada\", "
                   "\"hand\": \"left\"}], \"sessions\": [" +
                       sessions + "]}' > \"$last\"");
    };
    SessionFolder sink(folder / "sessions");
    Errands errands(folder.path(), sink);
    State state;
    progress(session("1", ""));
    errands.run(Errand::loadEverybody, state);
    ASSERT_EQ(state.instructor.everybody.sessions.size(), 1U) << state.notice;
    state.instructor.note = "look at the probe";
    noteTyped(state);
    progress(session("1", "look at the probe") + ", " + session("2", ""));
    errands.run(Errand::keepNote, state);
    EXPECT_TRUE(state.instructor.drafts.empty());
    EXPECT_EQ(state.instructor.everybody.sessions.at(state.instructor.chosen).number, 1);
    EXPECT_EQ(state.instructor.note, "look at the probe");
}

// The window goes on while they are written, and says where they are.
TEST(Errands, PagesAreWrittenBesideTheWindow)
{
    const Folder folder;
    makeScript(folder / "palpate", "while [ ! -e '" + (folder / "go").string() +
                                       "' ]; do sleep 0.01; done\necho \"$@\" >'" + (folder / "asked").string() + "'");
    SessionFolder sink(folder / "sessions");
    Errands errands(folder.path(), sink);
    State state;
    state.person = "ada";
    errands.run(Errand::writeProgress, state);
    EXPECT_EQ(state.told, "Page, table and xAPI statements are being written ...");
    EXPECT_FALSE(std::filesystem::exists(folder / "asked"));
    std::ofstream(folder / "go") << "";
    lookUntil(errands, state, [&] { return state.told.starts_with("Written to "); });
    EXPECT_NE(state.told.find("progress-ada"), std::string::npos) << state.told;
    EXPECT_EQ(state.notice, "");
    makeProgram(folder / "palpate", "palpate: the disk is full", 1);
    errands.run(Errand::writeProgress, state);
    lookUntil(errands, state, [&] { return !state.notice.empty(); });
    EXPECT_EQ(state.notice, "That did not work:\npalpate: the disk is full");
    EXPECT_EQ(state.told, "");
}

TEST(Errands, APageOfGroupsReplacesNoOther)
{
    const Folder folder;
    makeScript(folder / "palpate", "for last; do :; done\necho '{}' >\"$last\"");
    SessionFolder sink(folder / "sessions");
    Errands errands(folder.path(), sink);
    State state;
    for (const char* const name : {"ada", "bert"}) {
        state.people.emplace_back().name = name;
    }
    putIntoGroup(state, "ada", 1);
    putIntoGroup(state, "bert", 2);
    state.instructor.asPage = true;
    errands.run(Errand::compareGroups, state);
    EXPECT_EQ(state.notice, "");
    const std::regex written("Written to .*/groups-[0-9]{8}-[0-9]{6}\\.html");
    EXPECT_TRUE(std::regex_match(state.told, written)) << state.told;
    std::set<std::filesystem::path> files;
    for (int i = 0; i < 3; ++i) {
        const auto [at, isNew] = files.insert(freshFile(folder / "groups", ".html"));
        EXPECT_TRUE(isNew) << *at;
        std::ofstream(*at) << "";
    }
}

// The window says what went wrong, and what else runs goes on.
TEST(Errands, WhatFailsWhileItLooksIsSaid)
{
    const Folder folder;
    SessionFolder sink(folder / "sessions");
    Errands errands(folder.path(), sink);
    State state;
    state.cases = {caseCalled("a")};
    state.screen = Screen::result;
    state.files.record = folder / "a.db";
    makeScript(folder / "palpate", "for last; do :; done\n: > \"$last\"");  // and there is no viewer
    errands.run(Errand::seeExpert, state);
    ASSERT_TRUE(state.ghosting) << state.notice;
    lookUntil(errands, state, [&] { return !state.ghosting; });
    EXPECT_NE(state.notice.find("palpate-view"), std::string::npos) << state.notice;
    EXPECT_TRUE(std::filesystem::exists(folder / "expert-a.db")) << "the expert's session is kept";
    EXPECT_FALSE(state.replaying);

    std::filesystem::remove(folder / "palpate");
    state.notice.clear();
    state.listening = true;
    EXPECT_TRUE(errands.look(state)) << "to the grip";
    EXPECT_NE(state.notice.find("palpate: cannot be started"), std::string::npos) << state.notice;
    EXPECT_FALSE(errands.look(state)) << "that is no news";
}

// Keeps nothing.
struct FullSink : SessionFolder {
    using SessionFolder::SessionFolder;
    void keep(const CaseEntry&, const SessionFiles&, const Result&) override
    {
        throw std::runtime_error("the disk is full");
    }
};

TEST(Errands, ASessionThatCannotBeKeptHasEnded)
{
    const Folder folder;
    makeScript(folder / "palpate", R"(for last; do :; done
echo '{"score": {"total": 71, "points": {"core": 50, "vital": 21, "technique": 0}}}' > "$last")");
    FullSink sink(folder / "sessions");
    Errands errands(folder.path(), sink);
    State state;
    state.cases = {caseCalled("a")};
    errands.run(Errand::startSession, state);
    ASSERT_TRUE(state.running) << state.notice;
    lookUntil(errands, state, [&] { return !state.running; });
    EXPECT_EQ(state.screen, Screen::result);
    EXPECT_EQ(state.result.total, 71);
    EXPECT_EQ(state.notice, "the disk is full");
    state.notice.clear();
    errands.look(state);
    EXPECT_EQ(state.notice, "") << "it is said once";
}

// What a session that was killed had printed before is not why it ended: its record is what is told.
TEST(Errands, ASessionThatWasKilledSaysWhereItsRecordIs)
{
    const Folder folder;
    makeScript(folder / "palpate", R"(for last; do
  if [ "$before" = --record ]; then echo > "$last"; fi
  before="$last"
done
echo 'palpate: the session starts again' >&2
kill -9 $$)");
    SessionFolder sink(folder / "sessions");
    Errands errands(folder.path(), sink);
    State state;
    state.cases = {caseCalled("a")};
    errands.run(Errand::startSession, state);
    ASSERT_TRUE(state.running) << state.notice;
    lookUntil(errands, state, [&] { return !state.running; });
    EXPECT_NE(state.result.problem.find("The session was cut off"), std::string::npos) << state.result.problem;
}

// The profile is erased in a terminal while its session runs: figures that are written afterwards are not left, nothing can
// be watched, and the case has no points from it. With the record there, or of nobody, the session is as any other.
TEST(Errands, ASessionWhoseProfileWasErasedLeavesNothing)
{
    for (const auto& [person, recorded, left] :
         {std::tuple{"anna", false, false}, {"anna", true, true}, {"", false, true}}) {
        const Folder folder;
        makeScript(folder / "palpate", std::string(R"(for last; do
  if [ "$before" = --record ] && [ -n ")") +
                                           (recorded ? "yes" : "") +
                                           R"(" ]; then echo > "$last"; fi
  before="$last"
done
echo '{"problem": "anna: there is no such profile", "kept": true,
       "score": {"total": 71, "points": {"core": 50, "vital": 21, "technique": 0}}}' > "$last")");
        SessionFolder sink(folder / "sessions");
        Errands errands(folder.path(), sink);
        State state;
        state.cases = {caseCalled("a")};
        state.person = person;
        errands.run(Errand::startSession, state);
        ASSERT_TRUE(state.running) << state.notice;
        lookUntil(errands, state, [&] { return !state.running; });
        EXPECT_EQ(state.result.problem.empty(), left) << state.result.problem;
        EXPECT_EQ(std::filesystem::exists(state.files.figures), left);
        EXPECT_EQ(state.cases[0].best.has_value(), left);
        EXPECT_EQ(sink.best(state.cases[0]).has_value(), left);
        EXPECT_EQ(debrief(state) == Errand::startDebrief, left);
        EXPECT_EQ(state.result.fault.empty(), !left);
    }
}

}  // namespace
}  // namespace palpate::trainer
