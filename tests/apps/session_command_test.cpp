#include <tests/apps/program.h>

#include <channel/channel.h>
#include <datasets/scene.h>
#include <haptics/recorder.h>

#include <gtest/gtest.h>

#include <signal.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <functional>
#include <memory>
#include <random>
#include <thread>

namespace palpate::apps {
namespace {

using namespace std::chrono_literals;

constexpr std::uint64_t maxLost = 500;  // ticks that a kill may cost: 0.5 s

std::vector<std::string> operator+(std::vector<std::string> words, const std::vector<std::string>& more)
{
    words.insert(words.end(), more.begin(), more.end());
    return words;
}

const std::vector<std::string>& scripted()
{
    static const std::vector<std::string> words{"train", smallLayered(), "--unpaced", "--headless"};
    return words;
}

std::string sessionName(const std::string& test)
{
    return "test-" + test + "-" + std::to_string(getpid());
}

// Waits for `done` at most a minute.
bool eventually(const std::function<bool()>& done)
{
    const auto end = std::chrono::steady_clock::now() + 60s;
    while (!done()) {
        if (std::chrono::steady_clock::now() > end) {
            return false;
        }
        std::this_thread::sleep_for(2ms);
    }
    return true;
}

// The tick that a running session shows to viewers.
std::uint64_t shownTick(const std::string& session)
{
    const auto subscriber = channel::Subscriber::attach(session);
    const auto state = subscriber && subscriber->alive() ? subscriber->state() : std::nullopt;
    return state ? state->tick : 0;
}

void expectKeys(const nlohmann::json& j, const std::vector<std::string>& pointers)
{
    for (const std::string& pointer : pointers) {
        EXPECT_TRUE(j.contains(nlohmann::json::json_pointer(pointer))) << pointer;
    }
}

// A scripted session without a clock, once for all tests: its record and its figures.
struct Recorded {
    static const Recorded& once()
    {
        static const Recorded session;
        return session;
    }

    const Folder folder;
    const std::string record = folder / "session.db";
    const nlohmann::json figures = apps::figures(scripted() + std::vector<std::string>{"--record", record});
};

TEST(Session, AReplayGivesTheSameBits)
{
    const auto& [folder, record, trained] = Recorded::once();
    const auto replayed = figures({"replay", record});
    EXPECT_EQ(replayed.at("identical"), true);
    EXPECT_TRUE(replayed.at("first_difference_tick").is_null());
    EXPECT_EQ(replayed.at("ticks"), trained.at("ticks"));
    EXPECT_EQ(replayed.at("force_hash"), trained.at("force_hash"));
    EXPECT_GT(trained.at("peak_force_n").at("basic").get<double>(), 0.0) << "nothing was felt, so nothing was compared";
}

// What the record says of its session under a key, with the end of the line.
std::string resultIn(const std::string& record, const std::string& key)
{
    return Program("/usr/bin/sqlite3", {record, "SELECT value FROM results WHERE key = '" + key + "'"}).wait().out;
}

// A session that keeps no clock has not measured how late it was.
TEST(Session, WithoutAClockThereIsNoLateness)
{
    const auto& [folder, record, trained] = Recorded::once();
    for (const char* const key : {"/missed_ticks", "/gaps", "/longest_gap_ms", "/lateness_us/p50", "/lateness_us/max"}) {
        EXPECT_TRUE(trained.at(nlohmann::json::json_pointer(key)).is_null()) << key;
    }
    EXPECT_TRUE(trained.at("overruns").is_number());
    for (const char* const key : {"missed_ticks", "gaps", "longest_gap_ms", "lateness_us_p50", "lateness_us_max"}) {
        EXPECT_EQ(resultIn(record, key), "\n") << key;
    }
    const Outcome said = palpate(scripted() + std::vector<std::string>{"--seconds", "0.1"});
    EXPECT_TRUE(said.out.starts_with("100 ticks, not paced; a tick takes ")) << said.out;
    EXPECT_EQ(said.out.find("late by"), std::string::npos) << said.out;
}

// What the clock did to a session (ticks that came late, a cheaper model) is in the record's samples, so that a replay,
// which knows neither clock nor recorder, has the same forces; and where no tick was missed, so has an unpaced session.
TEST(Session, ForcesDependOnTheClockOnlyThroughWhatTheRecordSays)
{
    const Folder folder;
    const std::string record = folder / "session.db";
    const std::vector<std::string> half{"train", smallLayered(), "--headless", "--setting", "default", "--seconds", "1.5"};
    const auto paced = figures(half + std::vector<std::string>{"--record", record});
    const auto replayed = figures({"replay", record});
    EXPECT_EQ(replayed.at("identical"), true);
    EXPECT_EQ(replayed.at("force_hash"), paced.at("force_hash"));
    for (const char* const key : {"lateness_us_p50", "lateness_us_p99", "lateness_us_p999", "lateness_us_max"}) {
        EXPECT_GT(std::atof(resultIn(record, key).c_str()), 0.0) << key;
    }
    if (paced.at("missed_ticks") == 0) {
        const auto unpaced = figures(half + std::vector<std::string>{"--unpaced"});
        EXPECT_EQ(paced.at("force_hash"), unpaced.at("force_hash"));
    }
}

TEST(Session, ThePublicKeysOfTheFiguresAreThere)
{
    const auto& [folder, record, trained] = Recorded::once();
    expectKeys(trained, {"/ticks",
                         "/missed_ticks",
                         "/overruns",
                         "/gaps",
                         "/longest_gap_ms",
                         "/lateness_us/p50",
                         "/lateness_us/p99",
                         "/lateness_us/p999",
                         "/lateness_us/max",
                         "/tick_us/p50",
                         "/tick_us/p99",
                         "/tick_us/p999",
                         "/tick_us/max",
                         "/tasks_us/H2/p50",
                         "/tasks_us/H3/p50",
                         "/tasks_us/H4/p50",
                         "/tasks_us/H5/p50",
                         "/tasks_us/H6/p50",
                         "/tasks_us/H7/p99",
                         "/peak_force_n/basic",
                         "/peak_force_n/additional",
                         "/peak_force_n/total",
                         "/model",
                         "/score/total",
                         "/core/0/fraction",
                         "/core/0/length_in_lesion_mm",
                         "/force_hash",
                         "/peak_memory_mb"});
    expectKeys(figures({"replay", record}), {"/ticks", "/identical", "/first_difference_tick"});
    expectKeys(figures({"score", "--group", "a=" + record, "--group", "b=" + record}),
               {"/sessions/0", "/groups/0/name", "/groups/0/n", "/groups/0/median/total", "/effect_size"});
    expectKeys(figures({"bench", "tick", "block", "--model", "spring", "--voxels", "32,48"}),
               {"/cases/0/voxels_per_side", "/cases/0/tick_us_p50", "/cases/1/tick_us_p99", "/growth"});
    const auto query = figures({"bench", "query", "--elements", "32,48"});
    expectKeys(query, {"/cases/0/tool", "/cases/0/elements_per_side", "/cases/0/touch_us_p50", "/cases/0/touch_us_p99",
                       "/cases/0/sweep_us_p50", "/growth"});
    EXPECT_EQ(query.at("cases").size(), 12U) << "three tools, at rest and deformed, two sizes";
}

TEST(Session, ScoringTheRecordGivesTheLiveScore)
{
    const auto& [folder, record, trained] = Recorded::once();
    const auto live = trained.at("score");
    const auto scored = figures({"score", record}).at("sessions").at(0);
    EXPECT_GT(live.size(), 10U);
    for (const auto& [key, value] : live.items()) {
        ASSERT_TRUE(scored.contains(key)) << key;
        EXPECT_EQ(scored.at(key), value) << key;
    }
}

TEST(Session, EveryPressingSceneRunsToItsEndAtEveryLevel)
{
    for (const std::string scene : {"block", "plate", "pair"}) {
        for (const std::string level : {"spring", "chainmail", "elastic"}) {
            const auto f = figures({"train", scene, "--unpaced", "--headless", "--model", level});
            EXPECT_EQ(f.at("model"), level) << scene;
            EXPECT_GT(f.at("contacts"), 0) << scene << " " << level;
            EXPECT_GT(f.at("peak_force_n").at("basic"), 0.15) << scene << " " << level;
        }
    }
}

// The record holds the setting with its values: replay needs no table of settings.
TEST(Session, ASettingIsInTheRecordAndIsReplayed)
{
    const Folder folder;
    const std::string record = folder / "session.db";
    figures({"train", "plate", "--unpaced", "--headless", "--model", "elastic", "--setting", "fast", "--record", record});
    const auto model = datasets::parseScene(haptics::Record(record).info().sceneText, record).model;
    EXPECT_EQ(model.level, datasets::ModelLevel::elastic);
    EXPECT_EQ(model.setting, "fast");
    EXPECT_EQ(model.elastic, datasets::elasticSetting("fast"));
    EXPECT_EQ(figures({"replay", record}).at("identical"), true);
}

TEST(Session, ARecordThatExistsIsNeverTouched)
{
    const Folder folder;
    const std::string record = folder / "session.db";
    writeText(record, "mine");
    expectRefusal(scripted() + std::vector<std::string>{"--record", record}, record + ": exists already");
    EXPECT_EQ(readText(record), "mine");
}

// What was asked for and did not come is no success.
TEST(Session, AWindowThatCannotBeOpenedIsAnError)
{
    if (!built("palpate-view")) {
        GTEST_SKIP() << "there is no palpate-view";
    }
    Program train("/usr/bin/env",
                  {"DISPLAY=:9999", std::string(PALPATE_BIN_DIR) + "/palpate", "train", smallLayered(), "--view"});
    const Outcome outcome = train.wait();
    EXPECT_EQ(outcome.status, 1);
    EXPECT_NE(outcome.err.find("the window failed"), std::string::npos) << outcome.err;
}

// What a shell would say of a program that the signal had killed: the exit status of an interrupted session is its own.
TEST(Session, AnInterruptEndsItInOrder)
{
    for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT}) {
        SCOPED_TRACE(signal);
        const Folder folder;
        const std::string record = folder / "session.db", session = sessionName("interrupt");
        Program train("palpate", {"train", smallLayered(), "--headless", "--session", session, "--record", record});
        ASSERT_TRUE(eventually([&] { return !train.running() || shownTick(session) > 300; }));
        const std::uint64_t seen = shownTick(session);
        train.send(signal);
        const Outcome outcome = train.wait();
        EXPECT_EQ(outcome.status, 128 + signal) << outcome.err;
        EXPECT_NE(outcome.err.find("ended in order"), std::string::npos) << outcome.err;

        const haptics::Record cut(record);
        EXPECT_TRUE(cut.complete());
        EXPECT_GT(seen, 300U);
        EXPECT_GE(cut.ticks(), seen);
        EXPECT_LT(cut.ticks(), Recorded::once().figures.at("ticks").get<std::uint64_t>())
            << "it ran to its end all the same";
        EXPECT_EQ(figures({"replay", record}).at("identical"), true);
        EXPECT_FALSE(channel::Subscriber::attach(session)) << "the session's segment was left behind";
    }
}

// One session name for all: a killed session's segment is taken over by the next.
TEST(Session, AKillAtAnyMomentCostsAtMostHalfASecond)
{
    const Folder folder(tests::memoryFolder());
    const std::string session = sessionName("kill");
    std::mt19937 random(std::random_device{}());
    std::uniform_int_distribution<std::uint64_t> moment(20, 2200);
    for (int run = 0; run < 4; ++run) {
        const std::uint64_t when = moment(random);
        SCOPED_TRACE("killed at tick " + std::to_string(when));
        const std::string record = folder / ("session-" + std::to_string(run) + ".db");
        Program train("palpate", {"train", smallLayered(), "--headless", "--session", session, "--record", record});
        ASSERT_TRUE(eventually([&] { return !train.running() || shownTick(session) >= when; }));
        const std::uint64_t seen = shownTick(session);
        train.send(SIGKILL);
        ASSERT_EQ(train.wait().status, -SIGKILL);

        const haptics::Record cut(record);
        EXPECT_FALSE(cut.complete());
        EXPECT_GE(cut.ticks() + maxLost, seen);
        if (cut.ticks() == 0) {  // killed before the first batch was written
            EXPECT_EQ(palpate({"replay", record}).status, 1);
            continue;
        }
        const auto replayed = figures({"replay", record});
        EXPECT_EQ(replayed.at("identical"), true);
        EXPECT_EQ(replayed.at("ticks"), cut.ticks());
    }
    EXPECT_EQ(palpate(scripted() + std::vector<std::string>{"--seconds", "0.05", "--session", session}).status, 0);
}

// Long enough at rest for a viewer to come up, then a press.
constexpr const char* slowScene = R"(
[volume]
phantom = "layered"
voxel_mm = 2
[volume.parameters]
width_mm = 40
[target]
structure = "tumour"
[[script]]
kind = "wait"
seconds = 4
[[script]]
kind = "press"
to_mm = [0, 1, 0]
seconds = 2
)";

TEST(Session, AViewerThatIsKilledChangesNothing)
{
    if (!built("palpate-view") || (access("/usr/bin/Xvfb", X_OK) != 0)) {
        GTEST_SKIP() << "there is no palpate-view, or no Xvfb to draw with";
    }
    const Folder folder;
    const std::string session = sessionName("viewer"), pictures = folder / "pictures", scene = folder / "scene.toml";
    writeText(scene, slowScene);
    Program train("palpate", {"train", scene, "--headless", "--setting", "default", "--session", session, "--json",
                              folder / "train.json", "--record", folder / "s.db"});
    Program view("palpate-view", {"--session", session, "--offscreen", pictures, "--size", "320x320", "--every", "0.1"});
    const auto drawn = [&] { return std::filesystem::exists(pictures) && !std::filesystem::is_empty(pictures); };
    ASSERT_TRUE(eventually([&] { return !train.running() || !view.running() || drawn(); }));
    ASSERT_TRUE(train.running()) << "the session was over before the viewer drew: nothing is tested";
    ASSERT_TRUE(view.running()) << view.wait().err;
    view.send(SIGKILL);
    EXPECT_EQ(view.wait().status, -SIGKILL);

    const Outcome outcome = train.wait();
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    const auto watched = nlohmann::json::parse(readText(folder / "train.json"));
    EXPECT_GT(watched.at("contacts"), 0);
    EXPECT_EQ(figures({"replay", folder / "s.db"}).at("identical"), true);
    // What the clock did to a session is in its record; only one that kept it has the forces of one without a clock.
    if (watched.at("missed_ticks") == 0) {
        EXPECT_EQ(watched.at("force_hash"),
                  figures({"train", scene, "--headless", "--setting", "default", "--unpaced"}).at("force_hash"));
    }
}

// A copy of the program with another viewer beside it, a shell script, or none.
class WithViewer {
public:
    explicit WithViewer(const std::string& script)
    {
        std::filesystem::copy_file(std::filesystem::path(PALPATE_BIN_DIR) / "palpate", folder_ / "palpate");
        if (!script.empty()) {
            writeText(folder_ / "palpate-view", "#!/bin/sh\n" + script + "\n");
            std::filesystem::permissions(folder_ / "palpate-view", std::filesystem::perms::owner_all);
        }
    }

    std::filesystem::path operator/(const std::string& name) const { return folder_ / name; }

    std::vector<std::string> arguments() const
    {
        return {"train",    smallLayered(), "--headless", "--seconds", "0.2",        "--record", record(),
                "--report", report(),       "--json",     figures(),   "--pictures", pictures()};
    }
    std::string record() const { return folder_ / "session.db"; }
    std::string report() const { return folder_ / "session.html"; }
    std::string figures() const { return folder_ / "session.json"; }
    std::string pictures() const { return folder_ / "pictures"; }

private:
    Folder folder_;
};

TEST(Session, AMissingViewerLeavesNoEmptyRecord)
{
    const WithViewer copy("");
    const Outcome outcome = Program(copy / "palpate", copy.arguments()).wait();
    EXPECT_EQ(outcome.status, 1);
    EXPECT_NE(outcome.err.find("palpate-view: cannot be started"), std::string::npos) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(copy.record()));
}

TEST(Session, PicturesThatAreNotCompleteAreAFailureAndEverythingElseIsWritten)
{
    const WithViewer copy("exit 3");
    const Outcome outcome = Program(copy / "palpate", copy.arguments()).wait();
    EXPECT_EQ(outcome.status, 1);
    EXPECT_NE(outcome.err.find(copy.pictures() + ": the pictures are not complete"), std::string::npos) << outcome.err;
    EXPECT_TRUE(haptics::Record(copy.record()).complete());
    EXPECT_TRUE(nlohmann::json::accept(readText(copy.figures())));
    EXPECT_NE(readText(copy.report()).find("</html>"), std::string::npos);
}

// A model that no machine holds is refused before there is a record, and goes where somebody insists.
TEST(Session, AModelThatNoMachineHoldsIsRefusedBeforeItStarts)
{
    const Folder folder;
    const std::string scene = folder / "absurd.toml", record = folder / "s.db";
    writeText(scene,
              "[volume]\nphantom = \"block\"\nvoxel_mm = 2\n[target]\nstructure = \"tumour\"\naim_mm = [0, 25, "
              "0]\nentry_mm = [0, 0, 0]\n[tool]\nkind = \"sphere\"\n"
              "radius_mm = 10\n[model]\nlevel = \"elastic\"\n[model.elastic]\nwindow = 41\ncycles = 100\n");
    const std::vector<std::string> words{"train", scene, "--headless", "--seconds", "0.02", "--record", record};
    expectRefusal(words, "and there is 1 ms: choose a coarser [model]");
    EXPECT_FALSE(std::filesystem::exists(record));
    auto insisting = words;
    insisting.emplace_back("--anyway");
    EXPECT_EQ(figures(insisting)["model"], "elastic");
    EXPECT_TRUE(haptics::Record(record).complete());
}

// Also while a scene is loaded, and in a benchmark.
TEST(Interrupt, EndsWhatHasNothingToEndInOrderWithOneLine)
{
    constexpr std::array signals{SIGINT, SIGTERM, SIGHUP, SIGQUIT};
    const std::vector<std::vector<std::string>> commands{
        {"phantom", "breast", "--voxel", "0.3", "-o", "/dev/null"}, {"bench", "tick"}, {"bench", "needle"}, {"stability"}};
    for (const auto& words : commands) {
        std::array<std::unique_ptr<Program>, signals.size()> programs;
        for (auto& program : programs) {
            program = std::make_unique<Program>("palpate", words);
        }
        for (std::size_t i = 0; i < signals.size(); ++i) {
            ASSERT_TRUE(catches(*programs[i], signals[i])) << words[0];
        }
        std::this_thread::sleep_for(300ms);
        for (std::size_t i = 0; i < signals.size(); ++i) {
            ASSERT_TRUE(programs[i]->running()) << words[0];
            programs[i]->send(signals[i]);
        }
        for (std::size_t i = 0; i < signals.size(); ++i) {
            const Outcome outcome = programs[i]->wait();
            EXPECT_EQ(outcome.status, 128 + signals[i]) << words[0];
            EXPECT_EQ(outcome.err, "palpate: interrupted\n") << words[0];
        }
    }
}

TEST(Session, AnInterruptAfterItsEndStopsTheWaitForPictures)
{
    const WithViewer copy("exec sleep 20");
    Program train(copy / "palpate", copy.arguments());
    const auto over = [&] { return std::filesystem::exists(copy.record()) && haptics::Record(copy.record()).complete(); };
    ASSERT_TRUE(eventually([&] { return !train.running() || over(); }));
    ASSERT_TRUE(train.running());
    std::this_thread::sleep_for(100ms);  // from the last byte of the record to the wait
    train.send(SIGINT);
    EXPECT_EQ(train.wait().status, 128 + SIGINT);
}

}  // namespace
}  // namespace palpate::apps
