#pragma once

#include <haptics/arm.h>

#include <string>
#include <vector>

namespace palpate::studies {

/// A limit of stability: a formula against the simulated device.
struct TheoryRow {
    std::string name;      // with the unit
    double predicted = 0;  // by the formula
    double simulated = 0;  // where the simulation goes from decay to growth

    double errorPct() const noexcept { return 100.0 * (simulated - predicted) / predicted; }
};

/// A virtual spring K with damper B (backward difference), sampled and held, on haptics::Arm:
///
/// - 2 b / T, with a hand of 0, 1 and 3 N s/m (Colgate and Schenkel, "Passivity of a class of sampled-data systems", 1997);
/// - (b + B) / (T / 2 + t_d) at delays of 0 to 16 ms, with and without B (Gil et al., "Stability analysis of a 1 DOF haptic
///   interface using the Routh-Hurwitz criterion", 2004);
/// - the energy that the worst motion draws from a wall: 2 b / T by a long stroke, 2 c / D by one of an encoder step D
///   (Abbott and Okamura, "Effects of position quantization and sampling rate on virtual-wall passivity", 2005);
/// - with Coulomb friction c, the release amplitude 4 c / (pi (K T / 2 - b) sqrt(K / m)) above which an oscillation grows
///   (describing function).
///
/// Each limit by bisection. Takes about a second.
std::vector<TheoryRow> theoryRows();

/// How much stiffness a loop bears against one thing about it.
struct LimitPoint {
    double x = 0;          // in the map's unit
    double predicted = 0;  // (b + b_hand) / (T / 2 + t_d) [N/m]
    double simulated = 0;  // [N/m]
};

struct LimitMap {
    std::string name, xLabel;  // "delay", "delay [ms]"
    std::vector<LimitPoint> points;
};

/// A device of 75 g with 0.5 N s/m of friction on a spring: the largest stable stiffness against delay, the hand's damping
/// and the rate of the loop. Formula: Gil et al. 2004. Takes seconds.
std::vector<LimitMap> limitMaps();

}  // namespace palpate::studies
