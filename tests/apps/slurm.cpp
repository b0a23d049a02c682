#include <tests/apps/slurm.h>

#include <tests/apps/program.h>

#include <signal.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <random>
#include <thread>

namespace palpate::apps {

namespace fs = std::filesystem;

namespace {

const char* const daemons[] = {"slurmd", "slurmctld", "munged"};

Outcome shell(const std::string& command)
{
    return Program("/bin/sh", {"-c", command}).wait();
}

// Of a controller and a node that meet on the loopback.
std::string configuration(const std::string& d, const std::string& host, const std::string& user, int port)
{
    const std::string cpus = std::to_string(sysconf(_SC_NPROCESSORS_ONLN));
    return "ClusterName=test\nSlurmctldHost=" + host + "(127.0.0.1)\nSlurmUser=" + user + "\nSlurmdUser=" + user +
           "\nAuthType=auth/munge\nAuthInfo=socket=" + d +
           "/munge.sock\nCredType=cred/munge\nSlurmctldPort=" + std::to_string(port) +
           "\nSlurmdPort=" + std::to_string(port + 1) + "\nStateSaveLocation=" + d + "/state\nSlurmdSpoolDir=" + d +
           "/spool\nSlurmctldPidFile=" + d + "/slurmctld.pid\nSlurmdPidFile=" + d + "/slurmd.pid\nSlurmctldLogFile=" + d +
           "/slurmctld.log\nSlurmdLogFile=" + d +
           "/slurmd.log\nProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\nJobAcctGatherType=jobacct_gather/none\n"
           "AccountingStorageType=accounting_storage/none\nSwitchType=switch/none\nMpiDefault=none\nReturnToService=2\n"
           "SchedulerType=sched/backfill\nSchedulerParameters=sched_min_interval=100000,bf_interval=1,batch_sched_delay=0\n"
           "SelectType=select/"
           "cons_tres\nSelectTypeParameters=CR_CPU\nMinJobAge=300\nInactiveLimit=0\nKillWait=5\nWaittime=0\n"
           "NodeName=" +
           host + " NodeAddr=127.0.0.1 CPUs=" + cpus + " RealMemory=1000 State=UNKNOWN\nPartitionName=main Nodes=" + host +
           " Default=YES MaxTime=INFINITE State=UP OverSubscribe=NO\n";
}

}  // namespace

Slurm::Slurm()
{
    // Daemons lie beside what only root may start.
    setenv("PATH", (std::string(getenv("PATH")) + ":/usr/sbin:/sbin").c_str(), 1);
    for (const char* const daemon : daemons) {
        if (shell(std::string("command -v ") + daemon).status != 0) {
            problem_ = std::string(daemon) + " is not installed (Debian: slurm-wlm, munge)";
            return;
        }
    }
    start();
}

bool Slurm::run(const std::string& command, const std::string& what)
{
    const Outcome outcome = shell(command);
    if (outcome.status != 0) {
        problem_ = what + " does not start: " + outcome.err;
    }
    return outcome.status == 0;
}

void Slurm::start()
{
    const std::string d = folder_.path().string();
    chmod(d.c_str(), 0711);
    fs::create_directories(folder_ / "state");
    fs::create_directories(folder_ / "spool");
    std::mt19937 random(std::random_device{}());
    std::string key;
    for (int i = 0; i < 1024; ++i) {
        key += static_cast<char>(random());
    }
    writeText(folder_ / "munge.key", key);
    chmod((folder_ / "munge.key").c_str(), 0400);
    char host[256] = {};
    gethostname(host, sizeof host - 1);
    const std::string name = std::string(host).substr(0, std::string(host).find('.'));
    const std::string user = shell("id -un").out;
    const int port = 20000 + static_cast<int>(random() % 20000);
    writeText(folder_ / "slurm.conf", configuration(d, name, user.substr(0, user.find('\n')), port));
    setenv("SLURM_CONF", (folder_ / "slurm.conf").c_str(), 1);
    const bool started = run("munged --force --key-file=" + d + "/munge.key --socket=" + d + "/munge.sock --pid-file=" + d +
                                 "/munged.pid --log-file=" + d + "/munged.log --seed-file=" + d + "/munge.seed",
                             "munged") &&
                         run("slurmctld -c", "slurmctld") && run("slurmd", "slurmd");
    for (int i = 0; started && i < 200; ++i) {
        if (shell("sinfo -h -o %T").out.starts_with("idle")) {
            return;
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    if (started) {
        problem_ = "its node does not come up: " + readText(folder_ / "slurmd.log");
    }
}

Slurm::~Slurm()
{
    for (const char* const daemon : daemons) {
        const int pid = std::atoi(readText(folder_ / (std::string(daemon) + ".pid")).c_str());
        if (pid > 1) {
            kill(pid, SIGTERM);
            for (int i = 0; i < 50 && kill(pid, 0) == 0; ++i) {
                std::this_thread::sleep_for(std::chrono::milliseconds(50));
            }
        }
    }
    unsetenv("SLURM_CONF");
}

}  // namespace palpate::apps
