#pragma once

#include <haptics/session_model.h>

#include <cstddef>
#include <string>
#include <vector>

namespace palpate::studies {

struct StabilityMethod;

/// A needle that a hand drives in along its axis and out again, whatever it feels.
struct NeedleDrive {
    Vec3 entry{0.0};  // on the surface [m]
    Vec3 axis{0, 1, 0};
    double depth = 0;     // furthest ahead of `entry` [m]
    double speed = 0.01;  // [m/s]
};

/// Tissue that begins on a line through the body at rest, or that a needle broke into.
struct NeedleBoundary {
    std::string tissue;
    double depth = 0;  // ahead of the entry; where it was broken into: of the hand [m]
    double force = 0;  // at which it gave way [N]
};

/// Force of one model against depth.
struct NeedleCurve {
    std::string name;
    std::vector<double> depth;              // of the hand ahead of the entry: in, then out again [m]
    std::vector<double> inserted;           // length of the shaft inside, of ours; 0 for others [m]
    std::vector<double> force;              // on the hand, against the way in; below 0 it is held on the way out [N]
    std::size_t turn = 0;                   // first point of the way out
    std::vector<NeedleBoundary> punctures;  // of ours, as records have them; none for others
};

/// Drives a needle through `model` with `method`, from 5 mm outside, without additional force but with all that the
/// stabiliser does.
NeedleCurve driveNeedle(const haptics::SessionModel& model, const StabilityMethod& method, const NeedleDrive& drive,
                        std::string name);

/// Tissues on a line in the body at rest, to 0.1 mm.
std::vector<NeedleBoundary> boundariesOn(const haptics::SessionModel& model, const NeedleDrive& drive);

/// Where something gives way on the way in: the hand's depth [m] at every peak from which the force falls by `least` [N]
/// or more within 1 mm.
std::vector<double> fallsOf(const NeedleCurve& curve, double least);

/// The phantom `layered` under a 14 G needle: Palpate's volume, and the thesis's layers with stiffnesses from the tissue
/// and with one that a user of it would set, `layerStiffness`.
struct LayeredNeedle {
    std::vector<NeedleBoundary> boundaries;
    std::vector<NeedleCurve> curves;  // ours first
};
/// @param level  of ours
LayeredNeedle layeredNeedle(datasets::ModelLevel level, double speed);

/// K of equation 2 for every layer [N/m]. Assumed: high enough that each gives way within its own thickness.
inline constexpr double layerStiffness = 300.0;

/// Bovine liver: Simone and Okamura 2002 before the capsule breaks; then cutting and friction by length, Okamura, Simone,
/// O'Leary 2004 (recall); a model is good when it is within `liverSpread` of the measured force (Barnett 2015, recall).
double publishedLiverForce(double depth) noexcept;                          // before it breaks [N]
inline constexpr double liverCutting = 0.94;                                // [N]
inline constexpr double liverFrictionLow = 10.0, liverFrictionHigh = 19.0;  // [N/m]
inline constexpr double liverSpread = 0.2;                                  // [N]

/// Our force in liver beside the published one.
struct LiverNeedle {
    NeedleCurve curve;
    double youngsModulus = 0, radius = 0, speed = 0;  // [Pa], of the needle [m], [m/s]
    double furthestBefore = 0;                        // largest difference before the capsule breaks [N]
    double outsideAfter = 0;  // largest distance from the published band, with its spread, after it [N]
};
/// In the modulus that the published curve implies; then with the table's modulus, a 14 G needle and ten times the speed,
/// each alone; then as a session has it.
std::vector<LiverNeedle> liverNeedles(datasets::ModelLevel level);

/// A ball pressed into fat beside a vessel, which gives way.
struct OnsetPoint {
    double pressed = 0;   // depth of the ball [m]
    double moved = 0;     // of the vessel [m]
    double deformed = 0;  // distance from the ball's middle to the vessel, as warnings take it [m]
    double rest = 0;      // to where the vessel was [m]
};
struct Onset {
    std::vector<OnsetPoint> points;
    double warnDistance = 0;                  // [m]
    double warnedAt = 0;                      // depth of the ball at the record's warning [m]
    double restOnset = 0, deformedOnset = 0;  // where either distance falls below the warning's [m]; infinite: never
};
Onset warningOnset(double speed);

}  // namespace palpate::studies
