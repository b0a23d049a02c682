#pragma once

#include <studies/validate/experiment.h>

#include <volume/geometry.h>

#include <array>
#include <filesystem>

namespace palpate::studies {

/// A beam of 100 x 30 x 30 mm of the kernel's cells, clamped at x = -100 mm, z up, under its own weight and a load on the
/// upper edge of its free end x = 0.
struct Beam {
    double youngsModulus = 0;       // [Pa]
    double poisson = 0.49;          // [-]; of scenes. Silicone has 0.499, which bends alike and drowns single precision
    double density = 1070;          // [kg/m^3]
    double tipLoad = 0;             // [N]
    Vec3 gravity{0.0, 0.0, -9.81};  // [m/s^2]
    double cell = 5e-3;             // [m]; divides 10 mm
};

/// Displacement of the three markers, which stand 6 mm off the surface and turn with it [m].
/// Throws std::runtime_error where no equilibrium is found.
std::array<Vec3, 3> beamMarkers(const Beam& beam);

/// The silicone beam: Young's modulus fitted on the drop under its own weight, the drop under a tip load predicted.
/// @param file   measurements, see datasets/measured/README.md
/// @param quick  larger cells
/// Throws as Measurements does.
Experiment siliconeBeam(const std::filesystem::path& file, bool quick, const ValidateProgress& progress);

}  // namespace palpate::studies
