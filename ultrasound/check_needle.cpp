#include <ultrasound/check_bodies.h>
#include <ultrasound/rays.h>

#include <base/units.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace palpate::ultrasound {

namespace {

using units::degree, units::mm;

// The brightest of the upper side of a shaft that goes through (0, 14 mm) of the picture at `angle` to the face [dB].
double shaftEcho(CheckBench& bench, double angle)
{
    const glm::dvec3 along(std::cos(angle), 0, std::sin(angle)), through = bench.pose.face + glm::dvec3(0, 0, 14e-3);
    bench.insert(through + 12e-3 * along, along);
    bench.scan();
    constexpr double radius = 1.05e-3;
    std::vector<double> peaks;
    for (double x = -2e-3; x < 0.5e-3; x += 0.2e-3) {
        const double z = through.z + x * std::tan(angle) - radius / std::cos(angle);
        const int k = bench.sample(z), i = bench.line(through.x + x);
        double best = 0;
        for (int q = k - 6; q <= k + 6; ++q)
            best = std::max(best, bench.amplitude(q, i));
        peaks.push_back(decibels(best));
    }
    std::nth_element(peaks.begin(), peaks.begin() + static_cast<std::ptrdiff_t>(peaks.size() / 2), peaks.end());
    return peaks[peaks.size() / 2];
}

// A box with one rod along y in it, seen end on.
CheckBench withRod(const SoundOf& soundOf, const char* tissue, double radius)
{
    return {{soundOf("gland"), soundOf(tissue)}, 0.2e-3, [radius](glm::dvec3 x) {
                const double dx = x.x - 22e-3, dz = x.z - 15e-3;
                return dx * dx + dz * dz < radius * radius ? 2 : 1;
            }};
}

}  // namespace

// The level falls by 0.6 dB a degree from broadside on, and a needle along the beams shows its tip only.
std::vector<Check> checkNeedle(const SoundOf& soundOf)
{
    std::vector<Check> out;
    channel::TissueSound clear = soundOf("fat");
    clear.attenuation = 0;
    CheckBench bench({clear}, 0.4e-3, [](glm::dvec3) { return 1; });
    bench.physics.speckle = false;
    const double broadside = shaftEcho(bench, 0);
    constexpr float radius = 1.05e-3F;
    const auto covered = static_cast<double>(shareBetween(-radius, radius, bench.beam().elevationSigma(14e-3F - radius)));
    out.push_back({"shaft across the beams", "dB", broadside, decibels(0.93 * covered), 1.0,
                   "steel in tissue, R = 0.93, of the share of the beam that it covers"});
    for (const double angle : {15.0, 30.0, 45.0, 60.0})
        out.push_back({fmt::format("shaft at {:.0f} degrees to the face, under broadside", angle), "dB",
                       shaftEcho(bench, angle * degree) - broadside, -0.6 * angle, 2.5,
                       "linear in the angle (Schafhalter-Zoppoth 2004), 0.6 dB a degree from Nichols 2003"});
    const glm::dvec3 tip = bench.pose.face + glm::dvec3(0, 0, 20e-3);
    bench.insert(tip, {0, 0, -1});
    bench.scan();
    double best = 0;
    int at = 0;
    for (int k = 0; k < bench.settings.samples; ++k)
        if (const double a = bench.amplitude(k, bench.line(tip.x)); a > best) {
            best = a;
            at = k;
        }
    out.push_back({"depth of the tip of a needle seen end on", "mm",
                   mm * (at + 0.5) * static_cast<double>(bench.beam().sample()), 20.0, 0.6, "where its tip is"});
    return out;
}

// Behind a slab the speckle is darker by what the slab takes and reflects; behind fluid it is brighter.
std::vector<Check> checkShadows(const SoundOf& soundOf)
{
    std::vector<Check> out;
    const channel::TissueSound gland = soundOf("gland");
    constexpr double thick = 4e-3;
    for (const char* tissue : {"cyst", "idc_high_grade", "cartilage"}) {
        const channel::TissueSound slab = soundOf(tissue);
        // Left half gland, right half with a slab from 10 mm on.
        CheckBench bench({gland, slab}, 0.2e-3,
                         [](glm::dvec3 x) { return x.x > 22e-3 && x.z > 13e-3 && x.z < 13e-3 + thick ? 2 : 1; });
        bench.physics.interfaces = true;
        bench.scan();
        const int k = bench.sample(25e-3);
        const double behind = bench.level(k, k + 100, bench.line(28e-3), bench.line(39e-3));
        const double beside = bench.level(k, k + 100, bench.line(6e-3), bench.line(16e-3));
        const double r = reflectionOf(gland, slab);
        const double wanted = -100 * thick * (attenuationOf(slab) - attenuationOf(gland)) + 2 * decibels(1 - r * r);
        out.push_back({fmt::format("speckle behind {:.0f} mm of {}, over that beside", mm * thick, tissue), "dB",
                       behind - beside, wanted, 1.0, "attenuation of the table, 1 - R^2 at both faces"});
    }
    CheckBench bench = withRod(soundOf, "bone", 2e-3);
    bench.scan();
    int dark = 0;
    const int from = bench.sample(17.5e-3), middle = bench.line(22e-3);
    for (int k = from; k < bench.settings.samples - 10; k += 10) {
        const double beside = bench.level(k, k + 10, bench.line(6e-3), bench.line(14e-3));
        dark += bench.level(k, k + 10, middle - 3, middle + 4) < beside - 6 ? 10 : 0;
    }
    const auto sample = static_cast<double>(bench.beam().sample());
    const double whole = (bench.settings.samples - 10 - from) * sample;
    out.push_back({"length of the shadow behind a rod of bone 4 mm across", "mm", mm * dark * sample, mm * whole, 1.0,
                   "to the bottom of the picture, darker by 6 dB"});
    const int deep = bench.sample(22e-3);
    const double beside = bench.level(deep, deep + 50, bench.line(6e-3), bench.line(14e-3));
    int wide = 0;
    for (int i = bench.line(17e-3); i < bench.line(27e-3); ++i)
        wide += bench.level(deep, deep + 50, i, i + 1) < beside - 6 ? 1 : 0;
    out.push_back({"width of that shadow 5 mm behind it", "mm", mm * wide * static_cast<double>(bench.beam().pitch()), 4.0,
                   0.8, "the rod's"});
    return out;
}

}  // namespace palpate::ultrasound
