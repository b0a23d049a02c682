#include <haptics/stabiliser.h>

#include <haptics/bounded.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::haptics {

namespace {

constexpr double rampTime = 0.5;    // [s]
constexpr double fadeTime = 0.05;   // [s]
constexpr double slewShare = 0.05;  // of the cap, per tick

bool finite(Vec3 v) noexcept
{
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

Vec3 towards(Vec3 from, Vec3 to, double most) noexcept
{
    const Vec3 step = to - from;
    return glm::length(step) > most ? from + bounded(step, most) : to;
}

}  // namespace

SentForce stabilise(Vec3 basic, Vec3 additional, const DeviceSample& device, double cap, double dt,
                    StabiliserState& s) noexcept
{
    s.faulted = s.faulted || !finite(basic) || !finite(additional) || (device.buttons & poseInvalid) != 0;
    const bool held = (device.buttons & buttonDeadMan) != 0;
    if (s.faulted || !held) {
        s.gain = 0.0;
        s.basic = s.additional = Vec3(0.0);
        return {Vec3(0.0), Vec3(0.0), s.faulted};
    }
    s.gain = std::clamp(s.gain + (device.fresh ? dt / rampTime : -dt / fadeTime), 0.0, 1.0);
    // What is over the cap is no force to return from later.
    s.basic = towards(s.basic, bounded(basic, cap), slewShare * cap);
    s.additional = towards(s.additional, bounded(additional, cap), slewShare * cap);
    const double size = glm::length(s.basic + s.additional);
    const double scale = s.gain * (size > cap ? cap / size : 1.0);
    // One zero and not two: without a force the hash of all forces must not tell from which side it came.
    return {scale * s.basic + 0.0, scale * s.additional + 0.0, false};
}

}  // namespace palpate::haptics
