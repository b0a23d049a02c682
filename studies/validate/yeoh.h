#pragma once

#include <volume/law.h>

#include <vector>

namespace palpate::studies {

/// A law of finite strain, of tissue that keeps its volume.
struct Incompressible {
    double shear = 0;       // mu [Pa]
    double stiffening = 0;  // b [-]
    volume::Law law = volume::NeoHookean{};

    double energy(double invariant) const noexcept;  // [J/m^3]
    double slope(double invariant) const noexcept;   // dW/dI [Pa]
};

/// Nominal stress of a bar stretched to `stretch` times its length [Pa]; under 0: it is pressed.
double uniaxialStress(const Incompressible& law, double stretch) noexcept;

/// The factor by which a curve of `shape` comes nearest to `values`, least squares.
double scaleOf(const std::vector<double>& shape, const std::vector<double>& values) noexcept;

}  // namespace palpate::studies
