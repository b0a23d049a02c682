#include <haptics/stabiliser.h>

#include <haptics/bounded.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::haptics {

namespace {

constexpr double rampTime = 0.5;   // [s]
constexpr double fadeTime = 0.05;  // [s]
constexpr double slewRate = 50.0;  // of the cap, per second
constexpr double fallShare = 0.7;  // of the slew beside what the motion asks for, where that is known to about the rest
constexpr double riseShare = 0.9;  // of the slew for the tissue, the rest for ramp and damping
constexpr double fastestMotion = 10.0;    // of a hand [m/s]
constexpr double slowMotion = 0.03;       // [m/s]
constexpr double settledMotion = 1.0;     // of a pose that can be believed again after a jump [m/s]
constexpr double settlingTime = 0.02;     // [s]
constexpr double stiffnessShare = 0.5;    // of the stable limit
constexpr double stiffestPress = 7e3;     // stiffer is no device's frame [N/m]
constexpr double dampingShare = 0.35;     // of the mass over the time that the damping is late
constexpr double margin = 1.2;            // of damping over the leak
constexpr double frictionShare = 0.5;     // of the device's Coulomb friction is counted on
constexpr double catchUpTime = 0.1;       // of the coupling, standing still [s]
constexpr double restTime = 0.03;         // after which the hand stands still [s]
constexpr double lateFall = 2e-3;         // way out of tissue that asks for more than the cap, before the cap falls [m]
constexpr double noForce = 1e-9;          // what rounding leaves [N]
constexpr double energyAllowed = 0.4e-3;  // that tissue may give beyond what it got [J]
constexpr double energyRounding = 1e-9;   // of positions [m]
constexpr double guardTime = 0.02;        // from full force to none, and back [s]

bool finite(Vec3 v) noexcept
{
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// Whether cap, period and delay are such that a force can be limited by them.
bool isLimiting(const StabiliserOptions& o) noexcept
{
    return o.device.delay >= 0.0 && std::isfinite(o.device.delay) && o.cap >= 0.0 && o.device.peakForce >= 0.0 &&
           o.period > 0.0 && std::isfinite(o.period);
}

// Nothing is sent from now on.
SentForce endInFault(StabiliserState& s) noexcept
{
    s.faulted = true;
    s.sent = {};
    s.ledger.sent[s.ledger.ticks++ % EnergyLedger::longest] = {};
    return {Vec3(0.0), Vec3(0.0), true};
}

// From the moment of a sample to the middle of the force that answers it.
double lateness(const StabiliserOptions& o) noexcept
{
    const double lag = o.device.bandwidth > 0.0 ? 1.0 / (2.0 * std::numbers::pi * o.device.bandwidth) : 0.0;
    return 0.5 * o.period + o.device.delay + lag;
}

// The way since the last sample; none for a pose that is not to be believed.
Vec3 wayOf(const DeviceSample& device, const StabiliserOptions& o, StabiliserState& s, bool& believed) noexcept
{
    const Vec3 way = s.started ? device.position - s.position : Vec3(0.0);
    s.position = device.position;
    s.started = true;
    const double speed = glm::length(way) / o.period;
    if (speed > fastestMotion || (s.unsettled > 0.0 && speed > settledMotion)) {
        s.unsettled = settlingTime;
    } else {
        s.unsettled = std::max(0.0, s.unsettled - o.period);
    }
    believed = s.unsettled <= 0.0;
    return believed ? way : Vec3(0.0);
}

// The force that was in the motors between the last two samples, as a mean over that time.
RenderedForce heldForce(const EnergyLedger& l, const StabiliserOptions& o) noexcept
{
    const double periods = std::min(o.device.delay / o.period, static_cast<double>(EnergyLedger::longest - 3));
    const auto whole = static_cast<std::size_t>(periods);
    const double later = periods - static_cast<double>(whole);
    const auto ago = [&](std::size_t n) { return n <= l.ticks ? l.sent[(l.ticks - n) % l.longest] : RenderedForce{}; };
    const RenderedForce newer = ago(whole + 1), older = ago(whole + 2);
    const auto mean = [&](Vec3 a, Vec3 b) { return (1.0 - later) * a + later * b; };
    return {mean(newer.basic, older.basic), mean(newer.additional, older.additional), mean(newer.damping, older.damping)};
}

void account(Vec3 way, const StabiliserOptions& o, EnergyLedger& l) noexcept
{
    const RenderedForce held = heldForce(l, o);
    l.given += glm::dot(held.total(), way);
    l.tissue += glm::dot(held.basic + held.damping, way) - frictionShare * o.device.coulomb * glm::length(way);
    l.damped -= glm::dot(held.damping, way);
}

// The fraction of tissue and damping that may still be sent. The guard below takes the direction of the next way from the
// last ones; what reverses faster than it acts is out of step with it and gives energy in both directions. The ledger
// sees that without a direction: the debt grows beyond its worst after the guard has had its time. It counts until all
// is paid, so that the debt of any poses has a bound.
double trust(double dt, EnergyLedger& l) noexcept
{
    const bool owes = l.tissue > 2.0 * energyAllowed;
    l.owing = owes ? l.owing + dt : 0.0;
    l.again = owes ? l.again + (l.owing > guardTime ? std::max(0.0, l.tissue - l.worst) : 0.0) : 0.0;
    l.worst = owes ? std::max(l.worst, l.tissue) : 0.0;
    return std::clamp(1.0 - l.again / energyAllowed, 0.0, 1.0);
}

// The nearest change of force that a tissue of stiffness 0 to `stiffest` could answer the way with.
Vec3 answerable(Vec3 change, Vec3 way, double stiffest) noexcept
{
    const Vec3 middle = -0.5 * stiffest * way;
    return middle + bounded(change - middle, 0.5 * stiffest * glm::length(way));
}

// Time that the position has stayed within an encoder step or two of one place.
void watchRest(Vec3 position, const StabiliserOptions& o, StabiliserState& s) noexcept
{
    const bool rests = glm::distance(position, s.resting) <= 1.5 * o.device.encoder + energyRounding;
    s.rest = rests ? s.rest + o.period : 0.0;
    s.resting = rests ? s.resting : position;
}

// Of a force above the cap, as much as tissue as stiff as this one has on `lateFall`. It is what the force falls by before
// the tissue is back at the cap: a hand that is let go at full load would gain energy without it, and with all of what is
// above the cap, the force would be gone long before the hand is out.
Vec3 beyondCap(Vec3 basic, Vec3 position, double cap, StabiliserState& s) noexcept
{
    const double size = glm::length(basic);
    if (size <= cap) {
        return basic;
    }
    if (s.gain <= 0.0) {
        s.atCap = position + lateFall / size * basic;  // not known: all of it
    }
    const double deeper = -glm::dot(position - s.atCap, basic) / size;
    return bounded(basic, cap + (size - cap) * (deeper > lateFall ? lateFall / deeper : 1.0));
}

// A smaller force costs a hand nothing and is taken over at once, but for its direction: that may have been far behind, and
// goes there by `most` at a time.
Vec3 turned(Vec3 from, Vec3 to, double most) noexcept
{
    const double size = glm::length(from);
    const Vec3 smaller = size > 0.0 ? std::min(1.0, glm::length(to) / size) * from : Vec3(0.0);
    return smaller + bounded(to - smaller, most);
}

// `limit` is the stable stiffness, `rise` how much the force may grow in this tick: pressed faster than that it falls
// behind here, and not in a limit behind, so that on the way out it is already on its way down. The tissue's own change is
// that beyond the cap, for the same reason; see beyondCap().
Vec3 couple(Vec3 tissue, Vec3 way, double limit, double cap, double rise, const StabiliserOptions& o,
            StabiliserState& s) noexcept
{
    const Vec3 wanted = bounded(tissue, cap);
    const double length = glm::length(way);
    const bool pressing = glm::dot(s.coupled + wanted, way) <= 0.0;
    const double stiffest = pressing && limit * length > rise ? rise / length : limit;
    // What has fallen behind catches up where that costs less than friction takes: pressed less on the way in than on the
    // way out a hand is given energy.
    const bool slow = glm::length(motionIn(s.window, o.device.encoder, o.period).velocity) < slowMotion;
    const Vec3 change = pressing && slow ? wanted - s.coupled : tissue - s.tissue;
    Vec3 next = bounded(s.coupled + answerable(change, way, stiffest), cap);
    const Vec3 behind = wanted - next;
    if (glm::length(wanted) <= glm::length(next) || glm::length(behind) < noForce) {
        next = turned(next, wanted, rise);
    } else if (glm::dot(next, wanted) < 0.0) {
        next = Vec3(0.0);
    } else if (s.rest >= restTime) {
        next += o.period / catchUpTime * behind;
    }
    s.tissue = tissue;
    s.coupled = next;
    return next;
}

// How much the force may change where it falls with the motion: that which was estimated, less what half a step of the
// encoder may have added to it, and no more than was read. In periods under a millisecond the way is one of such steps:
// there the speed says what it was.
double maxFall(Vec3 way, double read, const Motion& motion, double slew, double stiffness,
               const StabiliserOptions& o) noexcept
{
    const double unsure = 0.5 * o.device.encoder;
    double estimated = slew + stiffness * std::max(0.0, glm::length(way) - unsure);
    if (o.period < tickSeconds) {
        const double sure = motion.time * glm::length(motion.velocity) - unsure;
        const double speed = motion.time > 0.0 ? std::max(0.0, sure) / motion.time : 0.0;
        estimated = std::max(slew, fallShare * slew + stiffness * o.period * speed);
    }
    return std::min(estimated, slew + stiffness * read);
}

// What the held, late force gives too much, less what the device's friction takes.
Vec3 leakDamping(const Motion& motion, double stiffness, const StabiliserOptions& o, double strongest) noexcept
{
    const double speed = glm::length(motion.velocity);
    if (speed <= 0.0) {
        return Vec3(0.0);
    }
    const double needed = (margin * stiffness * lateness(o) - o.device.viscous) * speed - frictionShare * o.device.coulomb;
    return -std::clamp(needed, 0.0, strongest * speed) / speed * motion.velocity;
}

// What an ideal port would have taken for the force as it is, and has yet to give back.
void store(Vec3 before, Vec3 now, Vec3 way, EnergyLedger& l) noexcept
{
    l.stored = glm::length(now) < noForce ? 0.0 : std::max(0.0, l.stored - 0.5 * glm::dot(before + now, way));
}

// The fraction of the force that, kept on all the way out, leaves no more than twice the energy allowed. Poses that do not
// come say nothing of the energy that goes out: then the worst is presumed, a hand that goes on as fast as it did, straight
// along the force.
double guardGain(Vec3 basic, const DeviceSample& device, Vec3 velocity, double dt, StabiliserState& s) noexcept
{
    s.speed = device.fresh ? glm::length(velocity) : s.speed;
    s.presumed = device.fresh ? 0.0 : s.presumed + dt * s.speed * glm::length(s.sent.basic + s.sent.damping);
    const bool outwards = !device.fresh || glm::dot(basic, velocity) > 0.0;
    const double left = 2.0 * energyAllowed - s.ledger.tissue - s.presumed;
    const double allowed = outwards ? std::clamp(left / (energyAllowed + s.gain * s.ledger.stored), 0.0, 1.0) : 1.0;
    const double most = dt / guardTime;
    s.guard += std::clamp(allowed - s.guard, -most, most);
    return s.guard;
}

RenderedForce scaled(double by, const RenderedForce& f) noexcept
{
    return {by * f.basic, by * f.additional, by * f.damping};
}

// The largest fraction of `step` that keeps |from + share step| at `most` or below, where |from| is.
double shareWithin(Vec3 from, Vec3 step, double most) noexcept
{
    const double a = glm::dot(step, step);
    if (glm::length(from + step) <= most || a <= 0.0) {
        return 1.0;
    }
    const double b = glm::dot(from, step);
    const double c = std::max(0.0, most * most - glm::dot(from, from));
    return std::clamp((std::sqrt(b * b + a * c) - b) / a, 0.0, 1.0);
}

// The basic force and its damping go their way whatever the additional force does; that follows as far as the sum may
// change.
RenderedForce towards(const RenderedForce& from, const RenderedForce& to, double most, double cap) noexcept
{
    RenderedForce next = to;
    const Vec3 way = to.basic - from.basic;
    next.basic = glm::length(way) > most ? from.basic + bounded(way, most) : to.basic;
    const Vec3 additional = to.additional - from.additional, damping = to.damping - from.damping;
    if (const double fraction = shareWithin(next.basic - from.basic, damping, most); fraction < 1.0) {
        next.damping = from.damping + fraction * damping;
    }
    const Vec3 changed = next.basic - from.basic + next.damping - from.damping;
    const double fraction = std::min(shareWithin(changed, additional, most), shareWithin(Vec3(0.0), additional, most));
    if (fraction < 1.0) {
        next.additional = from.additional + fraction * additional;
    }
    // To the nearest sum within the cap: no further from the last than before.
    const double size = glm::length(next.total());
    return size > cap ? scaled(cap / size, next) : next;
}

void remember(Vec3 position, const RenderedForce& rendered, bool believed, MotionWindow& w) noexcept
{
    if (!believed) {
        w.read.count = 0;
        return;
    }
    w.read.add(position);
    w.force[w.read.newest] = rendered.basic + rendered.additional;
    w.basic[w.read.newest] = rendered.basic;
}

}  // namespace

StableLimits stableLimits(const StabiliserOptions& o) noexcept
{
    StableLimits limits;
    limits.damping = dampingShare * o.device.mass / (lateness(o) + 0.5 * longestStraight);
    limits.stiffness = stiffnessShare * (o.device.viscous + limits.damping) / lateness(o);
    limits.pressed = std::min(limits.stiffness, stiffestPress);
    const bool steps = o.device.encoder > 0.0 && o.device.coulomb > 0.0;
    limits.resting = steps ? std::min(limits.pressed, 2.0 * o.device.coulomb / o.device.encoder) : limits.pressed;
    return limits;
}

Motion motionIn(const MotionWindow& w, double encoder, double period) noexcept
{
    const std::size_t length = straightSince(w.read, encoder, period);
    if (length == 0) {
        return {};
    }
    const auto change = [&](const auto& of) { return of[w.read.newest] - of[w.read.back(length)]; };
    const Vec3 way = change(w.read.position);
    const double square = glm::dot(way, way);
    const auto stiffness = [&](const auto& of) {
        return square > 0.0 ? std::max(0.0, -glm::dot(change(of), way) / square) : 0.0;
    };
    const double time = static_cast<double>(length) * period;
    return {way / time, time, stiffness(w.force), stiffness(w.basic)};
}

SentForce stabilise(Vec3 basic, Vec3 additional, const DeviceSample& device, Vec3 read, const StabiliserOptions& o,
                    StabiliserState& s) noexcept
{
    if (!isLimiting(o)) {
        return endInFault(s);
    }
    const double readWay = s.started ? glm::distance(read, s.read) : 0.0;
    s.read = read;
    s.faulted = s.faulted || !finite(basic) || !finite(additional) || (device.buttons & poseInvalid) != 0;
    bool believed = true;
    const Vec3 way = wayOf(device, o, s, believed);
    account(way, o, s.ledger);
    const bool held = (device.buttons & buttonDeadMan) != 0;
    const double cap = std::min(o.cap, o.device.peakForce);
    RenderedForce sent;
    if (believed && glm::length(basic) <= cap) {
        s.atCap = device.position;
    }
    if (s.faulted || !held) {
        s.gain = 0.0;
        s.window.read.count = 0;
        // What was put in is not given back any more, and no credit for another place.
        s.ledger.tissue = std::max(s.ledger.tissue, 0.0);
        s.ledger.stored = 0.0;
        s.ledger.again = 0.0;
    } else {
        const StableLimits limits = stableLimits(o);
        const double slew = slewRate * o.period * cap;
        const Vec3 tissue = beyondCap(basic, device.position, cap, s);
        if (s.gain <= 0.0) {
            // The ramp alone brings in what is there at the start.
            s.tissue = tissue;
            s.coupled = bounded(tissue, cap);
        }
        watchRest(device.position, o, s);
        const Vec3 before = s.coupled;
        sent.basic = couple(tissue, way, s.rest >= restTime ? limits.resting : limits.pressed, cap, riseShare * slew, o, s);
        store(before, sent.basic, way, s.ledger);
        sent.additional = bounded(additional, cap);
        remember(device.position, sent, believed, s.window);
        const Motion motion = motionIn(s.window, o.device.encoder, o.period);
        // So that without additional force the basic one is the same: what that alone asks for, and the rest.
        const double trusted = trust(o.period, s.ledger);
        sent.damping = trusted * leakDamping(motion, motion.basic, o, limits.damping);
        sent.additional += trusted * leakDamping(motion, motion.stiffness, o, limits.damping) - sent.damping;
        sent.basic *= trusted * guardGain(sent.basic, device, motion.velocity, o.period, s);
        s.gain = std::clamp(s.gain + (device.fresh && believed ? o.period / rampTime : -o.period / fadeTime), 0.0, 1.0);
        const double size = glm::length(sent.total());
        sent = scaled(s.gain * (size > cap ? cap / size : 1.0), sent);
        // A spring that is let go gives energy where its force does not fall with the motion.
        const bool falls =
            device.fresh && glm::dot(s.sent.basic, way) > 0.0 && glm::length(sent.total()) < glm::length(s.sent.total());
        sent = towards(s.sent, sent, falls ? maxFall(way, readWay, motion, slew, limits.stiffness, o) : slew, cap);
    }
    if (!finite(sent.total())) {
        return endInFault(s);
    }
    s.sent = sent;
    s.ledger.sent[s.ledger.ticks++ % EnergyLedger::longest] = sent;
    // One zero and not two: without a force the hash of all forces must not tell from which side it came.
    return {sent.basic + sent.damping + 0.0, sent.additional + 0.0, s.faulted};
}

}  // namespace palpate::haptics
