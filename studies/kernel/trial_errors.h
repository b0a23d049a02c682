#pragma once

#include <studies/kernel/kernel_trial.h>

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace palpate::studies {

inline constexpr double nearField = 30e-3;  // around the contact [m]

/// Mean gradient of u in a cube, by u at its corners, x fastest.
Mat3 meanGradient(const std::array<Vec3, 8>& u, double side);
/// |e| sqrt(2/3) of the strain e: the stretch of an incompressible bar with as much.
double equivalentStrain(const Mat3& gradient);
/// What a tenth of a millilitre exceeds, of the strains in cubes of one size.
double exceededStrain(std::vector<double> strains, double side);

/// Cubes between eight neighbours of the lattice that a reference's positions lie on. Without a lattice there are none.
struct PositionCells {
    double side = 0;                                    // [m]
    std::vector<std::array<std::uint32_t, 8>> corners;  // indices of positions, x fastest (count x 8)
};
PositionCells positionCells(std::span<const Vec3f> position);

/// Errors of displacements `u` at the reference's positions (count x 1) [m] and, where there is one, of a force on the
/// tool [N]. The energy is left at 0.
TrialErrors errorsOf(std::span<const Vec3> u, const std::optional<Vec3>& force, const Reference& reference,
                     const PositionCells& cells, const ReferenceState& state);

/// The state of a pose. Throws std::logic_error when the reference was not solved for it.
const ReferenceState& stateAt(const Reference& reference, TrialPose pose);

/// Errors of one reference against another at the looks of the path: what a law costs, whatever solves it. Throws
/// std::runtime_error when they do not have the same positions.
std::vector<TrialErrors> errorsBetween(const Reference& model, const Reference& reference, const TrialPath& path,
                                       double speed);

}  // namespace palpate::studies
