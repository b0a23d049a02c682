#include <ultrasound/checks.h>

#include <ultrasound/check_bodies.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace palpate::ultrasound {

std::vector<Check> runChecks(const SoundOf& soundOf, const std::function<void(double)>& progress)
{
    constexpr std::array groups{checkReflections, checkAttenuation, checkPointSpread, checkSpeckle,
                                checkMotion,      checkNeedle,      checkShadows};
    std::vector<Check> all;
    for (std::size_t i = 0; i < groups.size(); ++i) {
        if (progress)
            progress(static_cast<double>(i) / static_cast<double>(groups.size()));
        const std::vector<Check> some = groups[i](soundOf);
        all.insert(all.end(), some.begin(), some.end());
    }
    return all;
}

// The echo of a plane between two tissues across the beam, less what the tissue above it has taken: at the worst of several
// places of the plane among the points of a ray.
std::vector<Check> checkReflections(const SoundOf& soundOf)
{
    std::vector<Check> out;
    using Pair = std::array<const char*, 2>;
    for (const Pair& pair : {Pair{"fat", "muscle"}, Pair{"fat", "gland"}, Pair{"muscle", "bone"}}) {
        const channel::TissueSound above = soundOf(pair[0]), below = soundOf(pair[1]);
        constexpr double face = 3e-3, plane = 23.1e-3;
        CheckBench bench({above, below}, 0.2e-3, [&](glm::dvec3 x) { return x.z < plane ? 1 : 2; });
        bench.physics.speckle = false;
        const double wanted = decibels(reflectionOf(above, below));
        double worst = wanted;
        for (const double further : {0.0, 0.023e-3, 0.05e-3, 0.1e-3, 0.137e-3}) {
            bench.pose.face.z = face + further;
            bench.scan();
            double sum = 0;
            int n = 0;
            for (int i = 60; i < 132; ++i, ++n) {
                double best = 0;
                for (int k = bench.sample(plane) - 20; k < bench.sample(plane) + 20; ++k)
                    best = std::max(best, bench.amplitude(k, i));
                sum += decibels(best);
            }
            const double echo = sum / n + 100 * (plane - face - further) * attenuationOf(above);
            if (std::abs(echo - wanted) > std::abs(worst - wanted))
                worst = echo;
        }
        out.push_back({fmt::format("echo of {} over {}, worst of 5 places", pair[0], pair[1]), "dB", worst, wanted, 1.0,
                       "R = (Z2 - Z1) / (Z2 + Z1)"});
    }
    return out;
}

// The slope of speckle with depth in one tissue.
std::vector<Check> checkAttenuation(const SoundOf& soundOf)
{
    std::vector<Check> out;
    for (const char* tissue : {"fat", "gland", "liver", "idc_high_grade"}) {
        const channel::TissueSound sound = soundOf(tissue);
        CheckBench bench({sound}, 0.4e-3, [](glm::dvec3) { return 1; });
        bench.scan();
        double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
        for (int k = 100; k < 900; ++k, ++n) {
            const double x = 100 * (k + 0.5) * static_cast<double>(bench.beam().sample());
            const double y = bench.level(k, k + 1, 10, 182);
            sx += x;
            sy += y;
            sxx += x * x;
            sxy += x * y;
        }
        const double wanted = attenuationOf(sound);
        out.push_back({fmt::format("attenuation of {} at 9 MHz", tissue), "dB/cm",
                       -(sxy - sx * sy / n) / (sxx - sx * sx / n), wanted, 0.03 * wanted,
                       "2 a f^p of the table, both ways"});
    }
    return out;
}

namespace {

// Width at half height of the peak of get(0) .. get(n - 1), in steps.
template <class Get>
double halfWidth(Get get, int n)
{
    int top = 0;
    for (int q = 1; q < n; ++q)
        top = get(q) > get(top) ? q : top;
    const double half = get(top) / 2;
    int a = top, b = top;
    while (a > 0 && get(a) > half)
        --a;
    while (b < n - 1 && get(b) > half)
        ++b;
    return (b - (half - get(b)) / (get(b - 1) - get(b))) - (a + (half - get(a)) / (get(a + 1) - get(a)));
}

}  // namespace

std::vector<Check> checkPointSpread(const SoundOf& soundOf)
{
    std::vector<Check> out;
    constexpr double perSigma = 2.3548, mm = 1e3;
    channel::TissueSound clear = soundOf("fat");
    clear.attenuation = 0;
    CheckBench bench({clear}, 0.4e-3, [](glm::dvec3) { return 1; });
    bench.physics.speckle = false;
    const glm::dvec3 face = bench.pose.face;
    for (const double z : {8e-3, 18e-3, 32e-3}) {
        bench.pose.face = face;
        bench.physics.points = {{face + glm::dvec3(0.1e-3, 0, z)}};
        bench.scan();
        const Beam beam = bench.beam();
        const int k = bench.sample(face.z + z), i = bench.line(face.x + 0.1e-3);
        const double axial = halfWidth([&](int q) { return bench.amplitude(q, i); }, bench.settings.samples) *
                             static_cast<double>(beam.sample());
        const double lateral = halfWidth([&](int q) { return bench.amplitude(k, q); }, bench.settings.lines) *
                               static_cast<double>(beam.pitch());
        constexpr int steps = 81;
        constexpr double apart = 0.06e-3;
        std::vector<double> across;
        for (int e = 0; e < steps; ++e) {
            bench.pose.face.y = face.y + apart * (e - steps / 2);
            bench.scan();
            across.push_back(bench.amplitude(k, i));
        }
        const double elevation = halfWidth([&](int q) { return across[static_cast<std::size_t>(q)]; }, steps) * apart;
        const double half = 0.5 * mm * static_cast<double>(beam.sample());
        const auto add = [&](const char* along, double measured, float sigma) {
            const double wanted = mm * perSigma * static_cast<double>(sigma);
            out.push_back({fmt::format("width of a point {:.0f} mm deep, {}", mm * z, along), "mm", mm * measured, wanted,
                           std::max(0.07 * wanted, half), "the beam's formula, at -6 dB"});
        };
        const auto depth = static_cast<float>(z);
        add("axial", axial, beam.axialSigma());
        add("lateral", lateral, beam.lateralSigma(depth));
        add("elevation", elevation, beam.elevationSigma(depth));
    }
    return out;
}

}  // namespace palpate::ultrasound
