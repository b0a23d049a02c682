#include <base/room.h>
#include <tests/apps/program.h>

#include <gtest/gtest.h>

#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>

namespace palpate::apps {
namespace {

namespace fs = std::filesystem;

// The commands with a home of their own.
class TrainingCommands : public ::testing::Test {
protected:
    TrainingCommands()
    {
        ::setenv("XDG_DATA_HOME", folder_.path().c_str(), 1);
        ::setenv("XDG_CONFIG_HOME", (folder_ / "config").c_str(), 1);
    }
    ~TrainingCommands() override
    {
        ::unsetenv("XDG_DATA_HOME");
        ::unsetenv("XDG_CONFIG_HOME");
    }

    // What somebody does in one session of an exercise.
    static Outcome session(const std::string& exercise, const std::vector<std::string>& more = {})
    {
        std::vector<std::string> words{
            "train",      "--profile", "anna",      "--exercise", "breast-core-biopsy/" + exercise,
            "--headless", "--unpaced", "--setting", "fast"};
        words.insert(words.end(), more.begin(), more.end());
        return palpate(words);
    }

    Folder folder_;
};

TEST_F(TrainingCommands, SessionsOfATraineeOpenTheGateAndTheNextExercise)
{
    ASSERT_EQ(palpate({"profile", "new", "anna", "--hand", "left"}).status, 0);
    expectRefusal({"train", "--profile", "anna", "--exercise", "breast-core-biopsy/first-core", "--headless", "--unpaced"},
                  "is still locked for anna; next is breast-core-biopsy/touch");
    auto next = figures({"curriculum", "next", "breast-core-biopsy", "--profile", "anna"});
    EXPECT_EQ(next["next"][0]["exercise"], "touch");

    // The scripted hand does what the briefing says: it rests on the skin and lifts off.
    for (int n = 0; n < 3; ++n) {
        const Outcome done = session("touch");
        ASSERT_EQ(done.status, 0) << done.err;
        EXPECT_NE(done.out.find("100 of 100"), std::string::npos) << done.out;
    }
    const auto progress = figures({"progress", "anna"});
    ASSERT_EQ(progress["sessions"].size(), 3U);
    next = figures({"curriculum", "next", "--profile", "anna"});
    EXPECT_EQ(next["next"][0]["exercise"], "advance") << progress["sessions"][0]["measures"];
    for (const auto& s : progress["sessions"]) {
        EXPECT_EQ(s["exercise"], "touch");
        EXPECT_EQ(s["mode"], "practice");
        EXPECT_TRUE(fs::exists(s["record"].get<std::string>()));
    }
}

TEST_F(TrainingCommands, ARecordFromAnotherMachineCountsAsWhatItWas)
{
    ASSERT_EQ(palpate({"profile", "new", "anna"}).status, 0);
    ASSERT_EQ(palpate({"profile", "new", "bert"}).status, 0);
    ASSERT_EQ(session("touch", {"--seconds", "2", "--test", "--record", folder_ / "r.db"}).status, 0);
    ASSERT_EQ(palpate({"profile", "add-record", "bert", folder_ / "r.db"}).status, 0);
    expectRefusal({"profile", "add-record", "bert", folder_ / "r.db"}, "bert has this session already");
    const auto one = figures({"progress", "anna"})["sessions"][0], other = figures({"progress", "bert"})["sessions"][0];
    for (const char* key : {"started", "case", "curriculum", "exercise", "mode", "measures"}) {
        EXPECT_EQ(one[key], other[key]) << key;
    }
    EXPECT_EQ(one["mode"], "test");
    ASSERT_EQ(palpate({"profile", "erase", "anna", "--yes"}).status, 0);
    EXPECT_TRUE(fs::exists(folder_ / "r.db")) << "a record that somebody put elsewhere stays";
    expectRefusal({"progress", "anna"}, "there is no such profile");
}

// "Surname, name" is how clinics write people.
TEST_F(TrainingCommands, ANameWithACommaIsOnePersonOfAGroup)
{
    for (const char* const name : {"Smith", "Jane", "Smith,Jane", "bert"}) {
        ASSERT_EQ(palpate({"profile", "new", name}).status, 0);
    }
    for (const char* const name : {"Smith,Jane", "bert"}) {
        ASSERT_EQ(palpate({"train", smallLayered(), "--profile", name, "--headless", "--unpaced", "--seconds", "2"}).status,
                  0);
    }
    const Outcome two = palpate({"progress", "--group", "a=Smith,Jane", "--group", "b=bert"});
    EXPECT_NE(two.out.find("a (n=1)"), std::string::npos) << two.out << two.err;
    const Outcome one = palpate({"progress", "--group", "a=Smith,Jane", "--group", "a=bert"});
    EXPECT_NE(one.out.find("a (n=2)"), std::string::npos) << one.out << one.err;
    const std::string csv = folder_ / "g.csv", xapi = folder_ / "g.json";
    const Outcome tables =
        palpate({"progress", "--group", "a=Smith,Jane", "--group", "b=bert", "--csv", csv, "--xapi", xapi});
    EXPECT_EQ(tables.status, 0) << tables.err;
    EXPECT_NE(readText(csv).find("\na,\"Smith,Jane\",1,"), std::string::npos) << readText(csv);
    EXPECT_NE(readText(csv).find("\nb,bert,2,"), std::string::npos) << readText(csv);
    EXPECT_EQ(nlohmann::json::parse(readText(xapi)).size(), 2U);
    expectRefusal({"progress", "--group", "a=Smith,bert,nobody"}, "nobody: there is no such profile");
    expectRefusal({"progress", "--group", "a=bert,bert"}, "--group a=bert,bert: bert is in this group already");
    expectRefusal({"progress", "--group", "a=bert", "--group", "a=Smith,Jane,bert", "--group", "b=bert"},
                  "--group a=Smith,Jane,bert: bert is in this group already");
    EXPECT_EQ(palpate({"progress", "--group", "a=bert", "--group", "b=bert"}).status, 0);
    expectRefusal({"progress", "--group", "a=bert", "--case", "layerd"},
                  "layerd: there is no such case; did you mean layered?");
    expectRefusal({"progress", "--group", "a=bert", "--exercise", "nosuch/x"}, "nosuch: there is no such curriculum");
    expectRefusal({"progress", "--group", "a=bert", "--case", "layered"}, "these people have no such sessions");
    for (const char* const option : {"--case", "--exercise"}) {
        expectRefusal({"progress", "bert", option, "layered"}, std::string(option) + " requires --group");
    }
    for (const char* const option : {"--html", "--csv", "--xapi"}) {
        expectRefusal({"progress", "bert", option, "-"}, "this output goes to a file");
    }
    expectRefusal({"train", "--case", "layered", "--test", "--dffb", "field", "--headless"}, "a test is without guidance");
    expectRefusal({"train", "--exercise", "breast-core-biopsy/touch", "--dffb", "off", "--headless"},
                  "the exercise says how much guidance");
}

TEST_F(TrainingCommands, AFileThatCannotBeWrittenTakesNothingFromWhatIsPrinted)
{
    ASSERT_EQ(palpate({"profile", "new", "anna"}).status, 0);
    for (const std::vector<std::string>& words :
         {std::vector<std::string>{"progress", "anna"}, {"progress", "--all"}, {"profile", "list"}}) {
        std::vector<std::string> all = words;
        all.insert(all.end(), {"--json", "/dev/full"});
        const Outcome cut = palpate(all);
        EXPECT_EQ(cut.status, 1);
        EXPECT_EQ(cut.out, palpate(words).out) << words[0];
        EXPECT_NE(cut.err.find("/dev/full: "), std::string::npos) << cut.err;
    }
}

TEST_F(TrainingCommands, ReadingMakesNoProfiles)
{
    for (const std::vector<std::string>& words : {std::vector<std::string>{"progress", "--all"},
                                                  {"profile", "list"},
                                                  {"curriculum", "next", "--profile", "anna"}}) {
        palpate(words);
        EXPECT_FALSE(fs::exists(folder_ / "palpate")) << words[0];
    }
}

// What the note asks for: the numbers are the file's, so that of a person's first session need not be 1.
TEST_F(TrainingCommands, ProgressListsTheSessionsThatANoteCanBeOf)
{
    ASSERT_EQ(palpate({"profile", "new", "anna"}).status, 0);
    ASSERT_EQ(palpate({"profile", "new", "bert"}).status, 0);
    ASSERT_EQ(session("touch", {"--seconds", "2"}).status, 0);
    const Outcome first =
        palpate({"train", "--profile", "bert", "--case", "layered", "--headless", "--unpaced", "--seconds", "2"});
    EXPECT_NE(first.out.find("kept for bert as session 2 (1 session so far)"), std::string::npos) << first.out;
    ASSERT_EQ(session("touch", {"--seconds", "2", "--test"}).status, 0);

    const Outcome anna = palpate({"progress", "anna"}), bert = palpate({"progress", "bert", "--html", folder_ / "b.html"});
    EXPECT_NE(anna.out.find("breast-core-biopsy/touch (test)"), std::string::npos) << anna.out;
    const auto all = figures({"progress", "anna"})["sessions"];
    ASSERT_EQ(all.size(), 2U);
    for (const auto& one : all) {
        const std::string number = one["session"].dump(), day = one["started"].get<std::string>().substr(0, 10);
        EXPECT_NE(anna.out.find("  " + number + "  " + day), std::string::npos) << anna.out;
        EXPECT_EQ(palpate({"profile", "note", "anna", number, "--rating", "3"}).status, 0);
    }
    EXPECT_NE(bert.out.find("bert (1 session)\n"), std::string::npos) << bert.out;
    EXPECT_NE(bert.out.find("free practice"), std::string::npos) << bert.out;
    EXPECT_NE(bert.out.find("page: " + std::string(folder_ / "b.html")), std::string::npos) << bert.out;
    expectRefusal({"profile", "note", "bert", "1"}, "bert has no session 1: palpate progress 'bert' lists them");
    EXPECT_EQ(palpate({"progress", "--all"}).out.find("started (UTC)"), std::string::npos) << "that would be too much";
}

// Without the package of the cases a list that is empty would look like a programme without any.
TEST_F(TrainingCommands, SayWhereTheyLookedWhereThereAreNoCases)
{
    ASSERT_EQ(palpate({"profile", "new", "anna"}).status, 0);
    ::setenv("PALPATE_DATA", "/nonexistent", 1);
    expectRefusal({"case", "list"}, "/nonexistent/cases: there are no cases here: install the package palpate-data");
    expectRefusal({"curriculum", "list"}, "/nonexistent/curricula: there are no curricula here: install the package");
    expectRefusal({"curriculum", "next", "--profile", "anna"}, "/nonexistent/curricula: there are no curricula here");
    ::unsetenv("PALPATE_DATA");
}

TEST_F(TrainingCommands, AnInterruptedSessionSaysThatItIsNotKept)
{
    ASSERT_EQ(palpate({"profile", "new", "anna"}).status, 0);
    const std::string record = folder_ / "cut.db";
    Program running("palpate",
                    {"train", smallLayered(), "--profile", "anna", "--headless", "--setting", "fast", "--record", record});
    for (int i = 0; i < 300 && !fs::exists(record); ++i) {
        ::usleep(100000);
    }
    ::usleep(2500000);  // until it has touched the body: before that it would not count
    running.send(SIGINT);
    const Outcome cut = running.wait();
    EXPECT_EQ(cut.status, 128 + SIGINT);
    EXPECT_NE(cut.out.find("not kept for anna: the session was interrupted\n"), std::string::npos) << cut.out << cut.err;
    EXPECT_TRUE(figures({"progress", "anna"})["sessions"].empty());
    expectRefusal({"profile", "add-record", "anna", record}, "was interrupted (Interrupt): this session does not count");
    EXPECT_TRUE(figures({"progress", "anna"})["sessions"].empty());
}

// SIGUSR1 is how the trainer's window ends a session: as E in the session's own window, which counts.
TEST_F(TrainingCommands, ASessionThatIsToldThatItIsDoneIsKept)
{
    ASSERT_EQ(palpate({"profile", "new", "anna"}).status, 0);
    const std::string record = folder_ / "done.db";
    Program running("palpate",
                    {"train", smallLayered(), "--profile", "anna", "--headless", "--setting", "fast", "--record", record});
    for (int i = 0; i < 300 && !fs::exists(record); ++i) {
        ::usleep(100000);
    }
    ::usleep(2000000);  // to the skin
    running.send(SIGUSR1);
    const Outcome done = running.wait();
    EXPECT_EQ(done.status, 0) << done.err;
    EXPECT_NE(done.out.find("kept for anna as session 1"), std::string::npos) << done.out << done.err;
}

// A record that fills the disk takes no room from the figures: a file without a name keeps it.
TEST_F(TrainingCommands, WhileASessionRunsThereIsRoomForItsFigures)
{
    constexpr std::uintmax_t enough = 64 << 10;                                  // [bytes]
    const bool can = static_cast<bool>(base::keepRoom(folder_.path(), enough));  // not on every file system
    Program running("palpate", {"train", smallLayered(), "--headless", "--setting", "fast", "--record", folder_ / "s.db",
                                "--json", folder_ / "s.json"});
    ASSERT_TRUE(catches(running, SIGUSR1));
    std::uintmax_t kept = 0;
    for (const auto& open : fs::directory_iterator("/proc/" + std::to_string(running.pid()) + "/fd")) {
        std::error_code none;
        const fs::path file = fs::read_symlink(open, none);
        struct stat its {};
        if (file.parent_path() == folder_.path() && ::stat(open.path().c_str(), &its) == 0 && its.st_nlink == 0) {
            kept += 512 * static_cast<std::uintmax_t>(its.st_blocks);
        }
    }
    EXPECT_GE(kept, can ? enough : 0);
    running.send(SIGUSR1);
    EXPECT_EQ(running.wait().status, 0);
    EXPECT_GT(fs::file_size(folder_ / "s.json"), 1000U);
}

// Nobody can score or replay again what the profile would then claim.
TEST_F(TrainingCommands, ASessionWhoseDiskWasFullIsNotKept)
{
    ASSERT_EQ(palpate({"profile", "new", "anna"}).status, 0);
    const std::string record = folder_ / "cut.db";
    const Outcome cut =
        palpate({"train", smallLayered(), "--profile", "anna", "--headless", "--unpaced", "--setting", "fast", "--record",
                 record, "--inject", "disk-full@1500ms", "--json", folder_ / "cut.json"});
    EXPECT_EQ(cut.status, 1);
    EXPECT_EQ(std::ranges::count(cut.err, '\n'), 1) << cut.err;
    EXPECT_NE(cut.err.find(record + ": recording stopped: "), std::string::npos) << cut.err;
    EXPECT_NE(cut.out.find("not kept for anna: the record of the session is not whole"), std::string::npos) << cut.out;
    const auto told = nlohmann::json::parse(std::ifstream(folder_ / "cut.json"));
    EXPECT_FALSE(told["kept"]);
    EXPECT_NE(told["problem"].get<std::string>().find("the record of the session is not whole; " + record),
              std::string::npos)
        << told["problem"];
    EXPECT_TRUE(figures({"progress", "anna"})["sessions"].empty());
    expectRefusal({"profile", "add-record", "anna", record}, "was not closed");
}

// Among the records of whole sessions it would be taken for one.
TEST_F(TrainingCommands, ARecordThatAFullDiskCutIsMarkedByItsName)
{
    ASSERT_EQ(palpate({"profile", "new", "anna"}).status, 0);
    const Outcome cut = palpate({"train", smallLayered(), "--profile", "anna", "--headless", "--unpaced", "--setting",
                                 "fast", "--inject", "disk-full@1500ms"});
    EXPECT_EQ(cut.status, 1);
    EXPECT_EQ(std::ranges::count(cut.err, '\n'), 1) << cut.err;
    std::string record;
    for (const auto& entry : fs::directory_iterator(folder_ / "palpate/records")) {
        EXPECT_NE(entry.path().string().find("-cut-off.db"), std::string::npos) << entry.path();
        record = entry.path().extension() == ".db" ? entry.path().string() : record;
    }
    EXPECT_NE(cut.err.find("; its name is now " + record), std::string::npos) << cut.err;
    EXPECT_NE(cut.out.find("record: " + record + "\n"), std::string::npos) << cut.out;
    EXPECT_EQ(palpate({"replay", record}).status, 0);
}

// Of the window too, and of a session that was interrupted: its record names who trained, and no profile names it.
TEST_F(TrainingCommands, ErasingRemovesRecordsOfTheWindowAndOfInterruptedSessions)
{
    ASSERT_EQ(palpate({"profile", "new", "anna"}).status, 0);
    fs::create_directories(folder_ / "palpate/sessions");
    fs::create_directories(folder_ / "config/palpate");
    writeText(folder_ / "config/palpate/trainer.json", R"({"person": "anna", "sounds": true})");
    const std::string window = folder_ / "palpate/sessions/touch.db", figures = folder_ / "palpate/sessions/touch.json";
    ASSERT_EQ(session("touch", {"--seconds", "2", "--record", window, "--json", figures}).status, 0);
    {
        Program running("palpate", {"train", smallLayered(), "--profile", "anna", "--headless", "--setting", "fast"});
        const auto recorded = [&] {
            std::error_code none;
            return !fs::is_empty(folder_ / "palpate/records", none) && !none;
        };
        for (int i = 0; i < 300 && !recorded(); ++i) {
            ::usleep(100000);
        }
        running.send(SIGKILL);
    }
    ASSERT_FALSE(fs::is_empty(folder_ / "palpate/records"));
    const Outcome erased = palpate({"profile", "erase", "anna", "--yes"});
    EXPECT_EQ(erased.status, 0) << erased.err;
    EXPECT_EQ(erased.out, "anna: erased\n");
    EXPECT_TRUE(fs::is_empty(folder_ / "palpate/records"));
    EXPECT_TRUE(fs::is_empty(folder_ / "palpate/sessions"));
    EXPECT_EQ(readText(folder_ / "config/palpate/trainer.json").find("anna"), std::string::npos);
}

// Who begins and leaves has not tried: it is no attempt of the exercise.
TEST_F(TrainingCommands, ASessionThatTouchedNothingIsNotKept)
{
    ASSERT_EQ(palpate({"profile", "new", "anna"}).status, 0);
    const Outcome looked = palpate({"train", "--profile", "anna", "--exercise", "breast-core-biopsy/touch", "--headless",
                                    "--unpaced", "--seconds", "0.01", "--setting", "fast"});
    ASSERT_EQ(looked.status, 0) << looked.err;
    EXPECT_NE(looked.out.find("never touched the body"), std::string::npos) << looked.out;
    EXPECT_EQ(looked.out.find("kept for anna"), std::string::npos) << looked.out;
    EXPECT_EQ(figures({"progress", "anna"})["sessions"].size(), 0U);
}

// As on a disk that is read-only: there is no place for the profiles.
TEST_F(TrainingCommands, AFolderThatCannotBeMadeIsSaidInPlainWords)
{
    writeText(folder_ / "file", "no folder");
    ::setenv("XDG_DATA_HOME", (folder_ / "file").c_str(), 1);
    expectRefusal({"profile", "new", "anna"},
                  (folder_ / "file").string() + "/palpate: this folder cannot be made (Not a directory)");
}

// An instructor sees who trains, and how it goes, while it goes; nothing of a session that was killed.
TEST_F(TrainingCommands, SessionsThatRunAreListedWithWhoTrains)
{
    const std::string anna = "anna-mit-dem-längsten-Namen";
    ASSERT_EQ(palpate({"profile", "new", anna}).status, 0);
    Program running("palpate", {"train", smallLayered(), "--profile", anna, "--headless", "--setting", "fast"});
    const std::string name = "train-" + std::to_string(running.pid());
    const auto listed = [&]() -> nlohmann::json {
        const auto all = figures({"sessions"});
        for (const auto& one : all["sessions"]) {
            if (one["session"] == name) {
                return one;
            }
        }
        return nullptr;
    };
    nlohmann::json one;
    for (int i = 0; i < 300 && (one.is_null() || one["state"] == "outside"); ++i) {
        one = listed();
        ::usleep(100000);
    }
    ASSERT_FALSE(one.is_null());
    EXPECT_EQ(one["who"], anna);
    EXPECT_NE(palpate({"sessions"}).out.find(" anna-mit-dem-… layered "), std::string::npos) << palpate({"sessions"}).out;
    EXPECT_EQ(one["scene"], "layered");
    EXPECT_EQ(one["process"], running.pid());
    EXPECT_NE(one["state"], "outside");
    EXPECT_GT(one["seconds"], 0);
    EXPECT_EQ(one["target"], "tumour");
    ::kill(running.pid(), SIGKILL);
    running.wait();
    EXPECT_TRUE(listed().is_null());
}

TEST_F(TrainingCommands, ProgressShowsWhatWasNotBegunToo)
{
    ASSERT_EQ(palpate({"profile", "new", "anna"}).status, 0);
    EXPECT_TRUE(figures({"progress", "anna"})["exercises"].empty());
    const auto progress = figures({"progress", "anna", "--curriculum", "breast-core-biopsy"});
    ASSERT_EQ(progress["exercises"].size(), 8U);
    EXPECT_EQ(progress["exercises"][0]["state"], "next");
    EXPECT_EQ(progress["exercises"][7]["state"], "locked");
    EXPECT_TRUE(progress["exercises"][7]["test"]);
    expectRefusal({"progress", "anna", "--curriculum", "palpaton"}, "did you mean palpation?");
    ASSERT_EQ(palpate({"profile", "hand", "anna", "left"}).status, 0);
    EXPECT_EQ(figures({"profile", "list"})["profiles"][0]["hand"], "left");
    expectRefusal({"profile", "hand", "bert", "left"}, "there is no such profile");
}

// A session says which curriculum it was of, and not where that lies.
TEST_F(TrainingCommands, TheNextExerciseIsFoundWhereACurriculumIsMissing)
{
    ASSERT_EQ(palpate({"profile", "new", "anna"}).status, 0);
    writeText(folder_ / "course.toml",
              "title = \"A course\"\n[[exercise]]\nid = \"touch\"\ntitle = \"Touch\"\ncase = \"first-touch\"\n"
              "[[exercise.level]]\nmeasure = \"total\"\nat_least = 50\n");
    const auto practise = [&](const std::string& exercise) {
        return palpate({"train", "--profile", "anna", "--exercise", exercise, "--headless", "--unpaced", "--setting",
                        "fast", "--seconds", "2"});
    };
    const auto next = [] { return palpate({"curriculum", "next", "--profile", "anna"}); };
    ASSERT_EQ(practise((folder_ / "course.toml").string() + "/touch").status, 0);
    const Outcome first = next();
    EXPECT_EQ(first.status, 0) << first.err;
    EXPECT_NE(first.err.find("palpate: warning: sessions of a missing curriculum are not counted: course: "),
              std::string::npos)
        << first.err;
    EXPECT_EQ(std::ranges::count(first.err, '\n'), 1) << first.err;
    EXPECT_NE(first.out.find("palpation: "), std::string::npos) << "all that there are: " << first.out;
    ASSERT_EQ(session("touch", {"--seconds", "2"}).status, 0);
    ASSERT_EQ(practise((folder_ / "course.toml").string() + "/touch").status, 0);
    const Outcome second = next();
    EXPECT_NE(second.out.find("breast-core-biopsy: "), std::string::npos) << second.out << second.err;
    EXPECT_EQ(second.out.find("palpation: "), std::string::npos) << second.out;
}

// Of two simulated people the median lies between them, and quartiles a quarter of the way from each.
TEST_F(TrainingCommands, MediansOfSimulatedPeopleLieBetweenNeighbours)
{
    const auto sessions = [](const std::string& seed, const std::string& people) {
        const auto skills = figures({"curriculum", "simulate", "palpation", "--people", people, "--seed", seed});
        return skills["skills"][0]["sessions"];
    };
    const double one = sessions("1", "1")["max"], two = sessions("2", "1")["max"];
    ASSERT_NE(one, two);
    const auto both = sessions("1", "2");
    EXPECT_DOUBLE_EQ(both["median"], (one + two) / 2);
    EXPECT_DOUBLE_EQ(both["lower_quartile"], std::min(one, two) + std::abs(one - two) / 4);
    EXPECT_DOUBLE_EQ(both["upper_quartile"], std::max(one, two) - std::abs(one - two) / 4);
    EXPECT_EQ(both["max"], std::max(one, two));
}

// The full check is the command without these options.
TEST_F(TrainingCommands, ACurriculumIsVerifiedBySimulatedPeople)
{
    const auto check = figures({"curriculum", "verify", "breast-core-biopsy", "--people", "60", "--kills", "2"});
    EXPECT_EQ(check["finished"], 180);
    EXPECT_TRUE(check["gate_faults"].empty() && check["kill_faults"].empty());
    EXPECT_EQ(check["signals"].size(), 6U);
}

TEST_F(TrainingCommands, ACaseIsMadeOfAVolumeAndTrained)
{
    const std::string volume = folder_ / "v.vdb";
    ASSERT_EQ(palpate({"phantom", "layered", "--voxel", "2", "--set", "width_mm=40", "-o", volume}).status, 0);
    ASSERT_EQ(palpate({"case", "new", volume, "-o", folder_ / "mine", "--licence", "CC0-1.0"}).status, 0);
    expectRefusal({"case", "new", volume, "-o", folder_ / "mine"}, "exists already");
    ASSERT_EQ(palpate({"case", "new", volume, "-o", (folder_ / "slash").string() + "/", "--licence", "CC0-1.0"}).status, 0);
    EXPECT_TRUE(fs::exists(folder_ / "slash/scene.toml"));
    const Outcome checked = palpate({"case", "check", folder_ / "mine"});
    EXPECT_EQ(checked.status, 0) << "a picture may be left out" << checked.out << checked.err;
    EXPECT_NE(checked.out.find("a hint: there is no picture"), std::string::npos) << checked.out;
    // What check asks for, in the words of its message.
    if (fs::exists(PALPATE_BIN_DIR "/palpate-view")) {
        const Outcome drawn = palpate({"case", "picture", folder_ / "mine"});
        EXPECT_EQ(drawn.status, 0) << drawn.err;
        const Outcome again = palpate({"case", "check", folder_ / "mine"});
        EXPECT_EQ(again.status, 0) << again.out << again.err;
        EXPECT_EQ(again.out.find("hint"), std::string::npos) << again.out;
        EXPECT_EQ(palpate({"case", "picture", folder_ / "mine"}).status, 0);
        EXPECT_EQ(palpate({"case", "check", folder_ / "mine"}).status, 0);
    }
    // The volume went along: the folder can be given away.
    fs::remove(volume);
    const auto trained = figures({"train", "--case", folder_ / "mine", "--headless", "--unpaced", "--seconds", "0.5"});
    EXPECT_EQ(trained["scene"], "mine");
    EXPECT_EQ(figures({"train", folder_ / "mine", "--headless", "--unpaced", "--seconds", "0.5"})["force_hash"],
              trained["force_hash"]);
}

TEST_F(TrainingCommands, RefuseWhatIsNotThere)
{
    expectRefusal({"case", "show", "near-vesel"}, "did you mean near-vessel?");
    expectRefusal({"curriculum", "check", "palpaton"}, "did you mean palpation?");
    const std::string course = folder_ / "course.toml";
    const auto courseWith = [&](const char* level) {
        std::ofstream(course)
            << "title = \"A course\"\n[[exercise]]\nid = \"touch\"\ntitle = \"Touch\"\ncase = \"first-touch\"\n"
               "[[exercise.level]]\n"
            << level;
        return course;
    };
    EXPECT_EQ(palpate({"curriculum", "check", courseWith("measure = \"rest_s\"\nat_least = 2\n")}).status, 0);
    expectRefusal({"curriculum", "check", courseWith("measure = \"total\"\nat_least = 140\n")}, "must be 0 to 100");
    expectRefusal({"curriculum", "check", courseWith("measure = \"best_target_pct\"\nat_least = 40\n")},
                  "exercise touch: its gate never opens: best_target_pct has no value in case first-touch");
    expectRefusal({"curriculum", "check", courseWith("measure = \"ct_scans\"\nat_most = 4\n")}, "without [ct]");
    expectRefusal({"train", "--profile", "nobody", "--headless", "--unpaced"}, "there is no such profile");
    expectRefusal({"train", "layered", "--case", "layered", "--headless", "--unpaced"}, "a case has a scene of its own");
    expectRefusal({"progress"}, "give a profile's name");
}

}  // namespace
}  // namespace palpate::apps
