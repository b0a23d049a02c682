#include <studies/thesis/tasks_measure.h>

#include <base/quantiles.h>
#include <haptics/servo.h>
#include <haptics/simulation.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <iterator>
#include <numbers>
#include <numeric>
#include <thread>
#include <utility>

namespace palpate::studies {

using namespace haptics;

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::uint64_t frameTicks = channel::frameTicks;
constexpr double swingSeconds = 0.33;  // there and back
constexpr double inside = 30e-3;       // [m]
constexpr double outsideBody = 15e-3;  // [m]
constexpr double wayIn = 0.1;          // speed of the needle into the block [m/s]

/// What one tick took [s].
struct TaskTimes {
    std::array<double, taskCount> task{};
    double publish = 0;
};

using Rig = std::function<TaskTimes(const DeviceSample&)>;

double lap(Clock::time_point& last) noexcept
{
    const auto now = Clock::now();
    return std::chrono::duration<double>(now - std::exchange(last, now)).count();
}

// A tool that goes to and fro along its axis.
struct Swing {
    Vec3 middle{0.0};     // [m]
    Vec3 axis{0, 1, 0};   // of the tool
    double reach = 2e-3;  // to both sides [m]

    DeviceSample at(std::uint64_t tick) const noexcept
    {
        const double phase = 2.0 * std::numbers::pi * static_cast<double>(tick) * tickSeconds / swingSeconds;
        return pose(middle + reach * std::sin(phase) * axis);
    }
    DeviceSample pose(Vec3 tip) const noexcept
    {
        DeviceSample sample;
        sample.position = tip;
        sample.axis = axis;
        sample.buttons = buttonDeadMan;
        return sample;
    }
};

// One tick per millisecond: sleeps until a little before it is due and spins the rest, as the servo loop does.
class Pace {
public:
    void wait() noexcept
    {
        due_ += std::chrono::milliseconds(1);
        std::this_thread::sleep_until(due_ - std::chrono::microseconds(50));
        while (Clock::now() < due_) {
        }
        due_ = std::max(due_, Clock::now() - std::chrono::milliseconds(1));
    }

private:
    Clock::time_point due_ = Clock::now();
};

// What one event's ticks took.
class Times {
public:
    Times(const TaskEvent& event, int frames) : event_(event)
    {
        const auto count = static_cast<std::size_t>(frames) * frameTicks;
        counted_.reserve(count);
        all_.reserve(count);
        for (auto& task : tasks_) {
            task.reserve(count);
        }
    }

    void add(const TaskTimes& t)
    {
        counted_.push_back(countedWork(event_, t.task, t.publish));
        all_.push_back(std::accumulate(t.task.begin(), t.task.end(), t.publish));
        for (std::size_t i = 0; i < taskCount; ++i) {
            tasks_[i].push_back(t.task[i]);
        }
        publish_ += t.publish;
    }

    EventTimes result() const
    {
        EventTimes out;
        out.event = event_.name;
        std::vector<double> frames;
        for (auto from = counted_.begin(); from != counted_.end(); from += frameTicks) {
            frames.push_back(std::accumulate(from, from + frameTicks, 0.0) / static_cast<double>(frameTicks));
        }
        out.process = base::upperMedian(std::move(frames));
        out.p50 = base::lowerQuantile(all_, 0.5);
        out.p99 = base::lowerQuantile(all_, 0.99);
        std::ranges::transform(tasks_, out.tasks.begin(), base::upperMedian);
        out.publish = publish_ / static_cast<double>(all_.size());
        return out;
    }

private:
    const TaskEvent& event_;
    std::vector<double> counted_, all_;
    std::array<std::vector<double>, taskCount> tasks_;
    double publish_ = 0;
};

EventTimes timeEvent(const TaskEvent& event, const EventOptions& options, const Swing& path, const Rig& rig)
{
    // What hardly varies needs fewer.
    const int frames = event.haptics ? options.frames : (options.frames + 1) / 2;
    Times times(event, frames);
    const auto ticks = static_cast<std::uint64_t>(frames) * frameTicks;
    Pace pace;
    for (std::uint64_t n = 0; n < frameTicks + ticks; ++n) {
        pace.wait();
        auto last = Clock::now();
        const DeviceSample sample = path.at(n);
        const double read = lap(last);
        TaskTimes t = rig(sample);
        t.task[static_cast<std::size_t>(Task::h2)] = read;
        // The first frame warms the caches.
        if (n >= frameTicks) {
            times.add(t);
        }
    }
    return times.result();
}

/// The loop in a session of ours. One simulation touches, one does not.
class TaskSession {
public:
    TaskSession(SessionModel& model, const Graphics* graphics)
        : model_(model), graphics_(graphics), touching_(model), free_(model)
    {
        const Vec3 line = model.approach.aim - model.approach.entry;
        in_.axis = out_.axis = glm::normalize(line);
        in_.middle = model.approach.entry + inside * in_.axis;
        out_.middle = model.approach.entry - outsideBody * out_.axis;
        idle_.device = out_.at(0);
        far_.fill({outsideBody, -out_.axis});
        const double step = wayIn * tickSeconds;
        for (double depth = -outsideBody; depth < inside; depth += step) {
            touching_.tick(in_.pose(model.approach.entry + depth * in_.axis));
        }
    }

    EventTimes time(const TaskEvent& event, const EventOptions& options)
    {
        model_.scene.dffb.mode = event.additional ? datasets::DffbMode::field : datasets::DffbMode::off;
        Simulation& simulation = event.touching ? touching_ : free_;
        return timeEvent(event, options, event.touching ? in_ : out_, [&](const DeviceSample& sample) {
            return event.haptics ? tick(simulation, event, sample) : idleTick(event, sample);
        });
    }

    /// Shows the session until a viewer draws it. False when none does.
    bool awaitViewer()
    {
        constexpr std::uint64_t enough = 20;        // beats: pictures have been drawn by then
        constexpr std::uint64_t patience = 20'000;  // [ticks]
        Pace pace;
        for (std::uint64_t n = 0; n < patience && !graphics_->lost(); ++n) {
            pace.wait();
            publish(free_.tick(out_.at(n)), free_);
            const auto input = graphics_->broadcast.input();
            if (input && input->beat >= enough) {
                return true;
            }
        }
        return false;
    }

private:
    TaskTimes tick(Simulation& simulation, const TaskEvent& event, const DeviceSample& sample)
    {
        const TickRecord& record = simulation.tick(sample);
        TaskTimes t;
        std::copy(record.seconds.begin(), record.seconds.end(), t.task.begin());
        auto last = Clock::now();
        sent_ = record.total;
        t.task[static_cast<std::size_t>(Task::h5)] = lap(last);
        if (event.graphics) {
            publish(record, simulation);
            t.publish = lap(last);
        }
        return t;
    }

    TaskTimes idleTick(const TaskEvent& event, const DeviceSample& sample)
    {
        TaskTimes t;
        auto last = Clock::now();
        if (event.additional) {
            sent_ = additionalForce(model_.scene.dffb, model_.structures.size(), far_, sample.position, false, tickSeconds,
                                    dffb_);
            t.task[static_cast<std::size_t>(Task::h7)] = lap(last);
        }
        if (event.graphics) {
            idle_.device = sample;
            publish(idle_, free_);
            t.publish = lap(last);
        }
        return t;
    }

    // Viewers see one session, whichever simulation it is.
    void publish(const TickRecord& record, const Simulation& simulation)
    {
        TickRecord shown = record;
        shown.tick = published_++;
        graphics_->broadcast.publish(shown, timing_, simulation);
    }

    SessionModel& model_;
    const Graphics* graphics_;
    Simulation touching_, free_;
    Swing in_, out_;
    ServoTiming timing_;
    TickRecord idle_;
    DffbState dffb_;
    std::array<Proximity, maxStructures> far_{};
    std::uint64_t published_ = 0;
    Vec3 sent_{0.0};
};

// The loop in a scene of objects.
class ObjectLoop {
public:
    ObjectLoop(const ObjectScene& scene, datasets::DffbParameters dffb) : scene_(scene), dffb_(dffb)
    {
        const auto& first = scene.objects().front();
        in_.middle = first.centre - 0.5 * first.radius * in_.axis;
        in_.reach = std::min(in_.reach, 0.4 * first.radius);  // never out of it
        out_.middle = -outsideBody * out_.axis;
    }

    EventTimes time(const TaskEvent& event, const EventOptions& options)
    {
        return timeEvent(event, options, event.touching ? in_ : out_,
                         [&](const DeviceSample& sample) { return tick(event, sample); });
    }

private:
    TaskTimes tick(const TaskEvent& event, const DeviceSample& sample)
    {
        TaskTimes t;
        auto last = Clock::now();
        const auto done = [&](Task task) { t.task[static_cast<std::size_t>(task)] = lap(last); };
        std::size_t touched = ObjectScene::none;
        Vec3 basic(0.0), additional(0.0);
        if (event.haptics) {
            touched = scene_.collide(sample.position);
            done(Task::h3);
            basic = scene_.feedback(touched, sample.position);
            done(Task::h4);
        }
        if (event.monitoring) {
            near_ = scene_.monitor(sample.position);
            done(Task::h6);
        }
        if (event.additional) {
            additional = additionalForce(dffb_, ObjectScene::monitored, near_, sample.position,
                                         touched != ObjectScene::none, tickSeconds, state_);
            done(Task::h7);
        }
        sent_ = basic + additional;
        done(Task::h5);
        return t;
    }

    const ObjectScene& scene_;
    datasets::DffbParameters dffb_;
    Swing in_, out_;
    std::array<Proximity, maxStructures> near_{};
    DffbState state_;
    Vec3 sent_{0.0};
};

// Runs in a thread of its own, so that real-time priority ends with it. What is built later is not to be locked in memory.
template <typename Run>
void inRealTime(Run&& run)
{
    std::exception_ptr problem;
    std::thread thread([&] {
        const RealTimeClaim claim;
        try {
            run();
        } catch (...) {
            problem = std::current_exception();
        }
    });
    thread.join();
    if (problem) {
        std::rethrow_exception(problem);
    }
}

}  // namespace

double countedWork(const TaskEvent& event, const std::array<double, taskCount>& task, double publish) noexcept
{
    const double all = std::accumulate(task.begin(), task.end(), publish);
    return event.monitoring ? all : all - task[static_cast<std::size_t>(Task::h6)];
}

std::vector<EventTimes> timeEvents(SessionModel& model, std::span<const TaskEvent> events, const Graphics* graphics,
                                   const EventOptions& options)
{
    std::vector<EventTimes> out;
    inRealTime([&] {
        TaskSession session(model, graphics);
        if (graphics != nullptr && !session.awaitViewer()) {
            return;
        }
        std::ranges::transform(events, std::back_inserter(out), [&](const auto& e) { return session.time(e, options); });
    });
    return out;
}

std::vector<EventTimes> timeEvents(const ObjectScene& scene, const datasets::DffbParameters& dffb,
                                   std::span<const TaskEvent> events, const EventOptions& options)
{
    std::vector<EventTimes> out;
    inRealTime([&] {
        ObjectLoop loop(scene, dffb);
        std::ranges::transform(events, std::back_inserter(out), [&](const auto& e) { return loop.time(e, options); });
    });
    return out;
}

std::vector<TaskEvent> eventsWith(std::span<const TaskEvent> all, bool graphics)
{
    std::vector<TaskEvent> out;
    std::ranges::copy_if(all, std::back_inserter(out), [&](const TaskEvent& e) { return e.graphics == graphics; });
    return out;
}

}  // namespace palpate::studies
