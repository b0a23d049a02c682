#include <studies/validate/yeoh.h>

#include <cstddef>

namespace palpate::studies {

double Incompressible::energy(double invariant) const noexcept
{
    return 0.5 * shear * invariant + volume::beyond(law, shear, stiffening, invariant).energy;
}

double Incompressible::slope(double invariant) const noexcept
{
    return 0.5 * (shear + volume::beyond(law, shear, stiffening, invariant).slope);
}

double uniaxialStress(const Incompressible& law, double stretch) noexcept
{
    const double invariant = stretch * stretch + 2.0 / stretch - 3.0;
    return 2.0 * law.slope(invariant) * (stretch - 1.0 / (stretch * stretch));
}

double scaleOf(const std::vector<double>& shape, const std::vector<double>& values) noexcept
{
    double mixed = 0.0, own = 0.0;
    for (std::size_t i = 0; i < shape.size(); ++i) {
        mixed += shape[i] * values[i];
        own += shape[i] * shape[i];
    }
    return mixed / own;
}

}  // namespace palpate::studies
