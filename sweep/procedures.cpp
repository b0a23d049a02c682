#include <sweep/procedure.h>

#include <base/error.h>
#include <base/mapped.h>
#include <base/processor_time.h>
#include <haptics/measures.h>
#include <session/devices.h>
#include <session/session.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace palpate::sweep {

namespace {

using haptics::Device;
using haptics::DeviceSample;
using haptics::TickRecord;

constexpr double none = std::numeric_limits<double>::quiet_NaN();
constexpr double gap = 2e-3;      // between tool and surface before it sets out [m]
constexpr double outside = 5e-3;  // where a needle's way begins and ends [m]
constexpr double judged = 20e-3;  // the force of a hold is the mean over its end [s]

struct Run {
    const haptics::SessionModel& model;
    const haptics::SessionInfo& info;
    haptics::Recorder* recorder;
    const haptics::TickSink& also;
};

// A device whose forces reach the hand some ticks late, and that takes the processor time of the ticks in contact.
class Measured final : public Device {
public:
    Measured(Device& device, double delay)
        : device_(device), line_(static_cast<std::size_t>(std::llround(delay / haptics::tickSeconds)), Vec3(0.0))
    {
    }
    DeviceSample read() noexcept override
    {
        const DeviceSample sample = device_.read();
        began_ = base::processorTime();
        return sample;
    }
    void write(Vec3 force) noexcept override
    {
        took_ = base::processorTime() - began_;
        if (!line_.empty()) {
            std::swap(force, line_[next_++ % line_.size()]);
        }
        device_.write(force);
    }
    void observe(const TickRecord& record) noexcept override
    {
        if (record.phase != haptics::Phase::free || record.contacts > 0) {
            seconds_ += took_;
            ++ticks_;
        }
        device_.observe(record);
    }
    bool finished() const noexcept override { return device_.finished(); }
    double mean() const noexcept { return ticks_ > 0 ? seconds_ / static_cast<double>(ticks_) : 0.0; }

private:
    Device& device_;
    std::vector<Vec3> line_;
    std::size_t next_ = 0;
    double began_ = 0, took_ = 0, seconds_ = 0;
    std::uint64_t ticks_ = 0;
};

// The force on the hand against a way, its work, and what gave way; `held` is the force of the tissue, which no cap cuts.
struct Felt {
    double peak = 0, pull = 0, work = 0, held = 0, puncture = none;
    std::uint32_t punctures = 0, heldTicks = 0, contacts = 0;
    Vec3 last{0.0}, force{0.0};  // of the hand, at the last tick
    bool began = false;

    void add(const TickRecord& r, Vec3 way)
    {
        const double against = -glm::dot(r.total, way);
        peak = std::max(peak, against);
        pull = std::max(pull, -against);
        work -= began ? 0.5 * glm::dot(force + r.total, r.device.position - last) : 0.0;
        last = r.device.position;
        force = r.total;
        began = true;
        for (std::uint32_t i = 0; i < r.eventCount; ++i) {
            if (r.events[i].kind == haptics::EventKind::puncture) {
                puncture = punctures++ == 0 ? r.events[i].value : puncture;
            }
        }
    }
    void hold(const TickRecord& r, Vec3 way)
    {
        held += -glm::dot(r.tissueForce, way);
        ++heldTicks;
        contacts = r.contacts;
    }
    double heldForce() const noexcept { return heldTicks > 0 ? held / heldTicks : none; }
};

int ticksIn(double seconds) noexcept
{
    return static_cast<int>(std::ceil(seconds / haptics::tickSeconds));
}

// The tool on a prescribed way: at rest until the forces are ramped up, along `way` by `length`, the hold, and with `back`
// to where it began.
class Drive final : public Device {
public:
    Drive(Vec3 from, Vec3 way, double length, const Procedure& p, bool back)
        : from_(from),
          way_(way),
          length_(length),
          step_(p.speed * haptics::tickSeconds),
          setsOut_(ticksIn(haptics::settledAfter)),
          arrives_(setsOut_ + static_cast<int>(std::ceil(length / step_))),
          leaves_(arrives_ + ticksIn(p.hold)),
          ends_(leaves_ + (back ? arrives_ - setsOut_ : 0))
    {
    }
    DeviceSample read() noexcept override
    {
        ++tick_;
        DeviceSample sample;
        sample.position = from_ + reach() * way_;
        sample.axis = way_;
        sample.buttons = haptics::buttonDeadMan;
        return sample;
    }
    void write(Vec3) noexcept override {}
    void observe(const TickRecord& record) noexcept override
    {
        if (tick_ > setsOut_) {
            felt_.add(record, way_);
        }
        if (tick_ > std::max(arrives_, leaves_ - ticksIn(judged)) && tick_ <= leaves_) {
            felt_.hold(record, way_);
        }
    }
    bool finished() const noexcept override { return tick_ >= ends_; }
    const Felt& felt() const noexcept { return felt_; }

private:
    // Along the way [m].
    double reach() const noexcept
    {
        if (tick_ <= setsOut_) {
            return 0.0;
        }
        return tick_ <= leaves_ ? std::min((tick_ - setsOut_) * step_, length_)
                                : std::max(length_ - (tick_ - leaves_) * step_, 0.0);
    }

    Vec3 from_, way_;
    double length_, step_;                   // [m]
    int setsOut_, arrives_, leaves_, ends_;  // last tick of each part
    int tick_ = 0;                           // from 1 up
    Felt felt_;
};

// The whole of a drive. Mean processor time of its ticks in contact [s].
double carryOut(const Run& run, Drive& drive)
{
    session::Session session(run.model, run.info);
    Measured measured(drive, 0.0);
    session.run(measured, {.servo = {.paced = false}, .recorder = run.recorder}, run.also);
    return measured.mean();
}

ProcedureResult press(const Run& run, const Procedure& p)
{
    const auto& model = run.model;
    const auto& tool = model.scene.tool;
    base::failIf(tool.kind == datasets::ToolKind::needle,
                 "procedure press: a needle pierces: set tool.kind to sphere or capsule");
    const Vec3 inward = -model.surface.normal(model.approach.entry);
    const Vec3 left = std::abs(inward.x) < 0.9 ? Vec3(1, 0, 0) : Vec3(0, 0, 1);
    Vec3 place = model.approach.entry + p.aside * glm::normalize(left - glm::dot(left, inward) * inward);
    for (int i = 0; i < 4; ++i) {
        place -= model.surface.distance(place) * model.surface.normal(place);
    }
    const Vec3 way = -model.surface.normal(place);
    Drive drive(place - (tool.radius + gap) * way, way, gap + p.depth, p, false);
    const double tickTime = carryOut(run, drive);
    const Felt& felt = drive.felt();
    return {{felt.heldForce(), felt.peak, felt.heldForce() / p.depth, 1e3 * felt.work, static_cast<double>(felt.contacts)},
            tickTime};
}

ProcedureResult needle(const Run& run, const Procedure& p)
{
    const auto& model = run.model;
    base::failIf(model.scene.tool.kind != datasets::ToolKind::needle, "procedure needle: set tool.kind to needle");
    const Vec3 way = glm::normalize(model.approach.aim - model.approach.entry);
    Drive drive(model.approach.entry - outside * way, way, outside + p.depth, p, true);
    const double tickTime = carryOut(run, drive);
    const Felt& felt = drive.felt();
    return {{felt.puncture, static_cast<double>(felt.punctures), felt.peak, felt.heldForce(), felt.pull, 1e3 * felt.work},
            tickTime};
}

ProcedureResult wholeSession(const Run& run, const Procedure& p, std::uint64_t seed)
{
    const auto hand = session::openDevice(run.model, {"hand", p.trainee, p.seed.value_or(seed), nullptr}, nullptr);
    Measured measured(*hand, p.delay);
    session::Session session(run.model, run.info);
    session.run(measured, {.servo = {.paced = false, .seconds = p.seconds}, .recorder = run.recorder}, run.also);
    const session::SessionFigures figures = session.figures();
    ProcedureResult result{{}, measured.mean()};
    std::ranges::transform(haptics::measures(), std::back_inserter(result.values),
                           [&](const haptics::Measure& m) { return m.value(figures.score); });
    result.values.insert(result.values.end(), {figures.peakBasic, figures.peakAdditional, 1e3 * figures.energyMade,
                                               static_cast<double>(figures.punctures), hand->finished() ? 1.0 : 0.0});
    return result;
}

}  // namespace

std::vector<OutputInfo> outputsOf(ProcedureKind kind)
{
    if (kind == ProcedureKind::press) {
        return {{"force_n", "force of the tissue on the tool, not capped; mean over the last 20 ms of the hold"},
                {"peak_force_n", "largest force on the hand on the way in"},
                {"stiffness_n_m", "force_n over the depth"},
                {"work_mj", "work of the hand"},
                {"contacts", "elements of tissue that the tool touched at the end"}};
    }
    if (kind == ProcedureKind::needle) {
        return {
            {"puncture_force_n", "force at which the first tissue gave way"},
            {"punctures", "tissues that gave way"},
            {"peak_force_n", "largest force on the hand against the way in"},
            {"force_n", "force of the tissue on the needle at the depth, not capped; mean over the last 20 ms of the hold"},
            {"pull_n", "largest force on the way out"},
            {"work_mj", "work of the hand, in and out"}};
    }
    auto out = base::mapped<OutputInfo>(haptics::measures(), [&](const haptics::Measure& m) {
        return OutputInfo{m.key, "measure of the score, docs/score.md"};
    });
    out.insert(out.end(), {{"peak_basic_n", "largest force of the tissue as sent to the hand: capped, with limited slew"},
                           {"peak_additional_n", "largest additional force (DFFB)"},
                           {"energy_made_mj", "largest net energy given to the hand"},
                           {"punctures", "tissues that gave way"},
                           {"finished", "1: the hand finished its script; 0: the time ran out"}});
    return out;
}

ProcedureResult carryOut(const haptics::SessionModel& model, const haptics::SessionInfo& info, const Procedure& procedure,
                         std::uint64_t seed, haptics::Recorder* recorder, const haptics::TickSink& also)
{
    const Run run{model, info, recorder, also};
    return procedure.kind == ProcedureKind::press    ? press(run, procedure)
           : procedure.kind == ProcedureKind::needle ? needle(run, procedure)
                                                     : wholeSession(run, procedure, seed);
}

}  // namespace palpate::sweep
