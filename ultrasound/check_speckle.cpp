#include <ultrasound/check_bodies.h>

#include <base/units.h>

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <utility>

namespace palpate::ultrasound {

namespace {

using units::mm;

CheckBench plain(const SoundOf& soundOf, const char* tissue)
{
    return {{soundOf(tissue)}, 0.4e-3, [](glm::dvec3) { return 1; }};
}

// Where the picture of `bench` fits best into `before`, around a guess: samples and lines, to parts of one by a parabola.
std::array<double, 2> tracked(const CheckBench& bench, const std::vector<float>& before, int k0, int i0)
{
    constexpr int tall = 60, wide = 12, reach = 5;
    const auto fit = [&](int dk, int di) {
        return correlation(bench, k0 - tall, k0 + tall, i0 - wide, i0 + wide,
                           [&](int k, int i) { return bench.in(before, k - dk, i - di); });
    };
    int bestK = 0, bestI = 0;
    double best = -1;
    for (int dk = -4 * reach; dk <= 4 * reach; ++dk)
        for (int di = -reach; di <= reach; ++di)
            if (const double c = fit(dk, di); c > best) {
                best = c;
                bestK = dk;
                bestI = di;
            }
    const auto peak = [](double a, double b, double c) { return 0.5 * (a - c) / (a - 2 * b + c); };
    return {bestK + peak(fit(bestK - 1, bestI), best, fit(bestK + 1, bestI)),
            bestI + peak(fit(bestK, bestI - 1), best, fit(bestK, bestI + 1))};
}

void checkTracking(const SoundOf& soundOf, std::vector<Check>& out)
{
    CheckBench bench = plain(soundOf, "liver");
    bench.scan();
    const std::vector<float> before = bench.envelope;
    const double line = static_cast<double>(bench.beam().pitch()), sample = static_cast<double>(bench.beam().sample());
    for (const auto& [x, z] : {std::pair{0.1e-3, 0.05e-3}, std::pair{0.45e-3, -0.33e-3}, std::pair{-0.6e-3, 0.5e-3}}) {
        bench.displace([&, x = x, z = z](glm::dvec3) { return glm::dvec3(x, 0, z); });
        bench.scan();
        double worstLateral = 0, worstAxial = 0;
        for (const int k : {300, 500, 700})
            for (const int i : {50, 96, 140}) {
                const auto [dk, di] = tracked(bench, before, k, i);
                worstAxial = std::max(worstAxial, std::abs(dk * sample - z));
                worstLateral = std::max(worstLateral, std::abs(di * line - x));
            }
        const std::string moved = fmt::format("speckle tracked over {:.2f}, {:.2f} mm, ", mm * x, mm * z);
        out.push_back({moved + "worst axial error", "mm", mm * worstAxial, 0, 0.01, "the displacement of the nodes"});
        out.push_back({moved + "worst lateral error", "mm", mm * worstLateral, 0, 0.05, "the displacement of the nodes"});
    }
}

// Intensity decorrelates by the square of what amplitude does for a Gaussian pulse.
void checkStrain(const SoundOf& soundOf, std::vector<Check>& out)
{
    CheckBench bench = plain(soundOf, "liver");
    bench.scan();
    const std::vector<float> before = bench.envelope;
    const double middle = bench.pose.face.z + 18e-3, pi = std::acos(-1.0);
    for (const double e : {0.02, 0.05, 0.1}) {
        bench.displace([&](glm::dvec3 x) { return glm::dvec3(0, 0, -e * (x.z - middle)); });
        bench.scan();
        const int k = bench.sample(middle);
        const double found =
            correlation(bench, k - 3, k + 4, 10, 182, [&](int q, int i) { return bench.in(before, q, i); });
        const double w = 1 + (1 - e) * (1 - e);
        const double phase =
            2 * pi / static_cast<double>(bench.beam().wavelength()) * e * static_cast<double>(bench.beam().axialSigma());
        const double f = std::sqrt(2 * (1 - e) / w) * std::exp(-2 * phase * phase / w);
        out.push_back(
            {fmt::format("correlation after {:.0f} % of axial strain", 100 * e), "", found, f * f, 0.06, "Gaussian pulse"});
    }
}

}  // namespace

std::vector<Check> checkSpeckle(const SoundOf& soundOf)
{
    std::vector<Check> out;
    for (const char* tissue : {"fat", "gland", "liver", "idc_high_grade"}) {
        const channel::TissueSound sound = soundOf(tissue);
        CheckBench bench = plain(soundOf, tissue);
        bench.scan();
        double sum = 0, squares = 0, n = 0;
        for (int k = 100; k < 900; ++k) {
            const double z = 100 * (k + 0.5) * static_cast<double>(bench.beam().sample());
            const double flat = std::pow(10, attenuationOf(sound) * z / 20);
            for (int i = 10; i < 182; ++i, ++n) {
                const double a = bench.amplitude(k, i) * flat;
                sum += a;
                squares += a * a;
            }
        }
        const double mean = sum / n, square = squares / n;
        out.push_back({fmt::format("speckle of {}, mean over deviation", tissue), "",
                       mean / std::sqrt(square - mean * mean), 1.913, 0.08, "Rayleigh: sqrt(pi / (4 - pi)) (PMC4916161)"});
        out.push_back({fmt::format("speckle of {}, level", tissue), "dB", 10 * std::log10(square),
                       static_cast<double>(fatEcho + sound.echo), 0.5, "the table, over -46 dB of a mirror"});
    }
    // The probe moves across the picture's plane.
    CheckBench bench = plain(soundOf, "liver");
    bench.scan();
    const std::vector<float> before = bench.envelope;
    const double y = bench.pose.face.y, sigma = static_cast<double>(bench.beam().elevationSigma(18e-3F));
    for (const double d : {0.2e-3, 0.4e-3, 0.8e-3}) {
        bench.pose.face.y = y + d;
        bench.scan();
        const double found = correlation(bench, 400, 500, 10, 182, [&](int k, int i) { return bench.in(before, k, i); });
        out.push_back({fmt::format("correlation after {:.1f} mm across the plane", mm * d), "", found,
                       std::exp(-d * d / (2 * sigma * sigma)), 0.05, "Gaussian beam"});
    }
    return out;
}

std::vector<Check> checkMotion(const SoundOf& soundOf)
{
    std::vector<Check> out;
    checkTracking(soundOf, out);
    checkStrain(soundOf, out);
    return out;
}

}  // namespace palpate::ultrasound
