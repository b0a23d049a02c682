#pragma once

#include <haptics/cuts.h>
#include <haptics/relaxing_force.h>
#include <haptics/session_model.h>
#include <haptics/tick.h>

namespace palpate::haptics {

struct TipState;

/// A needle that is inside, and what needles have left behind.
struct NeedleState {
    Vec3 entry{0.0};               // where it went in, at rest [m]
    double inserted = 0;           // length of the shaft from `entry` to the tip, at rest [m]
    double through = 0;            // of it in air, where the needle went out of the tissue again [m]
    bool wentThrough = false;      // its tip has been in air since `entry`
    Vec3 last{0.0};                // the tool's tip in the tick before [m]
    double speed = 0;              // of the shaft along the needle, low-passed [m/s]
    double shaftForce = 0;         // of the shaft on the tissue around it, along the needle [N]
    double shaftStiffness = 0;     // of that tissue [N/m]
    double sideStiffness = 0;      // and sideways [N/m]
    RelaxingForce tipLost = {};    // of the force at the tip
    RelaxingForce shaftLost = {};  // and of `shaftForce`
    int sliding = 0;               // the way the shaft slides along the needle; 0: it sticks
    double curvature = 0;          // of a bevelled needle's path [1/m]
    Vec3 bendsTo{0.0};             // unit vector across the needle
    std::uint64_t lobe = 0;        // of the tip, between inner walls; 0 where the tissue has none
    Cuts cuts;

    /// How far the tissue is carried along with the shaft [m].
    double drag() const noexcept { return shaftStiffness > 0.0 ? shaftForce / shaftStiffness : 0.0; }
    /// Length of the shaft in tissue, at rest [m].
    double inTissue() const noexcept { return inserted - through; }
};

/// The needle breaks into the tissue at the proxy.
void enterNeedle(const SessionModel& model, const DeviceSample& tool, TipState& tip) noexcept;

/// One tick of a needle that is inside: cutting at its tip, stick and slip along its shaft, tissue that holds it sideways.
/// Returns the force on the hand [N]; leaves `tip.needle.inserted` negative when it is out.
///
/// Cutting: the tip's force stays at the cutting force of the tissue, and a boundary to another tissue holds until that
/// one's puncture force is reached, an inner wall until what it has beyond the cutting force is. Where it was cut before,
/// and in air, nothing holds. What a rupture sets free goes into the tissue: the proxy catches up with the tip, and the
/// hand's force only falls.
///
/// Friction: Karnopp's model with the velocity window of Okamura, Simone and O'Leary, "Force modeling for needle insertion
/// into soft tissue", IEEE Trans. Biomed. Eng. 51, 2004. A shaft that sticks carries the tissue with it against that
/// tissue's stiffness, 2 pi G L / ln(2.5 L (1 - nu) / r) (Randolph and Wroth, "Analysis of deformation of vertically loaded
/// piles", 1978), and breaks loose at the stiction of its inserted length; then it slides at its friction, until it is
/// slower than the window or turns round. When the tissue that holds it changes, the stored energy never grows.
///
/// Where the scene's tissue relaxes, what tip and shaft hold falls by its Prony series. Tissue that is cut or slides is new
/// to the needle: it has not relaxed, and gives the table's forces.
Vec3 moveNeedle(const SessionModel& model, const volume::Tissue::Reader& reader, const DeviceSample& tool, double dt,
                TipState& tip, TickRecord& record) noexcept;

/// The tool with its tip where a bent needle has it: on an arc of the path's curvature, off the device's line by
/// curvature inserted^2 / 2. Without a bevel the device's own pose.
DeviceSample bentTool(const DeviceSample& device, const NeedleState& needle) noexcept;

/// Curvature of the path of a bevelled needle in one tissue [1/m].
///
/// To first order: the cutting force F on a bevel of angle b pushes the tip aside with P = F / tan(b). On a beam of bending
/// stiffness B in a bed of stiffness k that turns the tip by 2 P l^2 / k over the length 1 / l, with l = (k / 4 B)^(1/4)
/// (Hetenyi, "Beams on Elastic Foundation", 1946), so it steers 2 P l^3 / k. The needle is solid steel, 200 GPa; the bed is
/// E / (1 - nu^2) (Vesic 1961, without its weak dependence on the beam). Paths of constant curvature: Webster et al.,
/// "Nonholonomic modeling of needle steering", Int. J. Robotics Research 25, 2006.
double bendCurvature(const datasets::ToolSpec& tool, const volume::TissueRow& row) noexcept;

inline constexpr double cutStep = 0.25e-3;     // [m]
inline constexpr int cutSteps = 4;             // per tick: neither a proxy that cuts nor a rupture outruns 1 m/s
inline constexpr double stickWindow = 2.5e-3;  // a slower shaft sticks [m/s]

}  // namespace palpate::haptics
