#include <haptics/simulation.h>

#include <base/error.h>
#include <datasets/scene_text.h>
#include <haptics/biopsy.h>
#include <haptics/events.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>

namespace palpate::haptics {

namespace {

// The part of a needle's shaft that collision looks at, from the tip [m].
constexpr double shaftQueried = 6e-3;
constexpr int smallWindow = 9;  // nodes deep: of the elastic level's step down
// Out of balance by less, a tick has no cycle beyond those of its setting: a three hundredth of what a hand notices
// (minNoticed in hand.cpp), and less than a step of any device's force [N].
constexpr double unfeltForce = 1e-3;

// How much of the tool behind its tip collision looks at [m].
double queriedLength(const datasets::ToolSpec& tool) noexcept
{
    return tool.kind == datasets::ToolKind::needle ? shaftQueried : tool.pressedLength();
}

// A program may have changed the scene since the model was built.
const SessionModel& checked(const SessionModel& model)
{
    datasets::checkScene(model.scene);
    return model;
}

// With a cap or a period that is no positive number, the stabiliser would limit nothing.
StabiliserOptions optionsOf(const SessionModel& model, const SimulationOptions& options)
{
    const double cap = model.scene.forceCap;
    const auto isPositive = [](double value) { return value > 0.0 && std::isfinite(value); };
    base::failIf(!isPositive(cap), "scene {}: a force cap of {} N: must be a positive number", model.scene.name, cap);
    base::failIf(!isPositive(options.period), "a period of {} s between ticks: must be a positive number", options.period);
    return {options.device ? *options.device : deviceParameters(model.scene.device), options.period, cap};
}

// Stops the time of one task after the other.
class TaskClock {
public:
    explicit TaskClock(TickRecord& record) : record_(record), last_(now()) {}

    void done(Task task) noexcept
    {
        const auto time = now();
        record_.seconds[static_cast<std::size_t>(task)] = std::chrono::duration<float>(time - last_).count();
        last_ = time;
    }

private:
    static std::chrono::steady_clock::time_point now() noexcept { return std::chrono::steady_clock::now(); }
    TickRecord& record_;
    std::chrono::steady_clock::time_point last_;
};

// Surface of all that may press [m^2].
double touchedByAll(const SessionModel& model, std::span<const chainmail::ElasticTool> probe)
{
    double sum = touchedBy(model.scene.tool, *model.elastic);
    for (const chainmail::ElasticTool& t : probe) {
        sum += chainmail::touchedBy(t.shape, model.elastic->levels.front().nodes.spacing);
    }
    return sum;
}

std::unique_ptr<chainmail::ElasticLevel> elasticLevel(const SessionModel& model, chainmail::DisplacedLattice& shape,
                                                      int window, const StabiliserOptions& of, double touched)
{
    chainmail::ElasticOptions options = elasticOptions(model.scene.model.elastic, of.period);
    options.window = window;
    options.touches = touched;
    options.unfelt = std::min(unfeltForce, of.device.forceStep);
    return std::make_unique<chainmail::ElasticLevel>(shape, *model.elastic, model.surface, options, model.approach.entry);
}

// A tip within ten metres of the patient's origin and a unit vector: anything else is no pose, and NaN fails both.
bool isPose(const DeviceSample& device) noexcept
{
    return glm::length(device.position) < 10.0 && std::abs(glm::length(device.axis) - 1.0) < 1e-3;
}

// Within a metre and a turn of where the probe begins; NaN fails.
bool isMove(const datasets::ProbeMove& m) noexcept
{
    constexpr double turn = 2.0 * std::numbers::pi;
    return std::abs(m.press) <= 1.0 && std::abs(m.slide) <= 1.0 && std::abs(m.sweep) <= 1.0 && std::abs(m.rock) <= turn &&
           std::abs(m.tilt) <= turn && std::abs(m.turn) <= turn;
}

}  // namespace

chainmail::ElasticOptions elasticOptions(const datasets::ElasticSettings& settings, double period) noexcept
{
    chainmail::ElasticOptions options;
    options.window = settings.window;
    options.cycles = static_cast<int>(std::lround(settings.cycles * std::max(1.0, period / tickSeconds)));
    options.law = settings.law;
    options.period = period;
    return options;
}

double touchedBy(const datasets::ToolSpec& tool, const chainmail::ElasticBody& body) noexcept
{
    if (tool.kind == datasets::ToolKind::needle) {
        return 0.0;
    }
    const Vec3 end(0.0, tool.pressedLength(), 0.0);
    return chainmail::touchedBy({Vec3(0.0), end, tool.radius, tool.radius}, body.levels.front().nodes.spacing);
}

Simulation::Simulation(const SessionModel& model, const SimulationOptions& options)
    : model_(checked(model)),
      reader_(*model.tissue),
      deformation_(model.lattice, model.scene.model.maxMoves,
                   chainmail::maxPressSeeds(model.lattice, model.scene.tool.radius)),
      spring_(deformation_.shape()),
      chainmail_(deformation_, model.scene.tool.radius),
      level_(model.scene.model.level),
      body_(deformation_.shape().body(model.surface)),
      contacts_(std::make_unique<occupancy::ContactSet>()),
      probe_(model.scene.probe),
      stabiliserOptions_(optionsOf(model, options))
{
    // Until there is a pose, the tool is outside: before the planned line, farther away than the body is wide.
    const volume::Box body = model.tissue->box();
    const Vec3 inward =
        model.approach.isPlanned ? glm::normalize(model.approach.aim - model.approach.entry) : Vec3(0, 1, 0);
    record_.device.axis = inward;
    record_.device.position = model.approach.entry - glm::distance(body.low, body.high) * inward;
    placeProbe();
    if (level_ == datasets::ModelLevel::elastic) {
        const double touched = touchedByAll(model, probe_.tools());
        const int window = model.scene.model.elastic.window;
        elastic_[0] = elasticLevel(model, deformation_.shape(), window, stabiliserOptions_, touched);
        if (window > smallWindow) {
            elastic_[1] = elasticLevel(model, deformation_.shape(), smallWindow, stabiliserOptions_, touched);
        }
    }
}

const TickRecord& Simulation::tick(const DeviceSample& device) noexcept
{
    const DeviceSample before = record_.device;
    record_ = TickRecord{};
    record_.device = before;
    record_.tick = ticks_;
    TaskClock clock(record_);
    accept(device);
    stepDownIfAsked();
    tool_ = bentTool(hand_, tip_.needle);
    const Vec3 position = tool_.position;

    placeProbe();
    const auto way = collide();
    clock.done(Task::h3);
    const Vec3 law = moveTip(model_, reader_, body_, tool_, way, stabiliserOptions_.period, tip_, record_);
    clock.done(Task::h4);
    const Vec3 tissue = contactForce(law, deform());
    clock.done(Task::deform);
    const auto near = monitor(model_, body_, tip_, position, monitor_, record_);
    record_.ahead = lookAhead(model_, reader_, body_, tip_, tool_, stabiliserOptions_.period, monitor_);
    fire();
    clock.done(Task::h6);
    const Vec3 additional = additionalForce(model_.scene.dffb, model_.structures.size(), near, position,
                                            tip_.phase != Phase::free, stabiliserOptions_.period, dffb_);
    const bool wasFaulted = stabiliser_.faulted;
    const auto sent = stabilise(tissue, additional, hand_, record_.device.position, stabiliserOptions_, stabiliser_);
    if (sent.faulted && !wasFaulted) {
        addEvent(record_, {EventKind::fault, 0xFF, 0, 0.0});
    }
    seeNeedle();
    record_.proxy = tip_.proxy;
    record_.phase = tip_.phase;
    record_.tissue = tip_.tissue;
    record_.inserted = tip_.needle.inTissue();
    record_.deflection = tool_.position - hand_.position;
    record_.tissueForce = tissue;
    record_.basic = sent.basic;
    record_.additional = sent.additional;
    record_.total = sent.total();
    record_.energy = stabiliser_.ledger.given;
    record_.damped = stabiliser_.ledger.damped;
    record_.faulted = sent.faulted;
    clock.done(Task::h7);
    ++ticks_;
    last_ = position;
    lastAxis_ = tool_.axis;
    return record_;
}

// What is no pose is replaced by the last that was one, and marked: the stabiliser latches the fault.
void Simulation::accept(const DeviceSample& device) noexcept
{
    const datasets::ProbeMove probeBefore = record_.device.probe;
    if (isPose(device) && (device.buttons & poseInvalid) == 0) {
        record_.device = device;
        // One zero and not two: -0 becomes +0.
        record_.device.position += 0.0;
        record_.device.axis += 0.0;
    } else {
        record_.device.buttons = (device.buttons & ~buttonFire) | poseInvalid;
        record_.device.fresh = false;
    }
    record_.device.probe = isMove(device.probe) ? device.probe : probeBefore;
    hand_ = record_.device;
    hand_.position =
        betweenSteps(record_.device.position, stabiliserOptions_.device.encoder, stabiliserOptions_.period, encoder_);
    if (ticks_ == 0) {
        last_ = hand_.position;
        lastAxis_ = hand_.axis;
    }
}

// The request is part of the sample, so that a replay steps down at the same tick.
void Simulation::stepDownIfAsked() noexcept
{
    if ((record_.device.buttons & modelTooSlow) == 0 || level_ == datasets::ModelLevel::spring) {
        return;
    }
    if (level_ == datasets::ModelLevel::chainmail) {
        level_ = datasets::ModelLevel::spring;
    } else if (stepsDown_ == 0 && elastic_[1]) {
        elastic_[1]->takeOver(*elastic_[0]);
    } else {
        level_ = datasets::ModelLevel::chainmail;
    }
    ++stepsDown_;
    addEvent(record_, {EventKind::stepDown, 0xFF, 0, static_cast<double>(stepsDown_)});
}

occupancy::Sweep Simulation::collide() noexcept
{
    const auto& tool = model_.scene.tool;
    const bool needle = tool.kind == datasets::ToolKind::needle;
    const Vec3 back = tool_.position - queriedLength(tool) * tool_.axis;
    occupancy::touch(body_, {back, tool_.position, tool.radius}, *contacts_);
    record_.contacts = static_cast<std::uint32_t>(contacts_->count);
    if (tip_.phase == Phase::contact) {
        // A needle touches with the point on its axis, a sphere with its whole surface.
        record_.penetration = std::max(0.0, contacts_->depth - (needle ? tool.radius : 0.0));
    }
    if (tip_.phase != Phase::free) {
        return {};
    }
    const auto pressing = [&](Vec3 tip, Vec3 axis) -> occupancy::Capsule {
        return {tip - tool.pressedLength() * axis, tip, needle ? 0.0 : tool.radius};
    };
    return occupancy::sweep(body_, pressing(last_, lastAxis_), pressing(tool_.position, tool_.axis));
}

chainmail::Grip Simulation::grip() const noexcept
{
    using Kind = chainmail::Grip::Kind;
    const auto& tool = model_.scene.tool;
    const Vec3 tip = tool_.position;
    const bool needle = tool.kind == datasets::ToolKind::needle;
    chainmail::Grip grip;
    grip.proxy = tip_.proxy;
    grip.position = tip;
    grip.radius = tool.radius;
    grip.friction = model_.scene.model.elastic.friction;
    grip.others = probe_.tools();
    if (tip_.phase == Phase::free) {
        return grip;
    }
    grip.kind = needle ? Kind::point : Kind::press;
    grip.inside = tip_.phase == Phase::inserted;
    grip.entry = tip_.needle.entry;
    grip.drag = tip_.phase == Phase::inserted ? tip_.needle.drag() : 0.0;
    grip.axis = tool_.axis;
    grip.shape = {tip, tip - tool.pressedLength() * tool_.axis, tool.radius, tool.radius};
    grip.deepest = tip_.place - tip_.proxy;
    grip.pushedAtTip = tip_.pushed.at(tip_.needle.inserted);
    grip.pushedAtEntry = tip_.pushed.at(0.0);
    return grip;
}

chainmail::Reaction Simulation::deform() noexcept
{
    chainmail::Reaction reaction;
    switch (level_) {
        case datasets::ModelLevel::spring:
            reaction = spring_.deform(grip());
            break;
        case datasets::ModelLevel::chainmail:
            reaction = chainmail_.deform(grip());
            break;
        case datasets::ModelLevel::elastic:
            reaction = elastic_[static_cast<std::size_t>(stepsDown_)]->deform(grip());
            break;
    }
    record_.moved = reaction.moved;
    record_.residual = reaction.residual;
    if (reaction.force) {
        record_.penetration = reaction.depth;
    }
    record_.probeForce = reaction.othersForce;
    tip_.others = glm::length(reaction.othersForce);
    return reaction;
}

// Where level `elastic` knows the force of a tool that presses, it is the force, at any depth; else it is the law's. A tool
// that is faster than the body can follow has left most of its way to be made up for: there it feels at least the law's
// fraction of that way, so that it does not get through a thin part unhindered.
Vec3 Simulation::contactForce(Vec3 law, const chainmail::Reaction& reaction) const noexcept
{
    if (tip_.phase == Phase::free || !reaction.force) {
        return law;
    }
    const double depth = glm::distance(tool_.position - tip_.pushed.at(0.0), tip_.proxy);
    const Vec3 least = depth > 0.0 ? std::min(reaction.behind / depth, 1.0) * law : Vec3(0.0);
    return glm::length(*reaction.force) >= glm::length(least) ? *reaction.force : least;
}

// Where the script and the hand have it in this tick.
void Simulation::placeProbe() noexcept
{
    const double time = static_cast<double>(ticks_) * stabiliserOptions_.period;
    probe_.place(datasets::scriptedMove(model_.scene.probe, time) + record_.device.probe, model_.surface);
    record_.probeFace = probe_.at().face;
    record_.probeAxis = probe_.at().direction;
    record_.probeLateral = probe_.at().lateral;
}

void Simulation::seeNeedle() noexcept
{
    if (tip_.phase == Phase::inserted) {
        // What is in air is so at the tip, where the needle has gone through.
        const Vec3 end = tool_.position - tip_.needle.through * tool_.axis;
        const auto seen = probe_.look(end, tool_.axis, tip_.needle.inTissue(), model_.scene.tool.radius);
        record_.needleInBeam = seen.length;
        record_.tipInBeam = seen.tip && tip_.tissue != 0;
    }
}

// The gun fires once per press of its button, and only a needle that is inside takes a core. Bone ends its throw.
void Simulation::fire() noexcept
{
    if (!trigger_.with(record_.device)) {
        return;
    }
    if (tip_.phase != Phase::inserted) {
        if (model_.scene.tool.kind == datasets::ToolKind::needle) {
            addEvent(record_, {EventKind::fireRefused, 0xFF, 0, 0.0});
        }
        return;
    }
    const Throw thrown = throwOf(model_, reader_, body_, tip_.proxy, tool_.position, tool_.axis);
    if (thrown.isBlocked()) {
        addEvent(record_, {EventKind::fireRefused, 0xFF, thrown.bone, 0.0});
        return;
    }
    record_.fired = true;
    record_.core = takeCore(model_, reader_, body_, tip_.needle.cuts, tool_.position, tool_.axis, thrown.length);
    removeCore(model_, body_, record_.core, tool_.position, tip_.needle.cuts);
    const Vec3 middle = 0.5 * (record_.core.notchStart + record_.core.notchEnd);
    const double miss = model_.structures[0].distance.distance(occupancy::restPoint(body_, middle));
    addEvent(record_, {EventKind::fire, 0, tip_.tissue, miss});
    if (thrown.bone != 0) {
        addEvent(record_, {EventKind::throwStopped, 0xFF, thrown.bone, thrown.length});
    }
    monitorThrow(model_, body_, tool_.position, record_.core.notchEnd, record_);
}

}  // namespace palpate::haptics
