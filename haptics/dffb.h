#pragma once

#include <datasets/scene.h>
#include <haptics/tick.h>

#include <array>
#include <cstddef>
#include <cstdint>

namespace palpate::haptics {

/// One structure as the tool sees it now.
struct Proximity {
    double distance = 0;  // tip to the structure's surface in the deformed tissue, negative inside [m]
    Vec3 away{0, 0, 1};   // unit vector from the structure to the tip; inside, shorter where no side is the nearest
    double gain = 1;
    bool vital = true;      // false for the target
    bool touching = false;  // by the tool's surface
};

/// State of the additional force between ticks.
struct DffbState {
    Vec3 mass{0.0};           // position of the virtual mass [m]
    Vec3 massVelocity{0.0};   // [m/s]
    Vec3 last{0.0};           // tip in the tick before [m]
    Vec3 velocity{0.0};       // of the tip, low-passed [m/s]
    std::uint8_t cursor = 1;  // `thesis`: row of the lookup table that is the nearest vital structure now
    double presence = 0;      // fraction of the force that contact has brought in
    double time = 0;          // of the session [s]
    bool started = false;
};

/// Additional force F_AFFB of equations 3-8 of the thesis [N], before the slew limit and the cap.
///
/// Equation 4 divides a force by a distance; we read it as (structure + tissue) * d0 / max(d, d0), with d0 the floor
/// distance, so that it is a force and stays finite.
///
/// `thesis`: the lookup table in order: the next vital structure is taken on contact with the present one. A virtual
/// mass hangs on the tip by spring and damper (equation 5; GHOST's inertia effect) with the summed parameters of
/// equations 6-8; the sum of magnitudes in equation 3 bounds the force, on mass and tip alike, so that the bound makes no
/// energy.
/// `field`: every vital structure pushes away with its gain times equation 4, faded to zero at `range`; the nearer the
/// tip is to a vital structure or to the target, the more the damping of equation 8 slows it. At most `budget` in all.
///
/// All of it is scaled by the scene's gain, which in a study may fade to nothing over the session.
///
/// @param structures  target first
/// @param touching    the tool touches tissue: without contact there is no such force; it comes and goes within contactFade
Vec3 additionalForce(const datasets::DffbParameters& p, std::size_t count,
                     const std::array<Proximity, maxStructures>& structures, Vec3 tip, bool touching, double dt,
                     DffbState& state) noexcept;

inline constexpr double contactFade = 0.05;  // [s]

}  // namespace palpate::haptics
