#include <haptics/contact_law.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace palpate::haptics {

namespace {

constexpr double tanConeAngle = 1.33;   // 53 degrees
constexpr double stiffestLayer = 12.0;  // that a contact feels, over the layers in series
constexpr double springDepth = 5e-3;    // level `spring` takes the secant of the needle's law at this depth [m]

double planeStrain(const LocalTissue& t) noexcept
{
    return t.youngsModulus / (1.0 - t.poissonRatio * t.poissonRatio);
}

}  // namespace

LocalTissue tissueUnder(const SessionModel& model, const volume::Tissue::Reader& reader, Vec3 point, Vec3 inward,
                        double radius) noexcept
{
    constexpr std::size_t samples = 8;
    const double reach = std::max(5.0 * radius, 10e-3);
    std::array<double, samples> weight{}, modulus{};
    double weights = 0.0;
    double arithmetic = 0.0;
    double harmonic = 0.0;
    for (std::size_t i = 0; i < samples; ++i) {
        const double s = reach * (static_cast<double>(i) + 0.5) / samples;
        const double fall = s / std::max(radius, 2e-3);
        weight[i] = 1.0 / (1.0 + fall * fall);
        modulus[i] = std::max(model.youngsModulus.at(point + s * inward), 1.0);
        weights += weight[i];
        arithmetic += weight[i] * modulus[i];
        harmonic += weight[i] / modulus[i];
    }
    const double most = stiffestLayer * weights / harmonic;
    for (std::size_t i = 0; i < samples; ++i) {
        arithmetic -= weight[i] * std::max(modulus[i] - most, 0.0);
    }
    const auto row = reader.tissue(point + 1e-3 * inward);
    const double nu = row != 0 ? model.tissue->table().rows[row].poissonRatio : 0.45;
    return {std::sqrt(arithmetic / harmonic) * relaxationOf(model, row).instantaneous(), nu};
}

volume::Relaxation relaxationOf(const SessionModel& model, std::uint8_t row) noexcept
{
    const bool relaxes = model.scene.model.relaxation && model.scene.model.level != datasets::ModelLevel::spring;
    return relaxes ? model.tissue->table().rows[row].relaxation() : volume::Relaxation{};
}

double DepthLaw::force(double depth) const noexcept
{
    // Beyond `bend` the slope k + 2 q z would pass the stiffest: go on in a straight line.
    const double k = std::min(linear, stiffest);
    const double bend = quadratic > 0.0 ? (stiffest - k) / (2.0 * quadratic) : depth;
    const double z = std::min(depth, bend);
    return k * z + quadratic * z * z + stiffest * (depth - z);
}

double DepthLaw::depth(double f) const noexcept
{
    const double k = std::min(linear, stiffest);
    if (quadratic <= 0.0) {
        return k > 0.0 ? f / k : 0.0;
    }
    const double bend = (stiffest - k) / (2.0 * quadratic);
    const double atBend = k * bend + quadratic * bend * bend;
    if (f > atBend) {
        return bend + (f - atBend) / stiffest;
    }
    return (std::sqrt(k * k + 4.0 * quadratic * f) - k) / (2.0 * quadratic);
}

DepthLaw needleLaw(const SessionModel& model, const LocalTissue& tissue) noexcept
{
    const double e = planeStrain(tissue);
    const DepthLaw law{2.0 * e * model.scene.tool.radius, 2.0 / std::numbers::pi * e * tanConeAngle, stiffestContact};
    if (model.scene.model.level != datasets::ModelLevel::spring) {
        return law;
    }
    const double given = model.scene.model.stiffness;
    return {given > 0.0 ? given : law.force(springDepth) / springDepth, 0.0, stiffestContact};
}

double sphereForce(const SessionModel& model, const LocalTissue& tissue, double depth) noexcept
{
    const double e = planeStrain(tissue);
    const double r = model.scene.tool.radius;
    if (model.scene.model.level == datasets::ModelLevel::spring) {
        const double given = model.scene.model.stiffness;
        return std::min(given > 0.0 ? given : 2.0 * e * r, stiffestContact) * depth;
    }
    const double c = 4.0 / 3.0 * e * std::sqrt(r);
    // Slope 1.5 c sqrt(d) meets the stiffest at `bend`; from there a straight line.
    const double root = stiffestContact / (1.5 * c);
    const double bend = std::min(depth, root * root);
    return c * bend * std::sqrt(bend) + stiffestContact * (depth - bend);
}

}  // namespace palpate::haptics
