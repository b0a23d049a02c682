#include <studies/transfer/transfer.h>

#include <base/error.h>
#include <base/temporary_folder.h>
#include <channel/channel.h>
#include <haptics/broadcast.h>
#include <haptics/hand.h>
#include <session/session.h>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <new>
#include <stdexcept>
#include <thread>

namespace palpate::studies {

namespace {

using namespace haptics;

constexpr std::size_t maxMessages = 1U << 17U;
constexpr double startDistance = 30e-3;  // the hand begins this far outside the body [m]

// What goes through the pipe.
struct Message {
    std::uint64_t tick = 0;
    double sent = 0;  // [s]
    channel::Triple tip{};
};

// What the viewer's process has seen, in memory of both.
struct Seen {
    std::atomic<bool> ready{false}, stop{false};
    std::atomic<std::uint64_t> count{0};
    std::array<double, maxMessages> seconds;

    void add(double latency) noexcept
    {
        const std::uint64_t n = count.load(std::memory_order_relaxed);
        if (n < maxMessages) {
            seconds[n] = latency;
            count.store(n + 1, std::memory_order_release);
        }
    }
};

// CLOCK_MONOTONIC [s], the clock of State::published.
double now() noexcept
{
    timespec t{};
    clock_gettime(CLOCK_MONOTONIC, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

void sleepUntil(double time) noexcept
{
    timespec t{};
    t.tv_sec = static_cast<time_t>(time);
    t.tv_nsec = static_cast<long>((time - static_cast<double>(t.tv_sec)) * 1e9);
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr);
}

std::string failure(const std::string& what)
{
    return what + ": " + std::strerror(errno);
}

void receiveByMemory(const std::string& session, double setUp, Seen& seen)
{
    constexpr double spin = 150e-6;  // [s]
    std::optional<channel::Subscriber> viewer;
    while (!viewer && !seen.stop) {
        viewer = channel::Subscriber::attach(session);
        std::this_thread::sleep_for(std::chrono::milliseconds(viewer ? 0 : 1));  // its maker may need this core
    }
    seen.ready = true;
    sleepUntil(now() + setUp);
    std::uint64_t last = 0;
    while (!seen.stop) {
        const auto state = viewer->state();
        if (!state || state->published == last) {
            continue;
        }
        const double published = 1e-9 * static_cast<double>(state->published);
        seen.add(now() - published);
        last = state->published;
        sleepUntil(published + tickSeconds - spin);
    }
}

void receiveByPipe(const std::string& pipe, double setUp, Seen& seen)
{
    seen.ready = true;
    const int file = ::open(pipe.c_str(), O_RDONLY);
    sleepUntil(now() + setUp);
    Message message;
    while (::read(file, &message, sizeof message) == sizeof message) {
        seen.add(now() - message.sent);
    }
}

// The viewer's process; ended at the latest with this object.
class Receiver {
public:
    Receiver(const TransferOptions& options, const std::string& session, const std::string& pipe)
    {
        void* mapped =
            ::mmap(nullptr, sizeof(Seen), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
        base::failIf(mapped == MAP_FAILED, "{}", failure("no memory for what the viewer's process sees"));
        seen_ = new (mapped) Seen;
        id_ = ::fork();
        base::failIf(id_ < 0, "{}", failure("the viewer's process cannot be started"));
        if (id_ == 0) {
            // Whatever happens, this copy of the program runs no further.
            try {
                const RealTimeClaim claim;
                if (options.transport == Transport::sharedMemory) {
                    receiveByMemory(session, options.setUp, *seen_);
                } else {
                    receiveByPipe(pipe, options.setUp, *seen_);
                }
            } catch (...) {
                ::_exit(1);
            }
            ::_exit(0);
        }
    }
    Receiver& operator=(Receiver&&) = delete;
    ~Receiver()
    {
        seen_->stop = true;
        ::kill(id_, SIGKILL);
        ::waitpid(id_, nullptr, 0);
        ::munmap(seen_, sizeof(Seen));
    }

    void waitUntilReady() const
    {
        while (!seen_->ready) {
            siginfo_t ended{};
            base::failIf(
                ::waitid(P_PID, static_cast<id_t>(id_), &ended, WEXITED | WNOHANG | WNOWAIT) == 0 && ended.si_pid == id_,
                "the viewer's process has ended by itself");
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
    }
    std::vector<double> seconds() const
    {
        const auto count = static_cast<std::ptrdiff_t>(seen_->count.load(std::memory_order_acquire));
        return {seen_->seconds.begin(), seen_->seconds.begin() + count};
    }

private:
    Seen* seen_ = nullptr;
    pid_t id_ = -1;
};

// The writing end of a named pipe in a folder of its own.
class Pipe {
public:
    Pipe()
    {
        if (::mkfifo(name().c_str(), 0600) != 0) {
            throw std::runtime_error(failure(name() + ": no named pipe can be made here"));
        }
        // A reader that is gone is an error of write(), and no signal.
        std::signal(SIGPIPE, SIG_IGN);
    }
    ~Pipe() { close(); }

    std::string name() const { return folder_ / "position"; }
    /// Waits for the reader. Never blocks on a full pipe afterwards.
    void open()
    {
        file_ = ::open(name().c_str(), O_WRONLY);
        ::fcntl(file_, F_SETFL, O_NONBLOCK);
    }
    void close()
    {
        if (file_ >= 0) {
            ::close(file_);
        }
        file_ = -1;
    }
    void write(const Message& message) const noexcept
    {
        [[maybe_unused]] const auto written = ::write(file_, &message, sizeof message);
    }

private:
    base::TemporaryFolder folder_{"a named pipe"};
    int file_ = -1;
};

// Paced, in a thread of its own, with the scene's hand; `sink` as runServo()'s.
std::uint64_t runPaced(session::Session& session, double seconds, const TickSink& sink)
{
    HandDevice hand = handBefore(session.simulation().model(), startDistance);
    std::uint64_t ticks = 0;
    std::thread servo([&] {
        const RealTimeClaim claim;
        ticks = session.run(hand, {.servo = {true, seconds, 0}}, sink).ticks;
    });
    servo.join();
    return ticks;
}

}  // namespace

Transfer measureTransfer(const SessionModel& model, const TransferOptions& options)
{
    const RealTimeClaim claim;  // to lock memory takes time, in which a viewer would not be late
    const std::string name = "bench-ipc-" + std::to_string(::getpid());
    session::Session session(model, infoOf(model));
    Pipe pipe;
    const Receiver receiver(options, name, pipe.name());
    Transfer transfer;
    if (options.transport == Transport::sharedMemory) {
        Broadcast broadcast(name, model);
        receiver.waitUntilReady();
        transfer.sent = runPaced(session, options.seconds, [&](const TickRecord& r, const ServoTiming& timing) {
            broadcast.publish(r, timing, session.simulation());
        });
    } else {
        receiver.waitUntilReady();
        pipe.open();
        transfer.sent = runPaced(session, options.seconds, [&](const TickRecord& r, const ServoTiming&) {
            const Vec3 tip = r.tip();
            pipe.write({r.tick, now(), {tip.x, tip.y, tip.z}});
        });
        pipe.close();
    }
    // What is still on its way.
    std::this_thread::sleep_for(std::chrono::duration<double>(0.05 + options.setUp));
    transfer.seconds = receiver.seconds();
    return transfer;
}

namespace fs = std::filesystem;

std::vector<TimelinePicture> readTimeline(const fs::path& file)
{
    std::ifstream in(file);
    std::string head;
    std::getline(in, head);
    std::vector<TimelinePicture> pictures;
    char comma = 0;
    for (TimelinePicture p; in >> p.tick >> comma >> p.published >> comma >> p.read >> comma >> p.done;) {
        pictures.push_back(p);
    }
    base::failIf(pictures.size() < 2, "a viewer showed no pictures: its message is above");
    return pictures;
}

}  // namespace palpate::studies
