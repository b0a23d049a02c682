#include <session/trainer.h>

#include <base/end_in_order.h>
#include <base/error.h>
#include <channel/channel.h>
#include <haptics/broadcast.h>
#include <haptics/interrupted.h>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <signal.h>
#include <string.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace palpate::session {

namespace {

using namespace haptics;
using base::EndInOrder;

std::unique_ptr<Device> openWithFaults(const TrainOptions& options, const SessionModel& model, const Broadcast& broadcast)
{
    std::unique_ptr<Device> device = openDevice(model, options.device, &broadcast);
    return options.faults.empty() ? std::move(device) : std::make_unique<FaultyDevice>(std::move(device), options.faults);
}

// Who holds the tool, as viewers are told.
std::uint32_t handOf(const DeviceKind& kind)
{
    return kind.needsViewer ? channel::handIsViewers : kind.somebodyHolds ? channel::handIsDevices : channel::handElsewhere;
}

void sleepThroughGap(const Faults& faults, std::uint64_t tick) noexcept
{
    if (const double seconds = gapAfter(faults, tick); seconds > 0.0) {
        std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    }
}

// One line on the terminal that tells how the session goes.
void showProgress(const channel::State& s)
{
    constexpr std::array phases{"free", "touching", "inserted"};
    const Vec3 force(s.total[0], s.total[1], s.total[2]);
    fmt::print(stderr, "\r{:6.1f} s  {:<8} {:5.1f} mm inside  {:5.2f} N  target {:5.1f} mm  ", s.time,
               phases[static_cast<std::size_t>(s.phase)], 1e3 * s.inserted, glm::length(force), 1e3 * s.distance[0]);
}

// What there is to do outside the loop while it runs. The progress is read as a viewer reads it.
void waitFor(const TrainOptions& options, const std::atomic<bool>& done, EndInOrder& untilItsEnd)
{
    const bool terminal = isatty(STDERR_FILENO) != 0;
    const auto viewer = channel::Subscriber::attach(options.session);
    while (!done) {
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        const auto state = terminal && viewer ? viewer->state() : std::nullopt;
        if (state) {
            showProgress(*state);
        }
        if (options.lookAfter && !options.lookAfter()) {
            untilItsEnd.end();
        }
    }
    if (terminal) {
        fmt::print(stderr, "\r{:70}\r", "");
    }
}

std::string steppedDown(const SessionFigures& figures)
{
    return fmt::format(
        "too many ticks came late: from {:.1f} s on the tissue was computed by a cheaper model ({} at the end), and feels "
        "different",
        figures.steppedDownAt,
        figures.level == datasets::ModelLevel::elastic ? "elastic with smaller windows" : name(figures.level));
}

// What the record says of the session beside its ticks; empty where a session that keeps no clock has not measured it.
std::vector<std::pair<std::string, std::string>> resultsOf(const TrainResult& result)
{
    const ServoTiming& timing = result.timing;
    const auto late = timing.lateness.percentiles();
    const auto work = timing.work.percentiles();
    const auto measured = [&](std::string value) { return timing.paced ? std::move(value) : std::string(); };
    const auto microseconds = [](double seconds) { return fmt::format("{:.2f}", 1e6 * seconds); };
    return {{"missed_ticks", measured(fmt::format("{}", timing.missed))},
            {"overruns", fmt::format("{}", timing.overruns)},
            {"gaps", measured(fmt::format("{}", timing.gaps))},
            {"longest_gap_ms", measured(fmt::format("{}", timing.longestGap))},
            {"tick_us_p50", microseconds(work.p50)},
            {"tick_us_p99", microseconds(work.p99)},
            {"lateness_us_p50", measured(microseconds(late.p50))},
            {"lateness_us_p99", measured(microseconds(late.p99))},
            {"lateness_us_p999", measured(microseconds(late.p999))},
            {"lateness_us_max", measured(microseconds(late.max))},
            {"pauses", fmt::format("{}", timing.pauses)},
            {"paused_s", fmt::format("{:.3f}", timing.paused)},
            {"force_hash", fmt::format("{:016x}", result.forceHash)},
            {"steps_down", fmt::format("{}", result.stepsDown)},
            {"model_at_end", std::string(name(result.level))},
            {"score_total", fmt::format("{:.1f}", result.score.total)}};
}

const TrainOptions& checked(const TrainOptions& options, const SessionInfo& info)
{
    base::failIf(info.rate != 1.0 / tickSeconds, "session {}: a rate of {} Hz: hands and faults keep {:g} Hz",
                 options.session, info.rate, 1.0 / tickSeconds);
    base::failIf(has(options.faults, FaultKind::stallViewer) && !options.stallViewers,
                 "session {}: fault stall-viewer: there is nothing that stops viewers (TrainOptions::stallViewers)",
                 options.session);
    return options;
}

}  // namespace

struct Trainer::Impl {
    Impl(const SessionModel& model, const SessionInfo& info, const TrainOptions& o)
        : options(checked(o, info)),
          broadcast(o.session, model, handOf(deviceKind(o.device.name)), info.operatorName),
          device(openWithFaults(o, model, broadcast)),
          session(model, info)
    {
        if (!o.record.empty()) {
            recorder.emplace(o.record, info);
        }
        if (has(o.faults, FaultKind::stallViewer) || has(o.faults, FaultKind::diskFull)) {
            around.emplace(o.faults, o.record, o.stallViewers);
        }
    }

    // The servo thread: nothing in the sink allocates, locks or does I/O.
    void servo(std::vector<std::string>& warnings, EndInOrder& untilItsEnd)
    {
        std::optional<haptics::RealTimeClaim> claim;
        if (options.servo.paced) {
            warnings = claim.emplace().warnings();
        }
        options.servo.pause.asked = [this, &untilItsEnd] {
            const auto input = broadcast.input();
            if (input && input->ended != 0 && deviceKind(options.device.name).somebodyHolds) {
                untilItsEnd.end();
            }
            return input && input->paused != 0;
        };
        options.servo.pause.standing = [this, &untilItsEnd](bool elsewhere) {
            broadcast.stand(elsewhere ? channel::Standing::toolElsewhere : channel::Standing::paused);
            if (broadcast.torn()) {
                untilItsEnd.end();
            }
        };
        const RunOptions run{options.servo, recorder ? &*recorder : nullptr, &untilItsEnd.wanted()};
        timing = session.run(*device, run, [&](const TickRecord& record, const ServoTiming& soFar) {
            broadcast.publish(record, soFar, session.simulation());
            if (broadcast.torn()) {
                untilItsEnd.end();
            }
            if (around) {
                around->tell(record.tick);
            }
            sleepThroughGap(options.faults, record.tick);
        });
        broadcast.finish();
    }

    // The viewer whose user ended it is the last that wrote.
    bool wantsAnew() const
    {
        const auto input = broadcast.input();
        return input && input->ended == 2;
    }

    void conclude(TrainResult& result)
    {
        if (recorder) {
            auto results = resultsOf(result);
            if (result.signal != 0) {
                results.emplace_back(haptics::interruptedKey, strsignal(result.signal));
            }
            recorder->finish(results);
            result.lostRecords = recorder->lost();
            result.problem = recorder->error();
            result.recordCut = !recorder->whole();
            if (result.lostRecords > 0 && result.problem.empty()) {
                result.problem = fmt::format("{}: {} ticks were lost by the recorder: record to a faster disk",
                                             options.record.string(), result.lostRecords);
            }
        }
        if (result.problem.empty() && broadcast.torn()) {
            result.problem =
                fmt::format("session {}: its shared memory was cut off by another program: the session was ended in order",
                            options.session);
        }
        if (result.problem.empty()) {
            result.problem = device->problem();
        }
        if (result.faulted && result.problem.empty()) {
            result.problem = "a force or a pose was not finite: the force was switched off (event 'fault' in the record)";
        }
    }

    TrainOptions options;
    Broadcast broadcast;
    std::unique_ptr<Device> device;
    Session session;
    ServoTiming timing;
    std::optional<Recorder> recorder;
    std::optional<FaultsAround> around;
    bool hasRun = false;
};

Trainer::Trainer(const SessionModel& model, const SessionInfo& info, const TrainOptions& options)
    : impl_(std::make_unique<Impl>(model, info, options))
{
}

Trainer::~Trainer() = default;

TrainResult Trainer::run()
{
    base::failIf(std::exchange(impl_->hasRun, true), "session {}: has run already: another needs a Trainer of its own",
                 impl_->options.session);
    EndInOrder untilItsEnd;
    std::vector<std::string> warnings;
    std::atomic<bool> done{false};
    std::thread servo([&] {
        impl_->servo(warnings, untilItsEnd);
        done = true;
    });
    if (isatty(STDERR_FILENO) != 0 || impl_->options.lookAfter) {
        try {
            waitFor(impl_->options, done, untilItsEnd);
        } catch (...) {
            untilItsEnd.end();
            servo.join();
            throw;
        }
    }
    servo.join();
    for (const auto& warning : warnings) {
        fmt::print(stderr, "palpate: {}\n", warning);
    }
    TrainResult result;
    static_cast<SessionFigures&>(result) = impl_->session.figures();
    if (result.stepsDown > 0) {
        warnings.push_back(steppedDown(result));
        fmt::print(stderr, "palpate: {}\n", warnings.back());
    }
    result.timing = std::move(impl_->timing);
    result.warnings = warnings;
    result.signal = untilItsEnd.interruptedBy();
    result.restart = impl_->wantsAnew();
    impl_->conclude(result);
    // The record is closed before a disk that is full on purpose has room again.
    impl_->recorder.reset();
    impl_->around.reset();
    return result;
}

}  // namespace palpate::session
