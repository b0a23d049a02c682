#include <studies/kernel/baselines/baseline.h>
#include <studies/kernel/baselines/factored.h>
#include <studies/kernel/baselines/xpbd.h>

#include <fmt/format.h>

#include <algorithm>

namespace palpate::studies {

namespace {

constexpr std::size_t maxStepped = 400000;

TetBody meshOf(const BaselineScene& scene, double spacing, double poissonCap, std::size_t maxPoints)
{
    return latticeTets(scene.tissue, scene.surface, spacing, poissonCap, maxPoints);
}

}  // namespace

std::vector<Baseline> tetBaselines(const BaselineScene& scene)
{
    std::vector<Baseline> out;
    const auto named = [](double spacing, const std::string& more, double poissonCap) {
        return fmt::format("{:g} mm{}, Poisson {:g}", 1e3 * spacing, more, poissonCap);
    };
    const auto factored = [&](double spacing, double poissonCap) {
        out.push_back({"tets_prefactored", named(spacing, "", poissonCap), [=] {
                           return factoredModel(meshOf(scene, spacing, poissonCap, FactoredTets::maxPoints), scene.path);
                       }});
    };
    const auto xpbd = [&](double spacing, int substeps, double poissonCap) {
        out.push_back({"xpbd", named(spacing, fmt::format(", {} substeps", substeps), poissonCap),
                       [=] { return xpbdModel(meshOf(scene, spacing, poissonCap, maxStepped), {.substeps = substeps}); }});
    };
    const double gentle = std::min(unlockedPoisson, scene.poissonCap);
    for (const double spacing : {6e-3, 4e-3, 3e-3}) {
        factored(spacing, gentle);
    }
    for (const double spacing : {6e-3, 4e-3}) {
        for (const int substeps : {2, 5, 10, 20}) {
            xpbd(spacing, substeps, gentle);
        }
    }
    xpbd(3e-3, 5, gentle);
    if (scene.poissonCap > unlockedPoisson) {
        factored(4e-3, scene.poissonCap);
        xpbd(4e-3, 10, scene.poissonCap);
    }
    return out;
}

}  // namespace palpate::studies
