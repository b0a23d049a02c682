#pragma once

#include <string>
#include <vector>

namespace palpate::studies {

/// How much stiffness a loop bears against one thing about it.
struct LimitPoint {
    double x = 0;          // in the map's unit
    double predicted = 0;  // (b + b_hand) / (T / 2 + t_d) [N/m]
    double simulated = 0;  // see stableStiffness() [N/m]
};

struct LimitMap {
    std::string name, xLabel;  // "delay", "delay [ms]"
    std::vector<LimitPoint> points;
};

/// A device of 75 g with 0.5 N s/m of friction on a spring: the largest stable stiffness against delay, the hand's damping
/// and the rate of the loop. Formula: Gil et al. 2004. Takes seconds.
std::vector<LimitMap> limitMaps();

}  // namespace palpate::studies
