#include <tests/apps/program.h>
#include <tests/apps/slurm.h>
#include <tests/apps/sweep_plan.h>

#include <gtest/gtest.h>

#include <signal.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <thread>

namespace palpate::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// The process of a task that works on the folder; 0: none.
int workerOn(const std::string& folder)
{
    std::error_code none;
    for (const auto& entry : fs::directory_iterator("/proc", none)) {
        const int pid = std::atoi(entry.path().filename().c_str());
        const std::string words = pid > 0 ? readText(entry.path() / "cmdline") : "";
        if (words.find("--work") != std::string::npos && words.find(folder) != std::string::npos &&
            words.find("slurm_script") == std::string::npos) {
            return pid;
        }
    }
    return 0;
}

std::size_t filesOf(const std::string& folder, const char* ending)
{
    std::size_t count = 0;
    for (const auto& entry : fs::directory_iterator(folder + "/slurm")) {
        count += entry.path().extension() == ending ? 1 : 0;
    }
    return count;
}

// A task is killed in the middle of the sweep: its cases are submitted again, and the table is that of one machine. Half of
// the cases are done here before, by processes of this machine.
TEST(SweepOnSlurm, ItsTableIsThatOfOneMachineAlsoWhenATaskIsKilled)
{
    const Slurm slurm;
    if (!slurm.problem().empty()) {
        GTEST_SKIP() << "no Slurm to test with: " << slurm.problem();
    }
    const Folder here;
    const std::string plan = here / "p.toml", local = here / "local", cluster = here / "100% of a cluster";
    writeText(plan, shortPlan(8));
    figures({"sweep", plan, "-o", local, "--jobs", "2"});

    Program begun("palpate", {"sweep", plan, "-o", cluster, "--jobs", "1"});
    for (int i = 0; i < 600 && casesIn(cluster) < 4; ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    begun.send(SIGINT);
    begun.wait();

    const std::size_t before = casesIn(cluster);
    Program sweep("palpate",
                  {"sweep", "-o", cluster, "--slurm", "--chunk", "24", "--partition", "main", "--json", here / "f.json"});
    bool killed = false;
    for (int i = 0; i < 3000 && !killed && sweep.running(); ++i) {
        const int worker = casesIn(cluster) > before ? workerOn(cluster) : 0;
        killed = worker > 0 && kill(worker, SIGKILL) == 0;
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    EXPECT_TRUE(killed) << "no task was there to be killed";
    const Outcome outcome = sweep.wait();
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_GE(filesOf(cluster, ".sh"), 2U) << "what was lost must be submitted again";
    EXPECT_GT(filesOf(cluster, ".log"), 0U) << "of tasks";
    const json done = json::parse(readText(here / "f.json"));
    EXPECT_EQ(done["done"], 96);
    EXPECT_EQ(done["failed"], 0);
    EXPECT_EQ(sameOnEveryRun(local), sameOnEveryRun(cluster));
    expectRefusal({"sweep", plan, "-o", here / "refused", "--slurm", "--partition", "nowhere"}, "sbatch: ");
}

// A cluster in four files. Tasks of its first job are never there. Those of the second wait in the queue for longer than
// the files of a task that has ended may take, and squeue has warnings on both of its streams.
void writeForgetfulCluster(const Folder& place)
{
    const std::string d = place.path().string();
    writeText(place / "sbatch", "#!/bin/sh\nn=$(($(cat " + d + "/jobs || echo 0) + 1))\necho $n > " + d +
                                    "/jobs\necho 'sbatch: a warning' >&2\necho $n\n[ $n = 1 ] && exit 0\ntouch " + d +
                                    "/2\n(sleep 3; SLURM_ARRAY_TASK_ID=0 sh $2; rm " + d +
                                    "/2) > /dev/null 2>&1 < /dev/null &\n");
    writeText(place / "squeue",
              "#!/bin/sh\necho 'squeue: slurm.conf differs' >&2\necho 'slurm.conf differs, and this is line 0'\n"
              "[ -e " +
                  d + "/$4 ] && echo '0 RUNNING'\nexit 0\n");
    writeText(place / "scancel", "#!/bin/sh\necho \"$@\" >> " + d + "/cancelled\n");
    for (const char* const program : {"sbatch", "squeue", "scancel"}) {
        fs::permissions(place / program, fs::perms::owner_all);
    }
}

// Tasks that the queue shows are not submitted again, whatever else the tools say; a task that it does not show is
// cancelled before its cases are another's.
TEST(SweepOnSlurm, WarningsAreNoPartOfTheQueueAndALostTaskIsCancelled)
{
    const Folder place, here;
    writeForgetfulCluster(place);
    writeText(here / "p.toml", shortPlan(1));
    const std::string program = fs::path(PALPATE_BIN_DIR) / "palpate", path = std::getenv("PATH");
    const Outcome outcome = Program("/usr/bin/env", {"PATH=" + place.path().string() + ":" + path, program, "sweep",
                                                     here / "p.toml", "-o", here / "s", "--slurm", "--chunk", "12"})
                                .wait();
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(filesOf(here / "s", ".sh"), 2U) << "a task that runs was submitted again";
    EXPECT_EQ(readText(place / "cancelled"), "1_0\n");
    EXPECT_EQ(casesIn(here / "s"), 12U);
}

}  // namespace
}  // namespace palpate::apps
