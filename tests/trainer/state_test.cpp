#include <trainer/case_pictures.h>
#include <trainer/state.h>

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

namespace palpate::trainer {
namespace {

State firstState()
{
    State state;
    for (const char* id : {"first", "second", "third"}) {
        CaseEntry c;
        c.id = c.title = id;
        state.cases.push_back(c);
    }
    return state;
}

Result scored(double total)
{
    Result result;
    result.total = total;
    return result;
}

TEST(State, TheMainButtonAloneLeadsFromTheCaseToTheResultAndToTheNextCase)
{
    State state = firstState();
    EXPECT_EQ(advance(state), Errand::checkDevices);
    EXPECT_EQ(state.screen, Screen::devices);
    EXPECT_EQ(advance(state), Errand::none);
    EXPECT_EQ(state.screen, Screen::briefing);
    EXPECT_EQ(advance(state), Errand::startSession);
    EXPECT_EQ(state.screen, Screen::briefing) << "only a session that has started leaves the briefing";
    sessionStarted(state, {"a.db", "a.json"}, "palpate train");
    EXPECT_EQ(state.screen, Screen::session);
    EXPECT_EQ(advance(state), Errand::endSession);
    sessionEnded(state, scored(71));
    EXPECT_EQ(state.screen, Screen::result);
    EXPECT_EQ(debrief(state), Errand::startDebrief);
    EXPECT_EQ(advance(state), Errand::none);
    EXPECT_EQ(state.screen, Screen::cases);
    EXPECT_EQ(state.chosen, 1U);
}

TEST(State, TheBestScoreNeverFallsAndAFailedSessionIsNone)
{
    State state = firstState();
    for (const double total : {40.0, 71.0, 55.0}) {
        sessionStarted(state, {}, "");
        sessionEnded(state, scored(total));
    }
    EXPECT_EQ(state.cases[0].best, 71.0);
    state.chosen = 1;
    sessionStarted(state, {}, "");
    Result failed;
    failed.problem = "palpate: no display";
    sessionEnded(state, failed);
    EXPECT_FALSE(state.cases[1].best);
    EXPECT_EQ(debrief(state), Errand::none) << "there is nothing to see again";
}

// Whatever else is looked at in between.
TEST(State, ANoteThatIsNotKeptYetIsThereWhenItsSessionIsChosenAgain)
{
    State state = firstState();
    Instructor& i = state.instructor;
    i.everybody.sessions = {{"ada", 1, "", "", "", false, "", "calm", 3, {}}, {"ada", 2, "", "", "", false, "", "", 0, {}}};
    chooseKept(state, 1);
    i.note = "look at the probe";
    i.rating = 4;
    noteTyped(state);
    EXPECT_TRUE(hasDraft(i, i.everybody.sessions[1]));
    chooseKept(state, 0);
    noteTyped(state);
    EXPECT_EQ(i.note, "calm");
    EXPECT_FALSE(hasDraft(i, i.everybody.sessions[0]));
    chooseKept(state, 1);
    EXPECT_EQ(i.note, "look at the probe");
    EXPECT_EQ(i.rating, 4);
    noteKept(state);
    EXPECT_FALSE(hasDraft(i, i.everybody.sessions[1]));
}

TEST(State, ADebriefIsCalledAsItsCaseIs)
{
    State state = firstState();
    state.cases[0].title = "- Erste Berührung";
    const auto words = debriefArguments(state);
    EXPECT_NE(std::ranges::find(words, "--title=- Erste Berührung"), words.end());
}

// A table stands under the choice that it is of.
TEST(State, AComparisonGoesWhenOtherGroupsOrCasesAreChosen)
{
    State state = firstState();
    state.people = {{"Ada", false}, {"Bo", false}};
    const Comparison some{{"group 1", "group 2"}, {1, 1}, {}, {}};
    Instructor& i = state.instructor;
    putIntoGroup(state, "Ada", 1);
    i.comparison = some;
    putIntoGroup(state, "Ada", 1);
    EXPECT_EQ(i.comparison.names.size(), 2U) << "nothing has changed";
    putIntoGroup(state, "Bo", 1);
    EXPECT_TRUE(i.comparison.names.empty());
    EXPECT_EQ(i.groups, (std::map<std::string, int>{{"Ada", 1}, {"Bo", 1}}));
    i.comparison = some;
    compareCase(state, "");
    EXPECT_EQ(i.comparison.names.size(), 2U);
    compareCase(state, "second");
    EXPECT_TRUE(i.comparison.names.empty());
    EXPECT_EQ(i.caseId, "second");
}

TEST(State, WhatIsSaidOnAScreenIsNotSaidOnTheNext)
{
    State state = firstState();
    showInstructor(state);
    state.notice = "Put somebody into each of the two groups.";
    goBack(state);
    EXPECT_EQ(state.notice, "");
    state.notice = "palpate: no such profile";
    advance(state);
    EXPECT_EQ(state.notice, "");
}

// What was typed and not kept, or a session that runs, goes only if the window is closed twice.
TEST(State, WhatWouldBeLostIsSaidBeforeTheWindowCloses)
{
    State state = firstState();
    EXPECT_EQ(leave(state), Errand::quit);
    state.instructor.drafts[{"Ada", 3}] = {"calm hands", 4};
    EXPECT_EQ(goBack(state), Errand::none);
    EXPECT_NE(state.notice.find("notes"), std::string::npos);
    EXPECT_EQ(goBack(state), Errand::quit);
    showInstructor(state);
    goBack(state);
    EXPECT_EQ(goBack(state), Errand::none) << "after another screen it is said again";
    state.instructor.drafts.clear();
    sessionStarted(state, {}, "");
    EXPECT_EQ(leave(state), Errand::none);
    EXPECT_NE(state.notice.find("session"), std::string::npos);
    EXPECT_EQ(leave(state), Errand::quit);
    sessionEnded(state, scored(50));
    EXPECT_EQ(state.notice, "");
    state.filming = true;
    state.instructor.drafts[{"Ada", 3}] = {"calm hands", 4};
    EXPECT_EQ(leave(state), Errand::none);
    EXPECT_NE(state.notice.find("film"), std::string::npos);
    EXPECT_NE(state.notice.find("notes"), std::string::npos) << "all that is lost";
    EXPECT_EQ(leave(state), Errand::quit);
    state.filming = state.leaving = false;
    state.instructor.drafts.clear();
    EXPECT_EQ(leave(state), Errand::quit);
}

// Whatever is pressed in whatever order: a session runs on its own screen and on no other, and one case is chosen.
TEST(State, RandomButtonsNeverLeaveASessionWithoutItsScreen)
{
    std::mt19937 random(7);
    State state = firstState();
    state.people = {{"Ada", false}};
    state.person = "Ada";
    state.progress.exercises.resize(2);
    state.progress.exercises[0].standing = ExerciseEntry::Standing::next;
    state.progress.exercises[0].caseId = "second";
    for (int i = 0; i < 20000; ++i) {
        Errand errand = Errand::none;
        switch (random() % 8) {
            case 0:
            case 1:
                errand = advance(state);
                break;
            case 2:
                errand = goBack(state);
                break;
            case 3:
                errand = again(state);
                break;
            case 4:
                errand = showProgress(state);
                break;
            case 5:
                errand = showInstructor(state);
                break;
            case 6:
                errand = trainExercise(state, random() % 3);
                break;
            default:
                errand = debrief(state);
        }
        if (errand == Errand::startSession) {
            ASSERT_FALSE(state.running);
            sessionStarted(state, {"a.db", "a.json"}, "");
        } else if (errand == Errand::endSession) {
            ASSERT_TRUE(state.running);
            sessionEnded(state, scored(static_cast<double>(random() % 101)));
        }
        ASSERT_EQ(state.running, state.screen == Screen::session);
        ASSERT_LT(state.chosen, state.cases.size());
    }
}

// The way that a curriculum leads: progress, the exercise that is next, its session, progress again.
TEST(State, AnExerciseIsTrainedFromTheProgressScreenAndLeadsBackToIt)
{
    State state = firstState();
    EXPECT_EQ(showProgress(state), Errand::none) << "nobody is chosen";
    state.people = {{"Ada", true}};
    state.person = "Ada";
    EXPECT_EQ(showProgress(state), Errand::choosePerson);
    EXPECT_EQ(state.screen, Screen::progress);
    Progress progress;
    progress.exercises.resize(3);
    ExerciseEntry& next = progress.exercises[1];
    next.curriculum = "c";
    next.id = "e";
    next.caseId = "third";
    next.standing = ExerciseEntry::Standing::next;
    next.next = next.test = true;
    progress.exercises[2].caseId = "first";
    progressLoaded(state, progress);
    EXPECT_EQ(state.exerciseShown, 1U) << "the next one";
    EXPECT_EQ(trainExercise(state, 2), Errand::none) << "its gate is shut";
    EXPECT_NE(state.notice, "");
    EXPECT_EQ(advance(state), Errand::checkDevices);
    EXPECT_EQ(state.chosen, 2U);
    EXPECT_TRUE(state.test);
    advance(state);
    EXPECT_EQ(advance(state), Errand::startSession);
    const auto words = trainArguments(state, {"r.db", "r.json"});
    EXPECT_NE(std::ranges::find(words, "c/e"), words.end());
    EXPECT_EQ(std::ranges::find(words, "--case"), words.end());
    const auto tryout = tryoutArguments(state);
    EXPECT_NE(std::ranges::find(tryout, "left"), tryout.end());
    sessionStarted(state, {}, "");
    sessionEnded(state, scored(50));
    EXPECT_EQ(advance(state), Errand::choosePerson);
    EXPECT_EQ(state.screen, Screen::progress);
    goBack(state);
    EXPECT_EQ(state.screen, Screen::cases);
    advance(state);
    EXPECT_EQ(state.exercise, "") << "a case of the list is no exercise";
}

TEST(State, GroupsAreCompared)
{
    State state = firstState();
    state.people = {{"Ada", false}, {"Bert", false}, {"Carla", false}};
    state.instructor.groups = {{"Ada", 1}, {"Bert", 1}};
    EXPECT_TRUE(comparisonArguments(state).empty()) << "nobody in the second group";
    putIntoGroup(state, "Carla", 2);
    state.instructor.caseId = "first";
    EXPECT_EQ(comparisonArguments(state),
              (std::vector<std::string>{"progress", "--group", "group 1=Ada", "--group", "group 1=Bert", "--group",
                                        "group 2=Carla", "--case", "first"}));
}

// Profiles are listed by name: who comes later may stand before others.
TEST(State, GroupsStayWithTheirPeople)
{
    State state = firstState();
    peopleListed(state, {{"Bert", false}, {"Carla", false}});
    putIntoGroup(state, "Bert", 1);
    putIntoGroup(state, "Carla", 2);
    Comparison& comparison = state.instructor.comparison;
    comparison = {{"group 1", "group 2"}, {1, 1}, {}, {}};
    const auto asked = comparisonArguments(state);
    peopleListed(state, {{"Anna", false}, {"Bert", false}, {"Carla", false}});
    EXPECT_EQ(comparisonArguments(state), asked);
    EXPECT_EQ(comparison.names.size(), 2U) << "it is of the same people";
    peopleListed(state, {{"Anna", false}, {"Carla", false}});
    EXPECT_TRUE(comparisonArguments(state).empty()) << "nobody in the first group";
    EXPECT_TRUE(comparison.names.empty());
    putIntoGroup(state, "Carla", 0);
    EXPECT_TRUE(state.instructor.groups.empty());
}

TEST(State, TheCommandIsWhatAShellUnderstands)
{
    EXPECT_EQ(asTyped("palpate", {"train", "near-vessel", "--record", "a b.db"}),
              "palpate train near-vessel --record 'a b.db'");
    EXPECT_EQ(asTyped("palpate", {"it's", ""}), "palpate 'it'\\''s' ''");
}

TEST(State, TheCommandSaysDeviceTestAndFiles)
{
    State state = firstState();
    const auto has = [&](const std::string& word) {
        const auto words = trainArguments(state, {"r.db", "r.json"});
        return std::ranges::find(words, word) != words.end();
    };
    EXPECT_TRUE(has("mouse") && has("r.db") && has("r.json") && !has("--test"));
    EXPECT_TRUE(has("--case") && has("first") && !has("--profile"));
    state.person = "A. B.";
    EXPECT_TRUE(has("--profile") && has("A. B."));
    state.test = state.useFalcon = true;
    state.firmware = "f.bin";
    EXPECT_TRUE(has("falcon") && has("f.bin") && has("--test") && !has("mouse"));
}

TEST(Cases, AreReadAsTheCommandListsThem)
{
    const auto list = nlohmann::json::parse(R"({"cases": [
        {"id": "hard", "title": "Hard", "picture": "h.png", "difficulty": 5, "trains": ["a", "b"], "measures": ["total"],
         "briefing": ["Reach it."]},
        {"id": "torn", "title": 3},
        {"id": "lump", "title": "Lump", "picture": "l.png", "difficulty": 1, "trains": [], "measures": ["mark_error_mm"],
         "briefing": ["Feel.", "Mark."]},
        {"id": "touch", "title": "Touch", "picture": "l.png", "difficulty": 5, "trains": [], "measures": ["rest_s"],
         "briefing": ["Rest."]}]})");
    const auto cases = casesOf(list);
    ASSERT_EQ(cases.size(), 3U);
    EXPECT_TRUE(cases[1].core && !cases[2].core) << "where no core is asked for it is no core biopsy";
    EXPECT_EQ(cases[0].id, "lump");
    EXPECT_TRUE(cases[0].palpation && !cases[1].palpation);
    EXPECT_EQ(cases[0].steps.size(), 2U);
    EXPECT_EQ(cases[1].trains, "a, b");
    EXPECT_EQ(cases[1].steps[0], "Reach it.");
    // Before and behind them stands what the hand does: with the mouse, or with the buttons of a grip.
    State state;
    state.cases = cases;
    state.chosen = 1;
    ASSERT_EQ(stepsOf(state).size(), 3U);
    EXPECT_NE(stepsOf(state)[0].find("the needle. The wheel"), std::string::npos);
    EXPECT_EQ(stepsOf(state)[1], "Reach it.");
    state.useFalcon = true;
    EXPECT_EQ(
        stepsOf(state)[0],
        "Hold the centre button of the grip: you hold the needle. Push it in. The forward button fires, once the needle is "
        "inside.");
    EXPECT_EQ(stepsOf(state)[2], "The left button, held for a second, ends the session. S pauses.");
    state.chosen = 0;
    EXPECT_EQ(stepsOf(state).size(), 4U);
    EXPECT_EQ(stepsOf(state)[0], "Hold the centre button of the grip: you hold the fingertip. Push to press.");
    for (const char* other : {"null", "[]", "{}", R"({"cases": 3})", R"({"cases": [1, "a", null]})"}) {
        EXPECT_TRUE(casesOf(nlohmann::json::parse(other)).empty()) << other;
    }
    const auto people = peopleOf(
        nlohmann::json::parse(R"({"profiles": [{"name": "B", "hand": "left"}, {}, {"name": "A", "hand": "right"}]})"));
    ASSERT_EQ(people.size(), 2U);
    EXPECT_TRUE(people[0].name == "B" && people[0].leftHanded && people[1].name == "A" && !people[1].leftHanded);
    EXPECT_TRUE(casePicture("no such picture").rgb.empty());
}

}  // namespace
}  // namespace palpate::trainer
