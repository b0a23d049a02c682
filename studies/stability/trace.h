#pragma once

#include <studies/stability/scene.h>

#include <vector>

namespace palpate::studies {

/// A session in a scene, tick by tick.
struct Trace {
    double period = 1e-3;        // [s]
    double cap = 0;              // of the force [N]
    double encoder = 0;          // step of the device's encoder [m]
    double stiffest = 0;         // that the device may be made to feel: haptics::stableLimits() [N/m]
    double handSpring = 0;       // sqrt(stiffness x moving mass) of hand and device [N s/m]; 0 without a hand
    double residue = 0;          // of the tissue at the end [m]
    std::vector<Vec3> position;  // true, of the tool at each tick [m]
    std::vector<double> speed;   // true [m/s]
    std::vector<double> work;    // of the motors on device and hand so far [J]
    std::vector<Vec3> force;     // sent at that tick and held for a period [N]
    std::vector<Vec3> tissue;    // before a controller, where there is one: else the same [N]

    double time(std::size_t tick) const noexcept { return static_cast<double>(tick) * period; }
};

/// A figure of a trace, in its unit; not finite where a force was not.
double figureOf(Figure figure, const Trace& trace, const StabilityScene& scene);

}  // namespace palpate::studies
