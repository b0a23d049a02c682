#include <studies/accuracy/contact_formulas.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace palpate::studies {

namespace {

// Dimitriadis's alpha_0 and beta_0 of a bonded layer.
double alphaOf(double nu) noexcept
{
    return -(1.2876 - 1.4678 * nu + 1.3442 * nu * nu) / (1.0 - nu);
}

double betaOf(double nu) noexcept
{
    return (0.6387 - 1.0277 * nu + 1.5164 * nu * nu) / (1.0 - nu);
}

}  // namespace

double hertzForce(double youngsModulus, double poisson, double radius, double depth) noexcept
{
    return 4.0 / 3.0 * youngsModulus / (1.0 - poisson * poisson) * std::sqrt(radius) * depth * std::sqrt(depth);
}

double bondedLayerFactor(double poisson, double chi) noexcept
{
    constexpr double pi = std::numbers::pi;
    const double a = alphaOf(poisson), b = betaOf(poisson);
    const double x = 2.0 * a * chi / pi;
    return 1.0 - x + x * x - 8.0 / std::pow(pi, 3) * (std::pow(a, 3) + 4.0 * pi * pi / 15.0 * b) * std::pow(chi, 3) +
           16.0 * a / std::pow(pi, 4) * (std::pow(a, 3) + 3.0 * pi * pi / 5.0 * b) * std::pow(chi, 4);
}

double incompressibleLayerFactor(double chi) noexcept
{
    return 1.0 + chi * (1.133 + chi * (1.497 + chi * (1.469 + chi * 0.755)));
}

double flatPunchForce(double youngsModulus, double poisson, double radius, double depth) noexcept
{
    return 2.0 * youngsModulus * radius * depth / (1.0 - poisson * poisson);
}

double deepPunchFactor(double poisson, double fraction) noexcept
{
    return 1.0 - 2.0 * alphaOf(poisson) / std::numbers::pi * fraction;
}

double thinLayerPunchFactor(double poisson, double fraction) noexcept
{
    constexpr std::array soft{1.207, 1.472, 1.784, 2.124, 2.480}, stiff{1.252, 1.599, 2.031, 2.532, 3.085};
    const double row = fraction / 0.2 - 1.0;
    const auto at = static_cast<std::size_t>(std::lround(row < 0.0 ? 99.0 : row));
    const bool known = at < soft.size() && std::abs(row - std::round(row)) < 1e-6;
    if (known && std::abs(poisson - 0.3) < 1e-9) {
        return soft[at];
    }
    return known && std::abs(poisson - 0.45) < 1e-9 ? stiff[at] : 0.0;
}

}  // namespace palpate::studies
