#pragma once

#include <vector>

namespace palpate::studies {

/// Yeoh's law with two terms as the kernel has it, of tissue that keeps its volume: W = mu/2 (I + b/2 I^2), I = I_C - 3,
/// and for b < 0 along the tangent beyond I = chainmail::softensTo. b = 0: neo-Hookean. Source: O. H. Yeoh, "Some forms of
/// the strain energy function for rubber", Rubber Chem. Technol. 66, 1993.
struct Yeoh {
    double shear = 0;       // mu [Pa]
    double stiffening = 0;  // b [-]

    double energy(double invariant) const noexcept;  // [J/m^3]
    double slope(double invariant) const noexcept;   // dW/dI [Pa]
};

/// Nominal stress of a bar stretched to `stretch` times its length [Pa]; under 0: it is pressed.
double uniaxialStress(const Yeoh& law, double stretch) noexcept;
/// Nominal stress of a sheet stretched by `stretch` along both its sides [Pa].
double equibiaxialStress(const Yeoh& law, double stretch) noexcept;

/// The factor by which a curve of `shape` comes nearest to `values`, least squares.
double scaleOf(const std::vector<double>& shape, const std::vector<double>& values) noexcept;

}  // namespace palpate::studies
