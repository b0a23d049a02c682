#include <session/session.h>

#include <base/error.h>
#include <base/words.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::session {

using namespace haptics;

constexpr std::size_t maxCores = 64;
constexpr std::uint64_t flushPeriod = 1024;  // ticks between waits for the recorder in an unpaced session

namespace {

double periodOf(const SessionInfo& info)
{
    base::failIf(!(info.rate > 0.0 && std::isfinite(info.rate)), "session: a rate of {} Hz: must be a positive number",
                 info.rate);
    return 1.0 / info.rate;
}

}  // namespace

Session::Session(const SessionModel& model, const SessionInfo& info)
    : simulation_(model, {periodOf(info), {}}), info_(info), watch_(info)
{
    figures_.cores.reserve(maxCores);
    figures_.nearest.fill(std::numeric_limits<double>::infinity());
}

const TickRecord& Session::tick(const DeviceSample& pose) noexcept
{
    const TickRecord& record = simulation_.tick(pose);
    add(record);
    return record;
}

ServoTiming Session::run(Device& device, const RunOptions& options, const TickSink& also)
{
    static const std::atomic<bool> never{false};
    const auto sink = [&](const TickRecord& record, const ServoTiming& timing) {
        add(record);
        if (options.recorder != nullptr) {
            options.recorder->push(record);
            // Faster than real time the loop would outrun the writer: it waits, as nobody holds the device.
            if (!options.servo.paced && record.tick % flushPeriod == 0) {
                options.recorder->flush();
            }
        }
        if (also) {
            also(record, timing);
        }
    };
    return runServo(device, simulation_, options.servo, sink, options.stop != nullptr ? *options.stop : never);
}

SessionFigures Session::figures() const
{
    SessionFigures figures = figures_;
    figures.score = watch_.score();
    figures.losses = watch_.losses(info_);
    const base::English always;
    figures.lossesInEnglish = watch_.losses(info_);
    figures.forceHash = hash_.value();
    figures.level = simulation_.level();
    return figures;
}

void Session::add(const TickRecord& r) noexcept
{
    watch_.add(r);
    hash_.add(r);
    SessionFigures& f = figures_;
    f.peakBasic = std::max(f.peakBasic, glm::length(r.basic));
    f.peakAdditional = std::max(f.peakAdditional, glm::length(r.additional));
    f.peakTotal = std::max(f.peakTotal, glm::length(r.total));
    f.energyMade = std::max(f.energyMade, r.energy);
    f.energyDamped = r.damped;
    for (std::size_t i = 0; i < maxStructures; ++i) {
        f.nearest[i] = std::min(f.nearest[i], r.distance[i]);
    }
    for (std::uint32_t i = 0; i < r.eventCount; ++i) {
        f.contacts += r.events[i].kind == EventKind::contact ? 1 : 0;
        f.punctures += r.events[i].kind == EventKind::puncture ? 1 : 0;
        if (r.events[i].kind == EventKind::stepDown) {
            f.steppedDownAt = f.stepsDown++ == 0 ? static_cast<double>(r.tick) / info_.rate : f.steppedDownAt;
        }
    }
    if (r.fired && f.cores.size() < maxCores) {
        f.cores.push_back(r.core);
    }
    f.faulted = f.faulted || r.faulted;
}

}  // namespace palpate::session
