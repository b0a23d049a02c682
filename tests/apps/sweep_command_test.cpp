#include <sweep/plan.h>
#include <tests/apps/program.h>
#include <tests/apps/sweep_plan.h>

#include <gtest/gtest.h>

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <random>
#include <thread>

namespace palpate::apps {
namespace {

using nlohmann::json;

constexpr int patience = 600;  // looks of 50 ms

// Starts the sweep and waits until it has so many cases.
void runUntil(Program& sweep, const std::filesystem::path& folder, std::size_t cases)
{
    for (int i = 0; i < patience && sweep.running() && casesIn(folder) < cases; ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
}

class Sweep : public testing::Test {
protected:
    std::string plan(const std::string& name, const std::string& text)
    {
        writeText(here_ / name, text);
        return here_ / name;
    }
    std::string folder(const std::string& name) { return here_ / name; }

private:
    Folder here_;
};

TEST_F(Sweep, TheTableHoldsEveryCaseAndDoesNotDependOnTheProcesses)
{
    const std::string file = plan("p.toml", shortPlan(2));
    const json one = figures({"sweep", file, "-o", folder("one"), "--jobs", "1"});
    EXPECT_EQ(one["cases"], 24);
    EXPECT_EQ(one["done"], 24);
    EXPECT_EQ(one["failed"], 0);
    figures({"sweep", file, "-o", folder("three"), "--jobs", "3"});
    EXPECT_EQ(sameOnEveryRun(folder("one")), sameOnEveryRun(folder("three")));
    const auto rows = csvRows(std::filesystem::path(folder("one")) / "table.csv");
    ASSERT_EQ(rows.size(), 25U);
    EXPECT_EQ(rows[0],
              (std::vector<std::string>{"case", "point", "repeat", "seed", "youngs_kpa", "depth_mm", "force_n", "work_mj",
                                        "force_in_jnd", "error", "build", "machine", "tick_us", "case_s"}));
    // Deeper and stiffer take more force; the formula is what it says.
    const auto force = [&](std::size_t c) { return std::stod(rows[c + 1][6]); };
    EXPECT_GT(force(2), force(0));
    EXPECT_GT(force(8), force(0));
    EXPECT_DOUBLE_EQ(std::stod(rows[1][8]), force(0) / 0.07);
    // The database says the same.
    const Outcome sqlite =
        Program("/usr/bin/sqlite3", {folder("one") + "/table.db", "SELECT count(*), round(sum(force_n), 6) FROM results"})
            .wait();
    double sum = 0;
    for (std::size_t c = 0; c < 24; ++c) {
        sum += force(c);
    }
    EXPECT_EQ(sqlite.out.substr(0, 3), "24|");
    EXPECT_NEAR(std::stod(sqlite.out.substr(3)), sum, 1e-5);
}

// Killed three times at moments that chance chooses, and once more when it is done.
TEST_F(Sweep, ResumedAfterKillsTheTableIsTheSame)
{
    const std::string file = plan("p.toml", shortPlan(4));
    figures({"sweep", file, "-o", folder("whole"), "--jobs", "2"});
    std::mt19937 random(std::random_device{}());
    std::size_t before = 0;
    for (int kills = 0; kills < 3; ++kills) {
        Program sweep("palpate", {"sweep", file, "-o", folder("killed"), "--jobs", "2"});
        runUntil(sweep, folder("killed"), before + 1 + random() % 10);
        sweep.send(SIGKILL);
        sweep.wait();
        const std::size_t now = casesIn(folder("killed"));
        EXPECT_GE(now, before) << "a finished case was lost";
        before = now;
    }
    const json last = figures({"sweep", "-o", folder("killed"), "--jobs", "2"});
    EXPECT_EQ(last["done"], 48);
    EXPECT_EQ(sameOnEveryRun(folder("whole")), sameOnEveryRun(folder("killed")));
    const json nothing = figures({"sweep", file, "-o", folder("killed")});
    EXPECT_EQ(nothing["seconds"], 0.0);
}

TEST_F(Sweep, CtrlCFinishesWhatRunsAndGoesOnLater)
{
    const std::string file = plan("p.toml", shortPlan(20));
    Program sweep("palpate", {"sweep", file, "-o", folder("s"), "--jobs", "2"});
    runUntil(sweep, folder("s"), 3);
    sweep.send(SIGINT);
    const Outcome outcome = sweep.wait();
    EXPECT_EQ(outcome.status, 1);
    EXPECT_NE(outcome.err.find("palpate: interrupted: "), std::string::npos) << outcome.err;
    const std::size_t there = csvRows(std::filesystem::path(folder("s")) / "table.csv").size() - 1;
    EXPECT_EQ(there, casesIn(folder("s")));
    EXPECT_LT(there, 240U);
    EXPECT_FALSE(std::filesystem::exists(folder("s") + "/lock"));
}

// A lump outside the body, and processes that die: rows with their error, not the end.
TEST_F(Sweep, ACaseThatFailsIsARow)
{
    const std::string file = plan(
        "p.toml",
        "scene = \"find-lump\"\noutputs = [\"force_n\"]\n[procedure]\nkind = \"press\"\nspeed_mm_s = 80\nhold_ms = 25\n"
        "[set]\nvolume.voxel_mm = 4\nvolume.parameters.width_mm = 40\nmodel.setting = \"fast\"\ninsert.lump.centre_mm.x = "
        "0\n"
        "insert.lump.centre_mm.z = 0\n[[axis]]\nname = \"y_mm\"\nkey = \"insert.lump.centre_mm.y\"\nvalues = [12, 400, "
        "16]\n");
    const json done = figures({"sweep", file, "-o", folder("s"), "--jobs", "1"});
    EXPECT_EQ(done["done"], 3);
    EXPECT_EQ(done["failed"], 1);
    const auto rows = csvRows(std::filesystem::path(folder("s")) / "table.csv");
    EXPECT_GT(std::stod(rows[1][5]), 0.0);
    EXPECT_EQ(rows[2][5], "");
    EXPECT_NE(readText(folder("s") + "/table.csv").find("there is no tissue of the volume"), std::string::npos);
}

TEST_F(Sweep, AProcessThatCrashesCostsItsCaseAndOneThatIsKilledNone)
{
    const std::string file = plan("p.toml", shortPlan(10));
    Program sweep("palpate", {"sweep", file, "-o", folder("s"), "--jobs", "2"});
    runUntil(sweep, folder("s"), 1);
    for (const int signal : {SIGSEGV, SIGKILL}) {
        const auto children = childrenOf(sweep.pid());
        ASSERT_FALSE(children.empty());
        kill(children.front(), signal);
        runUntil(sweep, folder("s"), casesIn(folder("s")) + 4);
    }
    EXPECT_EQ(sweep.wait().status, 0);
    std::size_t failed = 0;
    for (const auto& row : csvRows(std::filesystem::path(folder("s")) / "table.csv")) {
        failed += row[9].find("signal 11") != std::string::npos ? 1 : 0;
        EXPECT_EQ(row[9].find("signal 9"), std::string::npos);
    }
    EXPECT_LE(failed, 1U);
    const json again = figures({"sweep", "-o", folder("s"), "--retry"});
    EXPECT_EQ(again["failed"], 0);
    EXPECT_EQ(again["done"], 120);
}

TEST_F(Sweep, TwoRunsOnAFolderExcludeEachOther)
{
    const std::string file = plan("p.toml", shortPlan(40));
    Program sweep("palpate", {"sweep", file, "-o", folder("s"), "--jobs", "1"});
    runUntil(sweep, folder("s"), 1);
    const int holder = sweep.pid();
    expectRefusal({"sweep", file, "-o", folder("s")}, "another run works on it (process " + std::to_string(holder));
    sweep.send(SIGKILL);
    sweep.wait();
    // The lock of the dead is gone, whatever its file still says; what it says is not what counts.
    EXPECT_EQ(json::parse(readText(folder("s") + "/lock")).at("process"), holder);
    Program next("palpate", {"sweep", "-o", folder("s"), "--jobs", "1"});
    const std::size_t before = casesIn(folder("s"));
    runUntil(next, folder("s"), before + 1);
    EXPECT_GT(casesIn(folder("s")), before);
}

TEST_F(Sweep, AFullDiskIsOneLine)
{
    const std::string file = plan("p.toml", shortPlan(2));
    const std::string program = std::filesystem::path(PALPATE_BIN_DIR) / "palpate";
    // No file over 4 kB: the cases have room, the table has none.
    const Outcome full =
        Program("/bin/bash", {"-c", "ulimit -f 4; exec " + program + " sweep " + file + " -o " + folder("s")}).wait();
    EXPECT_EQ(full.status, 1);
    EXPECT_EQ(std::ranges::count(full.err, '\n'), 1) << full.err;
    EXPECT_NE(full.err.find("cannot be written"), std::string::npos) << full.err;
    EXPECT_EQ(casesIn(folder("s")), 24U);
    EXPECT_EQ(figures({"sweep", "-o", folder("s")})["done"], 24);
}

TEST_F(Sweep, DryRunSaysWhatItTakesAndLeavesNothing)
{
    const std::string file = plan("p.toml", shortPlan(5));
    const json dry = figures({"sweep", file, "--dry-run", "--jobs", "2"});
    EXPECT_EQ(dry["cases"], 60);
    EXPECT_GT(dry["case_s"], 0.0);
    EXPECT_NEAR(dry["estimated_s"].get<double>(), 30 * dry["case_s"].get<double>(), 1e-9);
    EXPECT_NEAR(dry["disk_mb"].get<double>(), 60 * 4096e-6, 1e-9);
    expectRefusal({"sweep", "-o", folder("s")}, "holds no sweep");
    expectRefusal({"sweep", file, "-o", file}, "is a file");
    const std::string said = palpate({"sweep", file, "--dry-run", "--jobs", "1000"}).out;
    EXPECT_NE(said.find(" s on 1000 processes"), std::string::npos) << said;
    EXPECT_EQ(said.find(": 0 s on"), std::string::npos) << said;
}

// Case 0 of three has its lump outside the body: what the others take is estimated. Where all fail there is no estimate.
TEST_F(Sweep, ADryRunLeavesFailedCasesOut)
{
    const auto text = [](const std::string& values) {
        return "scene = \"find-lump\"\noutputs = [\"force_n\"]\n[procedure]\nkind = \"press\"\nspeed_mm_s = 80\nhold_ms = "
               "25\n[set]\nvolume.voxel_mm = 4\nvolume.parameters.width_mm = 40\nmodel.setting = \"fast\"\n"
               "insert.lump.centre_mm.x = 0\ninsert.lump.centre_mm.z = 0\n"
               "[[axis]]\nkey = \"insert.lump.centre_mm.y\"\nvalues = " +
               values + "\n";
    };
    const Outcome some = palpate({"sweep", plan("some.toml", text("[400, 12, 500]")), "--dry-run"});
    EXPECT_EQ(some.status, 0);
    EXPECT_NE(some.out.find("measured on 1 case:"), std::string::npos) << some.out;
    expectRefusal({"sweep", plan("none.toml", text("[400, 500, 600]")), "--dry-run"},
                  "every case that was tried failed: case 0 fails: ");
}

TEST_F(Sweep, RecordsReplay)
{
    std::string text = shortPlan(1, "records = true\n");
    text.replace(text.find("steps = 3"), 9, "steps = 2");
    text.replace(text.find("[1, 2, 3, 4]"), 12, "[2]");
    figures({"sweep", plan("p.toml", text), "-o", folder("s"), "--jobs", "2"});
    for (const char* const record : {"0.db", "1.db"}) {
        EXPECT_TRUE(figures({"replay", folder("s") + "/records/" + record})["identical"].get<bool>());
        const Outcome started =
            Program("/usr/bin/sqlite3", {folder("s") + "/records/" + record,
                                         "SELECT julianday('now') - julianday(value) FROM session WHERE key = 'started'"})
                .wait();
        EXPECT_LT(std::stod(started.out), 0.1);  // [days]
    }
    const std::string program = std::filesystem::path(PALPATE_BIN_DIR) / "palpate";
    const Outcome nowhere =
        Program("/usr/bin/env", {"TMPDIR=/none", program, "sweep", folder("s") + "/plan.toml", "--dry-run"}).wait();
    EXPECT_EQ(nowhere.err, "palpate: TMPDIR=/none: there is no such folder for the records of these cases\n");
    // A record that cannot be begun is no fault of its case.
    const std::filesystem::path home = folder("s"), record = home / "records/0.db";
    std::filesystem::remove(home / "cases/000/0.json");
    std::filesystem::remove(record);
    std::filesystem::create_directories(record / "in the way");
    expectRefusal({"sweep", "-o", folder("s")}, "0.db: exists already");
    std::filesystem::remove_all(record);
    EXPECT_EQ(figures({"sweep", "-o", folder("s")})["failed"], 0);
}

TEST_F(Sweep, RefusesWhatCannotBe)
{
    const std::string file = plan("p.toml", shortPlan(1)), other = plan("q.toml", shortPlan(2));
    expectRefusal({"sweep", file}, "add -o DIR");
    expectRefusal({"sweep", "moon", "-o", folder("s")}, "ready plans are: palpation");
    writeText(plan("x", ""), "");
    expectRefusal({"sweep", file, "-o", std::filesystem::path(file).parent_path().string()},
                  "is not empty and holds no sweep");
    figures({"sweep", file, "-o", folder("s"), "--jobs", "2"});
    expectRefusal({"sweep", other, "-o", folder("s")}, "holds another plan");
    // The plan of the folder itself, by hand: its table would have new parameters beside old results.
    for (const char* const own : {"plan.toml", "scene.toml"}) {
        const std::string text = readText(folder("s") + "/" + own);
        writeText(folder("s") + "/" + own, text + "# edited\n");
        expectRefusal({"sweep", "-o", folder("s")}, std::string(own) + ": was changed since the sweep began");
        writeText(folder("s") + "/" + own, text);
    }
    figures({"sweep", "-o", folder("s")});
    expectRefusal({"sweep", "--report", folder("s"), "-o", folder("s")}, "excludes --report");
    expectRefusal({"sweep", file, "--dry-run", "--shard", "1/2"}, "excludes");
    expectRefusal({"sweep", file, "-o", folder("s"), "--time", "10"}, "--slurm");
    expectRefusal({"sweep", "--report", folder("none")}, "holds no sweep: name the folder of a sweep");
    expectRefusal({"sweep", file, "-o", "/proc/x"}, "choose another place");
    std::string air = shortPlan(1);
    air.replace(air.find("log_range = [1, 9]\nsteps = 3"), 28, "values = [0, 5]");
    expectRefusal({"sweep", plan("air.toml", air), "--dry-run"},
                  "air.toml: case 0: [tissue.fat] youngs_kpa = 0 kPa: must be 0.01 to 2e+07 kPa");
}

// What is refused leaves no folder that a merge would take for a shard, and no script that is not submitted.
TEST_F(Sweep, WhatIsRefusedLeavesNothing)
{
    const std::string file = plan("p.toml", shortPlan(1));
    for (const char* const cases : {"0-99", "12"}) {
        expectRefusal({"sweep", file, "-o", folder("s"), "--cases", cases}, "the plan has the cases 0 to 11");
        EXPECT_FALSE(std::filesystem::exists(folder("s")));
    }
    const Outcome alone = Program("/usr/bin/env", {"PATH=/none", std::filesystem::path(PALPATE_BIN_DIR) / "palpate",
                                                   "sweep", file, "-o", folder("s"), "--slurm"})
                              .wait();
    EXPECT_EQ(alone.err, "palpate: sbatch: there is no Slurm here: run without --slurm\n");
    EXPECT_FALSE(std::filesystem::exists(folder("s") + "/slurm"));
    expectRefusal({"sweep", "-o", folder("s"), "--cases", "12"}, "the plan has the cases 0 to 11");
    EXPECT_FALSE(std::filesystem::exists(folder("s") + "/shards"));
}

TEST_F(Sweep, TheExampleOfTheDocumentIsAPlan)
{
    const std::string page = readText(PALPATE_SOURCE_DIR "/docs/sweeps.md");
    const auto begin = page.find("```toml\n") + 8;
    const std::string text = page.substr(begin, page.find("```", begin) - begin);
    const auto example = sweep::parsePlan(text, "example.toml", sweep::namedScene);
    EXPECT_EQ(example.cases(), 12U);
    EXPECT_EQ(example.marks.size(), 1U);
}

TEST_F(Sweep, TheListHoldsReadyPlansAndOutputs)
{
    const std::string list = palpate({"sweep", "--list"}).out;
    for (const char* const name :
         {"palpation", "guidance", "needle-force", "voxel-size", "model-ladder", "puncture_force_n"}) {
        EXPECT_NE(list.find(name), std::string::npos) << name;
    }
}

}  // namespace
}  // namespace palpate::apps
