#include <studies/accuracy/elastic_formulas.h>

#include <glm/geometric.hpp>

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace palpate::studies {

namespace {

// Dimitriadis's alpha_0 of a bonded layer.
double alphaOf(double nu) noexcept
{
    return -(1.2876 - 1.4678 * nu + 1.3442 * nu * nu) / (1.0 - nu);
}

}  // namespace

double hertzForce(double youngsModulus, double poisson, double radius, double depth) noexcept
{
    return 4.0 / 3.0 * youngsModulus / (1.0 - poisson * poisson) * std::sqrt(radius) * depth * std::sqrt(depth);
}

double bondedLayerFactor(double poisson, double chi) noexcept
{
    constexpr double pi = std::numbers::pi;
    const double a = alphaOf(poisson);
    const double b = (0.6387 - 1.0277 * poisson + 1.5164 * poisson * poisson) / (1.0 - poisson);  // his beta_0
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

constexpr double pi = std::numbers::pi;

Vec3 inclusionDisplacement(const Inclusion& inclusion, Vec3 x)
{
    const double nu = inclusion.poisson;
    const double trace = (1.0 - 2.0 * nu) * inclusion.stretch;
    const Vec3 far = inclusion.stretch * Vec3(-nu, -nu, 1.0);  // principal strains
    const Vec3 deviator = far - Vec3(trace / 3.0);
    const double shear = 2.0 * (4.0 - 5.0 * nu) / (15.0 * (1.0 - nu));  // Eshelby's numbers of a ball
    const double bulk = (1.0 + nu) / (3.0 * (1.0 - nu));
    const double s = 1.0 / (1.0 + shear * (inclusion.shearRatio - 1.0));
    const double t = 1.0 / (1.0 + bulk * (inclusion.bulkRatio - 1.0));
    const Vec3 ex = deviator * x;
    const double r = glm::length(x);
    if (r < inclusion.radius) {
        return s * ex + t * trace / 3.0 * x;
    }
    const double q = inclusion.radius / r;
    const double q3 = q * q * q;
    const double c1 = 3.0 * (s - 1.0) / (4.0 * (4.0 - 5.0 * nu));
    const double c2 = 5.0 * c1 / 3.0;
    const Vec3 radial = glm::dot(x, ex) / (r * r) * x;
    return far * x + (t - 1.0) * trace / 3.0 * q3 * x + c1 * q3 * q * q * (2.0 * ex - 5.0 * radial) +
           c2 * q3 * (2.0 * (1.0 - 2.0 * nu) * ex + 3.0 * radial);
}

Vec3 kelvinDisplacement(double shearModulus, double poisson, Vec3 force, Vec3 x)
{
    const double r = glm::length(x);
    return ((3.0 - 4.0 * poisson) * force + glm::dot(x, force) / (r * r) * x) /
           (16.0 * pi * shearModulus * (1.0 - poisson) * r);
}

double uniaxialTension(const volume::Law& law, double youngsModulus, double poisson, double stiffening, double stretch)
{
    const double mu = youngsModulus / (2.0 * (1.0 + poisson));
    const double bulk = youngsModulus / (3.0 * (1.0 - 2.0 * poisson));
    // Of the energy by the logarithm of a stretch: `along` it and `across`.
    const auto slopes = [&](double across) {
        const double j = stretch * across * across;
        const double scaled = std::pow(j, -2.0 / 3.0);
        const double i = scaled * (stretch * stretch + 2.0 * across * across) - 3.0;
        const double shape =
            (mu + volume::beyond(law, mu, stiffening, i).slope) * scaled * (stretch * stretch - across * across) / 3.0;
        const double pressure = bulk * (j - 1.0) * j;
        return std::array<double, 2>{2.0 * shape + pressure, pressure - shape};
    };
    // The stress across rises with the width.
    double low = 0.1 / std::sqrt(stretch);
    double high = 10.0 / std::sqrt(stretch);
    for (int halved = 0; halved < 200; ++halved) {
        const double middle = 0.5 * (low + high);
        (slopes(middle)[1] > 0.0 ? high : low) = middle;
    }
    return slopes(low)[0] / stretch;
}

double convergenceOrder(std::span<const double> sizes, std::span<const double> errors)
{
    const auto count = static_cast<double>(sizes.size());
    double x = 0.0, y = 0.0, xx = 0.0, xy = 0.0;
    for (std::size_t i = 0; i < sizes.size(); ++i) {
        const double a = std::log(sizes[i]);
        const double b = std::log(errors[i]);
        x += a;
        y += b;
        xx += a * a;
        xy += a * b;
    }
    return (count * xy - x * y) / (count * xx - x * x);
}

}  // namespace palpate::studies
