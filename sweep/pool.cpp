#include <sweep/pool.h>

#include <base/error.h>
#include <base/process.h>
#include <sweep/lock.h>

#include <fmt/format.h>

#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <memory>
#include <new>
#include <set>
#include <thread>

namespace palpate::sweep {

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t idle = static_cast<std::size_t>(-1);
constexpr int maxJobs = 1024;
constexpr auto lookEvery = std::chrono::milliseconds(20);
constexpr auto tellEvery = std::chrono::milliseconds(100);
constexpr double endsItself = 2;  // over its limit, in which a process may give its item up by itself [s]

// What the processes share: pages that a fork does not copy.
struct Shared {
    std::atomic<std::size_t> next{0}, done{0};
    std::atomic<bool> stop{false}, failed{false};
    std::array<std::atomic<std::size_t>, maxJobs> item{};
    std::array<char, 1024> error{};  // of the process that set `failed`
};

class SharedPages {
public:
    SharedPages()
    {
        void* const pages = mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
        base::failIf(pages == MAP_FAILED, "no memory for a pool of processes ({})", std::strerror(errno));
        shared_ = new (pages) Shared;
    }
    ~SharedPages() { munmap(shared_, sizeof(Shared)); }
    SharedPages& operator=(SharedPages&&) = delete;
    Shared& operator*() const { return *shared_; }

private:
    Shared* shared_;
};

void fail(Shared& shared, const char* what)
{
    if (!shared.failed.exchange(true)) {
        std::snprintf(shared.error.data(), shared.error.size(), "%s", what);
    }
    shared.stop = true;
}

// The life of one process; `first` before the items of the common queue.
[[noreturn]] void live(Shared& shared, std::size_t slot, std::size_t first, std::size_t count, pid_t parent,
                       const PoolWork& work)
{
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    signal(SIGINT, SIG_IGN);  // the parent decides what a Ctrl-C means
    signal(SIGTERM, SIG_DFL);
    signal(SIGHUP, SIG_IGN);
    if (getppid() != parent) {
        _exit(1);
    }
    try {
        const auto run = work.start();
        for (std::size_t i = first != idle ? first : shared.next++; i < count && !shared.stop; i = shared.next++) {
            shared.item[slot] = i;
            run(i);
            shared.item[slot] = idle;
            ++shared.done;
        }
    } catch (const std::exception& e) {
        fail(shared, e.what());
    }
    _exit(0);
}

double cpuOfChildren()
{
    rusage usage{};
    getrusage(RUSAGE_CHILDREN, &usage);
    const auto seconds = [](timeval t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); };
    return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

class Processes {
public:
    Processes(Shared& shared, std::size_t count, std::size_t jobs, const PoolWork& work)
        : shared_(shared), count_(count), work_(work), pids_(jobs, 0), tasks_(jobs)
    {
    }
    ~Processes()
    {
        kill();
        std::ranges::for_each(pids_, [](pid_t pid) { return pid > 0 ? waitpid(pid, nullptr, 0) : 0; });
    }
    Processes& operator=(Processes&&) = delete;

    // Not a part of the constructor: where the system gives no more processes, the destructor ends those that run.
    void start()
    {
        for (std::size_t slot = 0; slot < pids_.size(); ++slot) {
            start(slot, idle);
        }
    }

    void kill()
    {
        std::ranges::for_each(pids_, [](pid_t pid) { return pid > 0 ? ::kill(pid, SIGKILL) : 0; });
    }

    // Takes in those that have ended, and kills those that are over the limit; how many run.
    std::size_t look(bool abandoned)
    {
        std::size_t running = 0;
        for (std::size_t slot = 0; slot < pids_.size(); ++slot) {
            int status = 0;
            if (pids_[slot] > 0 && waitpid(pids_[slot], &status, WNOHANG) == pids_[slot]) {
                pids_[slot] = 0;
                ended(slot, status, abandoned);
            }
            if (pids_[slot] > 0) {
                ++running;
                watch(slot);
            }
        }
        return running;
    }

private:
    void start(std::size_t slot, std::size_t first)
    {
        shared_.item[slot] = idle;
        std::fflush(nullptr);
        const pid_t parent = getpid();
        const pid_t pid = fork();
        if (pid == 0) {
            live(shared_, slot, first, count_, parent, work_);
        }
        base::failIf(pid < 0, "a process cannot be started ({}): use fewer --jobs", std::strerror(errno));
        pids_[slot] = pid;
        tasks_[slot] = {};
    }

    // A process that stands still, or builds a model, gives no item up by itself.
    void watch(std::size_t slot)
    {
        const std::size_t item = shared_.item[slot];
        Task& task = tasks_[slot];
        if (task.item != item) {
            task = {item, Clock::now()};
        }
        const double seconds = std::chrono::duration<double>(Clock::now() - task.since).count();
        if (item != idle && !task.late && seconds > work_.limit + endsItself) {
            task.late = true;
            ::kill(pids_[slot], SIGKILL);
        }
    }

    void ended(std::size_t slot, int status, bool abandoned)
    {
        if (!WIFSIGNALED(status) || abandoned) {
            return;
        }
        const std::size_t item = shared_.item[slot];
        const int signal = WTERMSIG(status);
        const bool late = tasks_[slot].late && tasks_[slot].item == item;
        std::size_t again = idle;
        if (item != idle && !late && (signal == SIGKILL || signal == SIGTERM) && tried_.insert(item).second) {
            again = item;
        } else if (item != idle) {
            work_.lost(item, late ? fmt::format("took over {:g} s and its process was ended (case_limit_s in the plan)",
                                                work_.limit)
                                  : fmt::format("its process was ended by signal {} ({})", signal, strsignal(signal)));
            ++shared_.done;
        }
        if (!shared_.stop) {
            start(slot, again);
        }
    }

    // What a process works on, as it was seen.
    struct Task {
        std::size_t item = idle;
        Clock::time_point since;
        bool late = false;  // and was killed for it
    };

    Shared& shared_;
    std::size_t count_;
    const PoolWork& work_;
    std::vector<pid_t> pids_;
    std::vector<Task> tasks_;
    std::set<std::size_t> tried_;  // items that were killed once
};

}  // namespace

PoolResult runPool(std::size_t count, int jobs, const PoolWork& work)
{
    const SharedPages pages;
    Shared& shared = *pages;
    const auto begin = Clock::now();
    const double cpu = cpuOfChildren();
    const auto processes =
        std::min({count, static_cast<std::size_t>(std::max(jobs, 1)), static_cast<std::size_t>(maxJobs)});
    {
        Processes all(shared, count, processes, work);
        all.start();
        auto told = begin;
        while (const std::size_t running = all.look(work.abandoned())) {
            if (work.abandoned()) {
                all.kill();
            } else if (Clock::now() - told >= tellEvery) {
                told = Clock::now();
                shared.stop = !work.told(shared.done, running) || shared.stop;
            }
            std::this_thread::sleep_for(lookEvery);
        }
    }
    base::failIf(shared.failed, "{}", shared.error.data());
    return {shared.done, std::chrono::duration<double>(Clock::now() - begin).count(), cpuOfChildren() - cpu};
}

PoolResult runLocally(SweepFolder& folder, const std::vector<std::size_t>& cases, int jobs, const std::string& build,
                      const std::function<bool(std::size_t, std::size_t)>& told, const std::function<bool()>& abandoned)
{
    PoolWork work;
    work.start = [&] {
        folder.leaveLock();
        const auto runner = std::make_shared<CaseRunner>(folder.plan(), build);
        return [&folder, &cases, &build, runner](std::size_t item) {
            folder.write(runCase(*runner, folder, cases[item], build));
        };
    };
    work.lost = [&](std::size_t item, const std::string& why) {
        SweepRow row;
        row.index = cases[item];
        row.build = build;
        row.machine = base::hostName();
        row.error = why;
        folder.write(row);
    };
    work.told = told;
    work.abandoned = abandoned;
    work.limit = folder.plan().caseLimit;
    return runPool(cases.size(), jobs, work);
}

}  // namespace palpate::sweep
