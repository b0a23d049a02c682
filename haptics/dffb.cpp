#include <haptics/dffb.h>

#include <haptics/bounded.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <numbers>

namespace palpate::haptics {

namespace {

using datasets::DffbParameters;
using datasets::ForceTerm;

// Velocities pass a first-order low-pass at this frequency: encoder steps of 0.03 mm read as 30 mm/s at 1 kHz [Hz].
constexpr double velocityBand = 30.0;

ForceTerm operator+(const ForceTerm& a, const ForceTerm& b) noexcept
{
    return {a.force + b.force, a.mass + b.mass, a.damping + b.damping, a.stiffness + b.stiffness};
}

ForceTerm operator*(double s, const ForceTerm& t) noexcept
{
    return {s * t.force, s * t.mass, s * t.damping, s * t.stiffness};
}

// Equation 4, as a fraction of (structure + tissue).
double nearness(const DffbParameters& p, double distance) noexcept
{
    return p.floorDistance / std::max(distance, p.floorDistance);
}

// Falls smoothly from 1 at contact to 0 at `range`.
double fade(const DffbParameters& p, double distance) noexcept
{
    const double t = p.range > 0.0 ? std::clamp(1.0 - std::max(distance, 0.0) / p.range, 0.0, 1.0) : 0.0;
    return t * t * (3.0 - 2.0 * t);
}

// Equation 5: the mass hangs on the tip. Implicit in the spring and damper, so that no choice of M, C, K blows up. Force
// and counterforce are bounded together.
Vec3 inertiaEffect(const ForceTerm& sum, Vec3 tip, double dt, DffbState& s) noexcept
{
    if (sum.mass <= 0.0) {
        s.mass = tip;
        s.massVelocity = s.velocity;
        return Vec3(0.0);
    }
    const Vec3 stretch = tip - s.mass;
    const double implicit = sum.mass + dt * sum.damping + dt * dt * sum.stiffness;
    const Vec3 drive = dt * (sum.stiffness * stretch + sum.damping * s.velocity) + sum.mass * s.massVelocity;
    const Vec3 onMass = bounded(sum.mass * (drive / implicit - s.massVelocity) / dt, sum.force);
    s.massVelocity += dt / sum.mass * onMass;
    s.mass += dt * s.massVelocity;
    return -onMass;
}

Vec3 thesisForce(const DffbParameters& p, std::size_t count, const std::array<Proximity, maxStructures>& structures,
                 Vec3 tip, double dt, DffbState& s) noexcept
{
    ForceTerm sum = p.surgery + p.structure + p.tissue + p.task;
    if (s.cursor < count) {
        sum = sum + nearness(p, structures[s.cursor].distance) * (p.structure + p.tissue);
        if (structures[s.cursor].touching) {
            ++s.cursor;
        }
    }
    return inertiaEffect(sum, tip, dt, s);
}

Vec3 fieldForce(const DffbParameters& p, std::size_t count, const std::array<Proximity, maxStructures>& structures,
                const DffbState& s) noexcept
{
    const ForceTerm both = p.structure + p.tissue;
    Vec3 push(0.0);
    double near = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
        const Proximity& one = structures[i];
        const double fraction = nearness(p, one.distance) * fade(p, one.distance);
        near = std::max(near, fraction);
        if (one.vital) {
            push += one.gain * fraction * both.force * one.away;
        }
    }
    const ForceTerm sum = p.surgery + p.task + both;
    return bounded(push - near * sum.damping * s.velocity, p.budget);
}

// A constant, or a line down to zero.
double sessionGain(const DffbParameters& p, double time) noexcept
{
    return p.gain * (p.fade > 0.0 ? std::max(1.0 - time / p.fade, 0.0) : 1.0);
}

}  // namespace

Vec3 additionalForce(const DffbParameters& p, std::size_t count, const std::array<Proximity, maxStructures>& structures,
                     Vec3 tip, bool touching, double dt, DffbState& s) noexcept
{
    if (!s.started) {
        s.last = s.mass = tip;
        s.started = true;
    }
    const double blend = 1.0 - 1.0 / (1.0 + 2.0 * std::numbers::pi * velocityBand * dt);
    s.velocity += blend * ((tip - s.last) / dt - s.velocity);
    s.last = tip;
    s.time += dt;
    s.presence = std::clamp(s.presence + (touching ? dt : -dt) / contactFade, 0.0, 1.0);
    if (p.mode == datasets::DffbMode::off || s.presence <= 0.0) {
        s.mass = tip;
        s.massVelocity = s.velocity;
        return Vec3(0.0);
    }
    const Vec3 force = p.mode == datasets::DffbMode::thesis ? thesisForce(p, count, structures, tip, dt, s)
                                                            : fieldForce(p, count, structures, s);
    return s.presence * sessionGain(p, s.time) * force;
}

}  // namespace palpate::haptics
