#pragma once

#include <studies/validate/experiment.h>

#include <filesystem>
#include <vector>

namespace palpate::studies {

/// A cylinder between two platens.
struct Cylinder {
    double radius = 25e-3, height = 30e-3;  // [m]
    double poisson = 0.495;
    double cell = 1.875e-3;  // of the kernel's cells [m]; divides the height
};

/// Load of a cylinder of shear modulus 1 Pa, by the kernel's cells, at each engineering strain [N].
/// @param stiffening  b of the law [-]
/// @param bonded      no slip on the platens; false: no friction
/// Throws std::runtime_error where no equilibrium is found.
std::vector<double> compressionLoads(const Cylinder& shape, double stiffening, bool bonded,
                                     const std::vector<double>& strains);

/// Ecoflex cylinders in compression: neo-Hookean and Yeoh, without friction and bonded; and what bonding makes of a
/// modulus. The modulus of each material is fitted from 2 to 10 % strain, Yeoh's b on all the other materials.
/// @param file   measurements, see datasets/measured/README.md
/// @param quick  larger cells
/// Throws as Measurements does.
std::vector<Experiment> siliconeCompression(const std::filesystem::path& file, bool quick,
                                            const ValidateProgress& progress);

}  // namespace palpate::studies
