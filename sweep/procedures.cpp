#include <sweep/procedures.h>

#include <base/processor_time.h>
#include <haptics/measures.h>
#include <haptics/replay.h>
#include <haptics/score.h>
#include <haptics/simulation.h>
#include <session/devices.h>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>

namespace palpate::sweep {

namespace {

using haptics::DeviceSample;
using haptics::TickRecord;
using Seen = std::function<void(const TickRecord&)>;

constexpr double none = std::numeric_limits<double>::quiet_NaN();
constexpr double gap = 2e-3;      // between tool and surface before it sets out [m]
constexpr double outside = 5e-3;  // where a needle's way begins and ends [m]
constexpr double judged = 20e-3;  // the force of a hold is the mean over its end [s]

// A simulation whose ticks in contact are timed.
class Timed {
public:
    Timed(const haptics::SessionModel& model, const Seen& seen) : simulation_(model), seen_(seen) {}

    const TickRecord& tick(const DeviceSample& sample)
    {
        const double before = base::processorTime();
        const TickRecord& record = simulation_.tick(sample);
        if (record.phase != haptics::Phase::free || record.contacts > 0) {
            seconds_ += base::processorTime() - before;
            ++ticks_;
        }
        if (seen_) {
            seen_(record);
        }
        return record;
    }
    double mean() const noexcept { return ticks_ > 0 ? seconds_ / static_cast<double>(ticks_) : 0.0; }

private:
    haptics::Simulation simulation_;
    const Seen& seen_;
    double seconds_ = 0;
    std::uint64_t ticks_ = 0;
};

// The force on the hand against a way, its work, and what gave way.
struct Felt {
    double peak = 0, pull = 0, work = 0, held = 0, puncture = none;
    std::uint32_t punctures = 0, heldTicks = 0, contacts = 0;
    Vec3 last{0.0};
    bool began = false;

    void add(const TickRecord& r, Vec3 way)
    {
        const double against = -glm::dot(r.total, way);
        peak = std::max(peak, against);
        pull = std::max(pull, -against);
        work += began ? -glm::dot(r.total, r.device.position - last) : 0.0;
        last = r.device.position;
        began = true;
        for (std::uint32_t i = 0; i < r.eventCount; ++i) {
            if (r.events[i].kind == haptics::EventKind::puncture) {
                puncture = punctures++ == 0 ? r.events[i].value : puncture;
            }
        }
    }
    void hold(const TickRecord& r, Vec3 way)
    {
        held += -glm::dot(r.basic, way);
        ++heldTicks;
        contacts = r.contacts;
    }
    double force() const noexcept { return heldTicks > 0 ? held / heldTicks : none; }
};

// The tool at rest before it sets out: forces are ramped up after the start.
void settle(Timed& timed, const DeviceSample& at)
{
    for (double t = 0; t < haptics::settledAfter; t += haptics::tickSeconds) {
        timed.tick(at);
    }
}

// Along `way` from `from` by `length` and back to where it began; the hold is in between.
Felt drive(Timed& timed, Vec3 from, Vec3 way, double length, const Procedure& p, bool back)
{
    Felt felt;
    DeviceSample sample;
    sample.position = from;
    sample.axis = way;
    sample.buttons = haptics::buttonDeadMan;
    settle(timed, sample);
    const double step = p.speed * haptics::tickSeconds;
    const auto steps = static_cast<int>(std::ceil(length / step));
    const auto at = [&](double far) -> const TickRecord& {
        sample.position = from + far * way;
        const TickRecord& r = timed.tick(sample);
        felt.add(r, way);
        return r;
    };
    for (int i = 1; i <= steps; ++i) {
        at(std::min(i * step, length));
    }
    const auto wait = static_cast<int>(std::ceil(p.hold / haptics::tickSeconds));
    const auto counted = static_cast<int>(std::ceil(judged / haptics::tickSeconds));
    for (int i = 0; i < wait; ++i) {
        const TickRecord& r = at(length);
        if (i >= wait - counted) {
            felt.hold(r, way);
        }
    }
    for (int i = 1; back && i <= steps; ++i) {
        at(std::max(length - i * step, 0.0));
    }
    return felt;
}

ProcedureResult press(const haptics::SessionModel& model, const Procedure& p, const Seen& seen)
{
    const auto& tool = model.scene.tool;
    if (tool.kind == datasets::ToolKind::needle) {
        throw std::runtime_error("procedure press: a needle pierces: set tool.kind to sphere or capsule");
    }
    const Vec3 inward = -model.surface.normal(model.approach.entry);
    const Vec3 left = std::abs(inward.x) < 0.9 ? Vec3(1, 0, 0) : Vec3(0, 0, 1);
    Vec3 place = model.approach.entry + p.aside * glm::normalize(left - glm::dot(left, inward) * inward);
    for (int i = 0; i < 4; ++i) {
        place -= model.surface.distance(place) * model.surface.normal(place);
    }
    const Vec3 way = -model.surface.normal(place);
    Timed timed(model, seen);
    const Felt felt = drive(timed, place - (tool.radius + gap) * way, way, gap + p.depth, p, false);
    return {{felt.force(), felt.peak, felt.force() / p.depth, 1e3 * felt.work, static_cast<double>(felt.contacts)},
            timed.mean()};
}

ProcedureResult needle(const haptics::SessionModel& model, const Procedure& p, const Seen& seen)
{
    if (model.scene.tool.kind != datasets::ToolKind::needle) {
        throw std::runtime_error("procedure needle: set tool.kind to needle");
    }
    const Vec3 way = glm::normalize(model.approach.aim - model.approach.entry);
    Timed timed(model, seen);
    const Felt felt = drive(timed, model.approach.entry - outside * way, way, outside + p.depth, p, true);
    return {{felt.puncture, static_cast<double>(felt.punctures), felt.peak, felt.force(), felt.pull, 1e3 * felt.work},
            timed.mean()};
}

// The forces reach the hand some ticks late.
class LateDevice {
public:
    LateDevice(std::unique_ptr<haptics::Device> device, double delay)
        : device_(std::move(device)), line_(static_cast<std::size_t>(std::llround(delay / haptics::tickSeconds)), Vec3(0.0))
    {
    }
    DeviceSample read() { return device_->read(); }
    bool finished() const { return device_->finished(); }
    void answer(const TickRecord& record)
    {
        Vec3 force = record.total;
        if (!line_.empty()) {
            std::swap(force, line_[next_++ % line_.size()]);
        }
        device_->write(force);
        device_->observe(record);
    }

private:
    std::unique_ptr<haptics::Device> device_;
    std::vector<Vec3> line_;
    std::size_t next_ = 0;
};

ProcedureResult wholeSession(const haptics::SessionModel& model, const Procedure& p, std::uint64_t seed, const Seen& seen)
{
    LateDevice device(session::openDevice(model, {"hand", p.trainee, p.seed.value_or(seed), nullptr}, nullptr), p.delay);
    haptics::Scorer scorer(haptics::infoOf(model));
    Timed timed(model, seen);
    double basic = 0, additional = 0, made = 0, punctures = 0, seconds = 0;
    while (!device.finished() && seconds < p.seconds) {
        const TickRecord& r = timed.tick(device.read());
        device.answer(r);
        scorer.add(r);
        basic = std::max(basic, glm::length(r.basic));
        additional = std::max(additional, glm::length(r.additional));
        made = std::max(made, r.energy);
        for (std::uint32_t i = 0; i < r.eventCount; ++i) {
            punctures += r.events[i].kind == haptics::EventKind::puncture ? 1 : 0;
        }
        seconds += haptics::tickSeconds;
    }
    const haptics::Score score = scorer.score();
    ProcedureResult result{{}, timed.mean()};
    for (const haptics::Measure& m : haptics::measures()) {
        result.values.push_back(m.value(score));
    }
    result.values.insert(result.values.end(), {basic, additional, 1e3 * made, punctures, device.finished() ? 1.0 : 0.0});
    return result;
}

}  // namespace

std::vector<OutputInfo> outputsOf(ProcedureKind kind)
{
    if (kind == ProcedureKind::press) {
        return {{"force_n", "of the tissue, mean over the last 20 ms of the hold"},
                {"peak_force_n", "on the hand, largest on the way in"},
                {"stiffness_n_m", "force_n over the depth"},
                {"work_mj", "that the hand did"},
                {"contacts", "elements of tissue that the tool touched at the end"}};
    }
    if (kind == ProcedureKind::needle) {
        return {{"puncture_force_n", "at which the first tissue gave way"},
                {"punctures", "tissues that gave way"},
                {"peak_force_n", "on the hand, largest against the way in"},
                {"force_n", "of the tissue at the depth, mean over the last 20 ms of the hold"},
                {"pull_n", "largest on the way out"},
                {"work_mj", "that the hand did, in and out"}};
    }
    std::vector<OutputInfo> out;
    for (const haptics::Measure& m : haptics::measures()) {
        out.push_back({m.key, "of the score, docs/score.md"});
    }
    out.insert(out.end(), {{"peak_basic_n", "largest force of the tissue"},
                           {"peak_additional_n", "largest additional force (DFFB)"},
                           {"energy_made_mj", "most that the hand was given net"},
                           {"punctures", "tissues that gave way"},
                           {"finished", "1: the hand came to its end; 0: the time was over"}});
    return out;
}

ProcedureResult carryOut(const haptics::SessionModel& model, const Procedure& procedure, std::uint64_t seed,
                         const Seen& seen)
{
    switch (procedure.kind) {
        case ProcedureKind::press:
            return press(model, procedure, seen);
        case ProcedureKind::needle:
            return needle(model, procedure, seen);
        case ProcedureKind::session:
            break;
    }
    return wholeSession(model, procedure, seed, seen);
}

}  // namespace palpate::sweep
