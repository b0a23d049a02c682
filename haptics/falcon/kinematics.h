#pragma once

#include <haptics/falcon/packet.h>
#include <volume/geometry.h>

#include <glm/mat3x3.hpp>

#include <array>
#include <optional>

namespace palpate::falcon {

// The Falcon's own frame: origin in the middle of the base, x to the user's right, y up, z towards the user. Angles are
// those of the three arms at the base, from the plane of the base towards the user.
using Angles = std::array<double, 3>;   // [rad]
using Torques = std::array<double, 3>;  // at the arms' axes [N m]

/// The delta of the Falcon. In the frame of a leg (radial u, tangential v, axial w) the arm of length a turns about the
/// tangent at u = r, v = s; the shin, a parallelogram of length b between offsets d and e that stay in the plane of the
/// arm, ends at u = c, v = f of the grip. With A = u - r + c and V = v - s + f the leg closes when
///
///     (A - a cos q)^2 + (w - a sin q)^2 = (d + e + sqrt(b^2 - V^2))^2 .
///
/// Source: R. E. Stamper, "A three degree of freedom parallel manipulator with only translational degrees of freedom",
/// PhD thesis, University of Maryland, 1997, of which the Falcon is an instance; lengths as its users measured them.
struct Geometry {
    double a = 0.060, b = 0.1025, c = 0.01443, d = 0.01125, e = 0.01125, f = -0.025, r = 0.040, s = -0.02309;  // [m]
    std::array<double, 3> bearing{105.0, -15.0, -135.0};  // of the legs [deg]
};

inline constexpr double homedDepth = 0.17;  // z beyond which every encoder has passed its zero [m]

/// How far from singular a pose is: below `singular` no torque is to be trusted.
inline constexpr double singular = 0.1, wellPosed = 0.25;

/// Where the grip is (forward kinematics), by Newton's method to 1e-12 m; nothing where it does not converge. `near`: where
/// to look first.
std::optional<Vec3> positionAt(const Angles& angles, Vec3 near = Vec3(0.0, 0.0, 0.13)) noexcept;

/// Where the grip is, how it moves with the arms, and how well.
struct Posture {
    Vec3 position{0.0};      // [m]
    glm::dmat3 jacobian{1};  // column i: of the position, by angle i [m/rad]
    /// The least of: the sines between arm and shin (0: stretched), and the volume of the shins' directions over that of
    /// three at right angles (0: they do not hold the grip).
    double margin = 0;
};

/// Nothing where the angles belong to no position, or it to no Jacobian.
std::optional<Posture> postureAt(const Angles& angles, Vec3 near = Vec3(0.0, 0.0, 0.13)) noexcept;

/// J^T F.
Torques torquesFor(const Posture& posture, Vec3 force) noexcept;
/// J^-T t: what the motors do to the grip [N].
Vec3 forceOf(const Posture& posture, const Torques& torques) noexcept;

inline constexpr double radPerCount = 2.0 * 3.14159265358979323846 / 1280.0 * (14.25 / 110.0);
inline constexpr double zeroAngle = 35.0 * 3.14159265358979323846 / 180.0;  // of an encoder's count 0 [rad]
inline constexpr double countsPerTorque = 10000.0;                          // of a motor command, by [N m]
inline constexpr int largestCommand = 4096;                                 // either sign

Angles anglesOf(const Triple& count) noexcept;

/// Motor commands have the opposite sign of torques. Where one would be over the largest command all are scaled together,
/// so that the force keeps its direction. Torques that are not finite give none.
Triple motorCommand(const Torques& torques) noexcept;
Torques torquesOf(const Triple& motor) noexcept;

}  // namespace palpate::falcon
