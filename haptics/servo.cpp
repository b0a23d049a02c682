#include <haptics/servo.h>

#include <glm/geometric.hpp>

#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <fstream>
#include <mutex>
#include <string>

namespace palpate::haptics {

namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr auto spin = 50us;   // what a sleep may come late without harm
constexpr int priority = 60;  // above everything ordinary, below the kernel's own threads

constexpr double longestStale = 0.05;  // [s]: the watchdog has faded the force to zero by then

double seconds(Clock::duration d) noexcept
{
    return std::chrono::duration<double>(d).count();
}

Clock::duration durationOf(double seconds) noexcept
{
    return std::chrono::nanoseconds(std::llround(1e9 * seconds));
}

void sleepUntil(Clock::time_point due) noexcept
{
    const auto wake = (due - spin).time_since_epoch();
    const auto whole = std::chrono::duration_cast<std::chrono::seconds>(wake);
    timespec t{};
    t.tv_sec = whole.count();
    t.tv_nsec = std::chrono::duration_cast<std::chrono::nanoseconds>(wake - whole).count();
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr) == EINTR) {
    }
    while (Clock::now() < due) {
    }
}

// Watches a thousand ticks at a time.
class Overload {
public:
    explicit Overload(std::uint64_t allowed) : allowed_(allowed) {}

    void add(bool late) noexcept
    {
        ++ticks_;
        late_ += late ? 1 : 0;
    }
    bool askStepDown() noexcept
    {
        const bool tooMany = allowed_ > 0 && late_ > allowed_;
        if (tooMany || ticks_ >= 1000) {
            late_ = ticks_ = 0;
        }
        return tooMany;
    }

private:
    std::uint64_t allowed_, late_ = 0, ticks_ = 0;
};

// Counts one period after the other.
class Punctuality {
public:
    explicit Punctuality(ServoTiming& timing) : timing_(timing) {}

    void add(bool missed) noexcept
    {
        if (!missed) {
            run_ = 0;
            return;
        }
        ++timing_.missed;
        timing_.gaps += run_ == 0 ? 1 : 0;
        timing_.longestGap = std::max(timing_.longestGap, ++run_);
    }

private:
    ServoTiming& timing_;
    std::uint64_t run_ = 0;  // missed ticks up to now
};

void addWork(ServoTiming& timing, const TickRecord& record, Clock::duration work) noexcept
{
    ++timing.ticks;
    timing.work.add(seconds(work));
    for (std::size_t i = 0; i < taskCount; ++i) {
        timing.tasks[i].add(static_cast<double>(record.seconds[i]));
    }
}

TickRecord oneTick(Device& device, Simulation& simulation, bool late, bool overloaded, bool fading) noexcept
{
    const auto start = Clock::now();
    DeviceSample sample = device.read();
    sample.buttons |= overloaded ? modelTooSlow : 0U;
    sample.fresh = sample.fresh && !late && !fading;
    const auto read = Clock::now();
    TickRecord record = simulation.tick(sample);
    const auto computed = Clock::now();
    device.write(record.total);
    device.observe(record);
    record.seconds[static_cast<std::size_t>(Task::h2)] = static_cast<float>(seconds(read - start));
    record.seconds[static_cast<std::size_t>(Task::h5)] = static_cast<float>(seconds(Clock::now() - computed));
    return record;
}

// The way into a pause and out of it.
class Pause {
public:
    Pause(const PauseHooks& hooks, bool paced) : hooks_(hooks), may_(paced && hooks.asked) {}

    // Before a tick: whether its pose counts as old, so that the force fades.
    bool begins() { return fading_ = may_ && hooks_.asked(); }
    // After it: whether the force is gone.
    bool reached(const TickRecord& record) noexcept
    {
        faded_ = fading_ ? faded_ + 1 : 0;
        return faded_ >= PauseHooks::fadeTicks && glm::length(record.total) < 1e-9;
    }
    void stand(Device& device, Vec3 place, Clock::duration period, const std::atomic<bool>& stop, ServoTiming& timing)
    {
        const auto since = Clock::now();
        auto due = since + period;
        while (!device.finished() && !stop.load(std::memory_order_relaxed)) {
            sleepUntil(due);
            due = std::max(due, Clock::now() - period) + period;
            const DeviceSample sample = device.read();
            device.write(Vec3(0.0));
            const bool elsewhere = !(glm::distance(sample.position, place) < PauseHooks::backAgain);
            const bool asked = hooks_.asked();
            if (!asked && !elsewhere) {
                break;
            }
            if (hooks_.standing) {
                hooks_.standing(!asked);
            }
        }
        faded_ = 0;
        ++timing.pauses;
        timing.paused += seconds(Clock::now() - since);
    }

private:
    const PauseHooks& hooks_;
    bool may_, fading_ = false;
    int faded_ = 0;  // ticks
};

// Whether the process has locked memory.
bool hasLocked()
{
    std::ifstream status("/proc/self/status");
    std::string word;
    while (status >> word && word != "VmLck:") {
    }
    std::uint64_t kilobytes = 0;
    return status >> kilobytes && kilobytes > 0;
}

// The lock is the process's, whoever asked for it: one count for all claims.
class LockedMemory {
public:
    // False where it is not permitted; errno says why.
    bool claim()
    {
        const std::lock_guard lock(guard_);
        kept_ = claims_ > 0 ? kept_ : hasLocked();
        if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
            return false;
        }
        ++claims_;
        return true;
    }
    void release()
    {
        const std::lock_guard lock(guard_);
        if (--claims_ == 0 && !kept_) {
            munlockall();
        }
    }

private:
    std::mutex guard_;
    int claims_ = 0;
    bool kept_ = false;  // somebody else locked it before
};

LockedMemory lockedMemory;

}  // namespace

ServoTiming runServo(Device& device, Simulation& simulation, const ServoOptions& options, const TickSink& sink,
                     const std::atomic<bool>& stop)
{
    ServoTiming timing;
    timing.paced = options.paced;
    Punctuality periods(timing);
    Overload overload(options.lateAllowed);
    Pause pause(options.pause, options.paced);
    const Clock::duration period = durationOf(simulation.period());
    const int mostStale = static_cast<int>(std::lround(longestStale / simulation.period()));
    auto due = Clock::now() + period;
    int stale = 0;  // ticks that the force still fades, after a gap
    while (!device.finished() && !stop.load(std::memory_order_relaxed)) {
        if (options.seconds > 0.0 && static_cast<double>(timing.ticks) * simulation.period() >= options.seconds) {
            break;
        }
        if (options.paced) {
            sleepUntil(due);
        }
        const auto start = Clock::now();
        const TickRecord record =
            oneTick(device, simulation, stale > 0, options.paced && overload.askStepDown(), pause.begins());
        stale = std::max(0, stale - 1);
        const auto sent = Clock::now();
        addWork(timing, record, sent - start);
        timing.overruns += sent - start > period ? 1 : 0;
        if (options.paced) {
            timing.lateness.add(seconds(start - due));
            due += period;
            periods.add(sent > due);
            overload.add(sent > due);
        }
        sink(record, timing);
        if (pause.reached(record)) {
            pause.stand(device, record.device.position, period, stop, timing);
            due = Clock::now() + period;
        }
        const auto now = Clock::now();
        while (options.paced && now > due + period) {
            due += period;
            periods.add(true);
            stale = std::min(stale + 1, mostStale);
        }
    }
    device.write(Vec3(0.0));
    return timing;
}

RealTimeClaim::RealTimeClaim()
{
    sched_param parameters{};
    parameters.sched_priority = priority;
    if (sched_setscheduler(0, SCHED_FIFO, &parameters) != 0) {
        prctl(PR_SET_TIMERSLACK, 1UL);
        warnings_.push_back("no real-time priority (SCHED_FIFO: " + std::string(std::strerror(errno)) +
                            "): ticks may come late under load; allow it with 'ulimit -r 60' or run as root");
    }
    locked_ = lockedMemory.claim();
    if (!locked_) {
        warnings_.push_back("memory is not locked (mlockall: " + std::string(std::strerror(errno)) +
                            "): a page fault may delay a tick; allow it with 'ulimit -l unlimited' or run as root");
    }
}

RealTimeClaim::~RealTimeClaim()
{
    if (locked_) {
        lockedMemory.release();
    }
}

}  // namespace palpate::haptics
