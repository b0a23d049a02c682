#pragma once

#include <haptics/session_model.h>

namespace palpate::haptics {

/// What the tissue under a tool feels like.
struct LocalTissue {
    double youngsModulus = 0;  // effective, of the layers under the contact [Pa]
    double poissonRatio = 0.45;
};

/// Effective tissue under a contact at `point` [m]: Young's modulus along `inward` to a depth of five radii (at least
/// 10 mm), weighted as the stress under a punch falls off, 1 / (1 + (s / a)^2), and mixed as the root of arithmetic times
/// harmonic mean. In the arithmetic one no layer counts for more than 12 times the harmonic one: bone under fat is a floor
/// for it, and no part of what is pressed. Where tissue relaxes, the modulus right after a step.
LocalTissue tissueUnder(const SessionModel& model, const volume::Tissue::Reader& reader, Vec3 point, Vec3 inward,
                        double radius) noexcept;

/// How stress that is held falls in a tissue: by the table, or not at all where the scene's tissue does not relax.
volume::Relaxation relaxationOf(const SessionModel& model, std::uint8_t row) noexcept;

/// Force against depth of a tool in soft tissue, F(z) = k z + q z^2 [N], its slope never over `stiffest`.
///
/// Needle: k = 2 E a / (1 - nu^2) is a flat punch of radius a; q = 2 E tan(alpha) / (pi (1 - nu^2)) a cone of half-angle
/// alpha (Sneddon, "The relation between load and penetration in the axisymmetric Boussinesq problem", 1965). With
/// alpha = 53 degrees this is the curve of Simone and Okamura (2002) for bovine liver, 0.0020 z + 0.0023 z^2 N (z in mm),
/// at E = 2 kPa and a = 0.5 mm.
/// Level `spring`: k = K of equation 2, q = 0.
struct DepthLaw {
    double linear = 0;     // k [N/m]
    double quadratic = 0;  // q [N/m^2]
    double stiffest = 0;   // [N/m]

    double force(double depth) const noexcept;
    /// The depth at which the force is `force`: the inverse of force().
    double depth(double force) const noexcept;
};

/// The law of the scene's tool and model level. For a sphere, Hertz: see sphereForce().
DepthLaw needleLaw(const SessionModel& model, const LocalTissue& tissue) noexcept;

/// Force of a sphere pressed `depth` [m] into tissue [N]: Hertz, 4/3 E / (1 - nu^2) sqrt(R) d^1.5, its slope never over
/// stiffestContact; at level `spring` K d of equation 2.
double sphereForce(const SessionModel& model, const LocalTissue& tissue, double depth) noexcept;

/// Stiffness is never rendered above this [N/m]: under a gripping hand (1 N s/m or more) a 1 kHz loop is stable up to
/// 2 (b + b_hand) / T = 2000 N/m (Abbott and Okamura 2005); half of it is margin for delay.
inline constexpr double stiffestContact = 1000.0;

}  // namespace palpate::haptics
