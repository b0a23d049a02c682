#include <haptics/probe_hand.h>

#include <haptics/motor.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::haptics {

constexpr double shaft = 20e-3;     // of the needle that the plane is laid along [m]
constexpr double minAlong = 8e-3;   // between tip and shaft in the picture: below, a turn is not asked for [m]
constexpr double maxTurn = 0.5;     // from where the scene has the probe [rad]
constexpr double maxSweep = 25e-3;  // likewise [m]
constexpr double wanderTime = 1.0;  // after so long it has forgotten which way it went [s]

ProbeHand::ProbeHand(const datasets::ProbeSpec& probe, const Skill& skill, std::uint64_t seed)
    : holds_(probe.kind != datasets::ProbeKind::none), skill_(skill), random_(seed ^ 0x70726F6265U)
{
    if (holds_) {
        move_.sweep = skill_.plane * normal();
        move_.turn = skill_.plane / shaft * normal();
        to_ = from_ = move_;
    }
}

double ProbeHand::normal() noexcept
{
    return normalOf(random_);
}

// Shifted by s and turned by t, the plane has what is y across it and l along the face at y - s - t l.
void ProbeHand::look() noexcept
{
    if (!holds_) {
        return;
    }
    const double along = tipAlong_ - shaftAlong_;
    const double turn = std::abs(along) > minAlong ? (tipAcross_ - shaftAcross_) / along : 0.0;
    const double sweep = tipAcross_ - turn * tipAlong_;
    from_ = to_ = move_;
    to_.sweep = std::clamp(move_.sweep + sweep + skill_.plane * normal(), -maxSweep, maxSweep);
    to_.turn = std::clamp(move_.turn + turn + skill_.plane / shaft * normal(), -maxTurn, maxTurn);
    inLook_ = 0.0;
}

bool ProbeHand::wantsAnother() noexcept
{
    return holds_ && !sees_ && random_.between(0.0, 1.0) < skill_.vigilance;
}

void ProbeHand::observe(const TickRecord& record) noexcept
{
    sees_ = record.tipInBeam;
    const Vec3 across = glm::cross(record.probeAxis, record.probeLateral);
    const Vec3 tip = record.tip() - record.probeFace;
    const Vec3 up = tip - shaft * record.device.axis;
    tipAcross_ = glm::dot(tip, across);
    tipAlong_ = glm::dot(tip, record.probeLateral);
    shaftAcross_ = glm::dot(up, across);
    shaftAlong_ = glm::dot(up, record.probeLateral);
}

datasets::ProbeMove ProbeHand::read() noexcept
{
    if (!holds_) {
        return {};
    }
    // A speed that forgets itself (Ornstein-Uhlenbeck), of standard deviation `wander`.
    constexpr double fades = tickSeconds / wanderTime;
    wander_ += -fades * wander_ + skill_.wander * std::sqrt(2.0 * fades) * normal();
    if (inLook_ < lookTime) {
        inLook_ += tickSeconds;
        const double fraction = minimumJerk(inLook_ / lookTime);
        move_.sweep = from_.sweep + fraction * (to_.sweep - from_.sweep);
        move_.turn = from_.turn + fraction * (to_.turn - from_.turn);
    } else {
        move_.sweep = std::clamp(move_.sweep + wander_ * tickSeconds, -maxSweep, maxSweep);
    }
    return move_;
}

}  // namespace palpate::haptics
