#include <haptics/broadcast.h>

#include <haptics/scenery.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <limits>
#include <span>

namespace palpate::haptics {

namespace {

constexpr std::uint64_t p99Period = 1000;  // a quantile walks over all bins: once a second is enough

std::array<float, 3> floats(Vec3 v) noexcept
{
    return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

// Those that the score counts.
void showMarks(const TickRecord& r, channel::State& state) noexcept
{
    static_assert(maxMarks == channel::maxMarks);
    constexpr std::uint32_t set = 1, back = 2;
    const std::uint32_t held =
        ((r.device.buttons & buttonMark) != 0 ? set : 0) | ((r.device.buttons & buttonUnmark) != 0 ? back : 0);
    const std::uint32_t pressed = held & ~state.markHeld;
    if ((pressed & set) != 0 && state.marks < channel::maxMarks) {
        // On the surface, where there is one: the tool itself is pressed into it.
        const Vec3 place = r.phase == Phase::contact ? r.proxy : r.tip();
        state.mark[state.marks++] = {floats(place), floats(r.device.axis)};
    }
    if ((pressed & back) != 0 && state.marks > 0) {
        --state.marks;
    }
    state.markHeld = held;
}

}  // namespace

channel::Publisher publisherOf(const std::string& session, const SessionModel& model, std::uint32_t viewersHand,
                               const std::string& who)
{
    return publisherOf(session, model, viewersHand, displayGrid(*model.tissue), who);
}

channel::Publisher publisherOf(const std::string& session, const SessionModel& model, std::uint32_t viewersHand,
                               const volume::NodeGrid& display, const std::string& who)
{
    Showing s = showingOf(model, viewersHand, display);
    s.scenery.who = shownNameOf(who);
    return {session, s.scenery, s.labels, s.image, s.fine};
}

void showTick(const TickRecord& r, const ServoTiming& timing, channel::State& state, double period) noexcept
{
    state.tick = r.tick;
    state.time = static_cast<double>(r.tick) * period;
    state.tip = triple(r.tip());
    state.axis = triple(r.device.axis);
    state.bend = triple(r.deflection);
    state.proxy = triple(r.proxy);
    state.basic = triple(r.basic);
    state.additional = triple(r.additional);
    state.total = triple(r.total);
    state.phase = static_cast<channel::Phase>(r.phase);
    state.status = r.faulted ? channel::Status::faulted : channel::Status::running;
    state.tissue = r.tissue;
    state.inserted = r.inserted;
    state.distance = r.distance;
    if (r.phase == Phase::contact && state.rested < std::numeric_limits<std::uint16_t>::max()) {
        ++state.rested;
    }
    if (r.phase == Phase::inserted && r.distance[0] <= 0.0) {
        state.reached = 1;
    }
    state.warning = static_cast<channel::Warning>(r.warning);
    state.warned = r.warned != 0xFF ? r.warned : r.nearestVital != 0xFF ? r.nearestVital : 0;
    state.ahead = r.ahead.structure;
    state.aheadTissueDistance = r.ahead.tissueDistance;
    state.aheadTissue = r.ahead.tissue;
    state.aheadSpeed = r.ahead.speed;
    state.probe = {triple(r.probeFace), triple(r.probeAxis), triple(r.probeLateral), glm::length(r.probeForce)};
    const std::uint32_t held = (r.device.buttons & buttonPicture) != 0 ? 1 : 0;
    state.pictures += held != 0 && state.pictureHeld == 0 ? 1 : 0;
    state.pictureHeld = held;
    showMarks(r, state);
    if (r.fired) {
        state.hole[state.cores % channel::maxHoles] = {floats(r.core.restStart), floats(r.core.restEnd)};
        ++state.cores;
        state.holes = std::min<std::uint32_t>(state.cores, channel::maxHoles);
        state.coreTarget = r.core.targetFraction;
        state.coreLength = r.core.targetLength;
        if (state.cores == 1 || state.coreTarget > state.bestTarget) {
            state.bestCore = state.cores;
            state.bestTarget = state.coreTarget;
        }
    }
    const auto events = std::span(r.events).first(std::min<std::size_t>(r.eventCount, maxEventsPerTick));
    for (const Event& event : events) {
        if (event.kind == EventKind::fireRefused) {
            state.refused = state.time;
            state.refusedBy = event.tissue;
        } else if (event.kind == EventKind::throwStopped) {
            state.stopped = state.time;
            state.stoppedBy = event.tissue;
            state.thrown = event.value;
        }
    }
    state.missed = timing.missed;
    if (r.tick % p99Period == p99Period - 1) {
        state.tickP99 = timing.work.quantile(0.99);
    }
}

void showShape(const Simulation& simulation, channel::Displaced& out) noexcept
{
    const auto& shape = simulation.shape();
    const auto moved = shape.moved();
    out.count = static_cast<std::uint32_t>(std::min(moved.size(), channel::maxDisplaced));
    for (std::uint32_t i = 0; i < out.count; ++i) {
        const Vec3f u = shape.u()[moved[i]];
        out.nodes[i] = {moved[i], {u.x, u.y, u.z}};
    }
}

Broadcast::Broadcast(const std::string& session, const SessionModel& model, std::uint32_t viewersHand,
                     const std::string& who)
    : publisher_(publisherOf(session, model, viewersHand, who))
{
    static_assert(channel::maxStructures == maxStructures && channel::maxTissues == maxTissues);
}

void Broadcast::publish(const TickRecord& record, const ServoTiming& timing, const Simulation& simulation) noexcept
{
    showTick(record, timing, state_, simulation.period());
    state_.missed = timing.paced ? timing.missed : channel::notCounted;
    state_.standing = channel::Standing::no;
    publisher_.setState(state_);
    if (record.tick % channel::frameTicks == 0) {
        showShape(simulation, publisher_.backBuffer());
        publisher_.backBuffer().tick = record.tick;
        publisher_.publishDisplaced();
    }
}

void Broadcast::stand(channel::Standing how) noexcept
{
    state_.standing = how;
    publisher_.setState(state_);
}

void Broadcast::finish() noexcept
{
    state_.status = state_.status == channel::Status::faulted ? state_.status : channel::Status::finished;
    publisher_.setState(state_);
}

}  // namespace palpate::haptics
