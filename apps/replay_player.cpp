#include <apps/replay_player.h>

#include <base/build.h>
#include <base/error.h>
#include <base/words.h>
#include <channel/channel.h>
#include <haptics/broadcast.h>
#include <haptics/record_check.h>
#include <haptics/replay.h>
#include <haptics/simulation.h>
#include <render/events.h>
#include <session/open.h>

#include <fmt/format.h>

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <chrono>
#include <cmath>
#include <limits>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace palpate::apps {

namespace {

using namespace haptics;

constexpr std::uint64_t maxStates = 300000, maxShapes = 3000;

// Everything there is to see of a record. One thread adds, another looks at what is there.
class Film {
public:
    explicit Film(std::uint64_t ticks)
        : stateStride_((ticks + maxStates - 1) / maxStates),
          shapeStride_(channel::frameTicks * ((ticks / channel::frameTicks + maxShapes) / maxShapes)),
          states_(ticks / stateStride_ + 1),
          shapes_(ticks / shapeStride_ + 1)
    {
    }

    void add(const channel::State& state, const Simulation& simulation, channel::Displaced& buffer)
    {
        if (state.tick % stateStride_ == 0) {
            states_[state.tick / stateStride_] = state;
        }
        if (state.tick % shapeStride_ == 0) {
            showShape(simulation, buffer);
            shapes_[state.tick / shapeStride_].assign(buffer.nodes.begin(), buffer.nodes.begin() + buffer.count);
        }
        ticks_.store(state.tick + 1, std::memory_order_release);
    }

    std::uint64_t ticks() const noexcept { return ticks_.load(std::memory_order_acquire); }
    const channel::State& state(std::uint64_t tick) const { return states_[tick / stateStride_]; }
    std::uint64_t shapeAt(std::uint64_t tick) const noexcept { return tick / shapeStride_; }
    const std::vector<channel::Displacement>& shape(std::uint64_t index) const { return shapes_[index]; }
    std::uint64_t shapeTick(std::uint64_t index) const noexcept { return index * shapeStride_; }

private:
    std::uint64_t stateStride_, shapeStride_;
    std::vector<channel::State> states_;
    std::vector<std::vector<channel::Displacement>> shapes_;
    std::atomic<std::uint64_t> ticks_{0};
};

std::uint64_t ticksOf(const Record& record, const std::string& file)
{
    const std::uint64_t ticks = record.ticks();
    base::failIf(ticks == 0, "{}: no tick was recorded: there is nothing to play", file);
    return ticks;
}

// The servo loop's result; a session that was cut off has none.
std::uint64_t missedIn(const Record& record)
{
    const std::string said = record.result("missed_ticks");
    std::uint64_t missed = 0;
    return std::from_chars(said.data(), said.data() + said.size(), missed).ec == std::errc() ? missed : channel::notCounted;
}

}  // namespace

struct ReplayPlayer::Impl {
    explicit Impl(const std::string& recordFile)
        : file(recordFile),
          record(recordFile),
          model(session::reopenSession(recordFile, record.info())),
          period(1.0 / record.info().rate),
          length(ticksOf(record, recordFile)),
          film(length),
          session(fmt::format("replay-{}", getpid())),
          publisher(publisherOf(session, model))
    {
        playback.length = static_cast<double>(length - 1) * period;
        try {
            computing = std::thread([this] { compute(); });
            showing = std::thread([this] { show(); });
        } catch (const std::system_error& e) {
            end();
            throw base::error("{}: cannot be played: no thread can be started ({}); end other programs", file, e.what());
        }
    }
    ~Impl() { end(); }

    void end()
    {
        stop = true;
        for (std::thread* thread : {&computing, &showing}) {
            if (thread->joinable()) {
                thread->join();
            }
        }
    }

    void blame(const char* words, const std::string& what)
    {
        const std::lock_guard lock(problemGuard);
        problem = problem.empty() ? what : problem;
        playback.fault = words;
    }

    // What a debrief goes to: each event begins a moment, those of one look are one.
    void noteMoments(const TickRecord& now)
    {
        constexpr double apart = 0.2;  // [s]
        const double time = static_cast<double>(now.tick) * period;
        if (now.eventCount > 0 && time > lastMoment + apart) {
            playback.moments.add(time);
            lastMoment = time;
        }
    }

    void noteWhatHappened(const channel::State& before, const channel::State& now, const Simulation& simulation,
                          channel::Displaced& buffer)
    {
        for (render::Event event : render::eventsBetween(before, now)) {
            event.time = static_cast<double>(now.tick) * period;
            playback.recorded.add(event);
        }
        playback.recorded.addTick(now);
        if (now.pictures > before.pictures) {
            showShape(simulation, buffer);
            playback.recorded.addTaken(now, {buffer.nodes.data(), buffer.count});
        }
    }

    void compute()
    {
        try {
            Simulation simulation(model, {period, {}});
            const auto buffer = std::make_unique<channel::Displaced>();
            ServoTiming timing;
            timing.missed = missedIn(record);
            channel::State state, before;
            TickComparison comparison(record);
            record.each([&](const TickRecord& then) {
                if (stop || then.tick >= length) {
                    return;
                }
                base::failIf(then.tick != film.ticks(), "{}: tick {} is missing in the record", file, film.ticks());
                const TickRecord& now = simulation.tick(then.device);
                const bool first = comparison.differences().empty();
                if (!comparison.add(then, now) && first) {
                    const bool force = now.total != then.total;
                    blame(force ? base::marked("FORCES ARE NOT THOSE OF THE RECORD")
                                : base::marked("THE RECORD SAYS SOMETHING ELSE"),
                          fmt::format("{}: {} from tick {} on: {}: {}", file,
                                      force ? "forces differ" : "what was recorded differs", then.tick,
                                      haptics::whyItDiffers(file, base::build()), comparison.inWords()));
                }
                noteMoments(now);
                showTick(now, timing, state);
                noteWhatHappened(before, state, simulation, *buffer);
                before = state;
                film.add(state, simulation, *buffer);
                playback.ready = static_cast<double>(then.tick) * period;
            });
        } catch (const std::exception& e) {
            blame(base::marked("THE RECORD ENDS HERE"), e.what());
            // Without a single tick there is no time that could be shown.
            playback.length = film.ticks() > 0 ? playback.ready.load() : -1.0;
        }
    }

    void publish(std::uint64_t tick, std::uint64_t& shown)
    {
        if (const std::uint64_t shape = film.shapeAt(tick); shape != shown) {
            shown = shape;
            channel::Displaced& out = publisher.backBuffer();
            const auto& nodes = film.shape(shape);
            std::copy(nodes.begin(), nodes.end(), out.nodes.begin());
            out.count = static_cast<std::uint32_t>(nodes.size());
            out.tick = film.shapeTick(shape);
            publisher.publishDisplaced();
        }
        // Of a long record not every tick is kept: the one before stands for it.
        channel::State state = film.state(tick);
        state.tick = tick;
        state.time = static_cast<double>(tick) * period;
        publisher.setState(state);
    }

    // The record's clock runs on by real time times speed, stops when paused, and waits for what is not computed yet.
    void show()
    {
        using Clock = std::chrono::steady_clock;
        constexpr double none = std::numeric_limits<double>::quiet_NaN();
        double time = 0;
        std::uint64_t shown = std::numeric_limits<std::uint64_t>::max();
        auto last = Clock::now();
        while (!stop) {
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
            const auto now = Clock::now();
            const double passed = std::chrono::duration<double>(now - last).count();
            last = now;
            if (film.ticks() == 0) {
                continue;
            }
            if (double jump = playback.jump; !std::isnan(jump)) {
                // Beyond the end is the end. A jump that is asked for just now is left for the next look.
                if (const double to = std::min<double>(jump, playback.length); to <= playback.ready) {
                    time = to;
                    playback.jump.compare_exchange_strong(jump, none);
                }
            } else if (!playback.paused) {
                time += passed * playback.speed;
            }
            time = std::clamp<double>(time, 0.0, playback.ready);
            // Half a tick on, so that a time that was made from a tick falls into that tick.
            publish(static_cast<std::uint64_t>(time / period + 0.5), shown);
            playback.time = time;
        }
    }

    std::string file;
    Record record;
    SessionModel model;
    double period;         // of its ticks [s]
    std::uint64_t length;  // ticks when it was opened: a session may still write more
    Film film;
    std::string session;
    channel::Publisher publisher;
    render::Playback playback;
    double lastMoment = -1;  // [s]
    std::mutex problemGuard;
    std::string problem;
    std::atomic<bool> stop{false};
    std::thread computing, showing;
};

render::Ghost ReplayPlayer::ghostOf(const std::string& file) const
{
    const Record other(file);
    // Sessions at two settings of the tissue model are in one body; only their models tell.
    const bool alike = other.info().volumeHash == impl_->record.info().volumeHash;
    base::failIf(!alike && bodyHash(session::reopenSession(file, other.info())) != bodyHash(impl_->model),
                 "--ghost {}: is a session in another body than {}: take a record of a session in the same body", file,
                 impl_->file);
    constexpr std::uint64_t every = 10;  // ticks
    render::Ghost ghost;
    other.each([&](const TickRecord& r) {
        if (r.tick % every == 0) {
            const auto tip = r.tip();
            ghost.push_back({static_cast<double>(r.tick) / other.info().rate,
                             {tip.x, tip.y, tip.z},
                             {r.device.axis.x, r.device.axis.y, r.device.axis.z},
                             r.phase == Phase::inserted});
        }
    });
    return ghost;
}

void ReplayPlayer::startAt(double seconds)
{
    impl_->playback.jump = std::clamp<double>(seconds, 0.0, impl_->playback.length);
    impl_->playback.paused = true;
}

ReplayPlayer::ReplayPlayer(const std::string& file) : impl_(std::make_unique<Impl>(file)) {}

ReplayPlayer::~ReplayPlayer() = default;

const std::string& ReplayPlayer::session() const noexcept
{
    return impl_->session;
}

render::Playback& ReplayPlayer::playback() noexcept
{
    return impl_->playback;
}

std::string ReplayPlayer::problem() const
{
    const std::lock_guard lock(impl_->problemGuard);
    return impl_->problem;
}

}  // namespace palpate::apps
