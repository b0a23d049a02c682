// palpate-rival-calculix: CalculiX with neo-Hookean quadratic tetrahedra on a push of `palpate accuracy`. Of
// palpate-reference's code, and under its licence: see reference/NOTICE.
#include <apps/rival_push.h>
#include <base/error.h>
#include <base/mapped.h>
#include <reference/ccx.h>

#include <sys/resource.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <map>

namespace palpate::apps {

namespace {

// Of all children that have ended [s].
double childrensTime()
{
    rusage used{};
    getrusage(RUSAGE_CHILDREN, &used);
    const auto seconds = [](timeval t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); };
    return seconds(used.ru_utime) + seconds(used.ru_stime);
}

void addFaces(const RivalPush& push, reference::TetMesh& mesh)
{
    using Corners = std::array<std::uint32_t, 3>;
    const auto sorted = [](Corners c) {
        std::ranges::sort(c);
        return c;
    };
    std::map<Corners, std::uint32_t> owner;
    for (std::uint32_t t = 0; t < push.tets.size(); ++t) {
        for (std::size_t without = 0; without < 4; ++without) {
            const auto& tet = push.tets[t];
            owner[sorted({tet[(without + 1) % 4], tet[(without + 2) % 4], tet[(without + 3) % 4]})] = t;
        }
    }
    std::vector<char> held(push.points.size(), 0);
    for (const std::uint32_t p : push.held) {
        held.at(p) = 1;
    }
    for (const Corners& c : push.triangles) {
        const bool stays = std::ranges::all_of(c, [&](std::uint32_t p) { return held[p] != 0; });
        mesh.faces.push_back({c, owner.at(sorted(c)), stays});
    }
}

reference::TetMesh meshOf(const RivalPush& push)
{
    constexpr std::size_t maxMaterials = std::numeric_limits<std::uint8_t>::max();
    base::failIf(push.materials.size() > maxMaterials, "{} materials: the maximum is {}; take another --rival-mesh-mm",
                 push.materials.size(), maxMaterials);
    reference::TetMesh mesh;
    mesh.points = push.points;
    mesh.tets = push.tets;
    mesh.tissue = base::mapped<std::uint8_t>(push.material, std::identity());
    addFaces(push, mesh);
    return mesh;
}

RivalResults solve(const RivalPush& push, const std::filesystem::path& folder)
{
    base::failIf(!reference::hasCcx(), "ccx is not in PATH: install Debian's calculix-ccx");
    const auto materials = base::mapped<reference::Material>(push.materials, [&](const RivalMaterial& m) {
        return reference::Material{m.youngsModulus, m.poisson, 0.0};
    });

    const auto centreAt = [&](std::size_t look) { return push.centre.at(look); };
    const reference::CcxPress press{push.held, push.radius, push.centre.at(0), base::mapped<Vec3>(push.looks, centreAt)};
    const auto file = folder / "press.inp";
    reference::exportCcxPress(meshOf(push), materials, press, file);
    const double before = childrensTime();
    RivalResults results;
    for (const reference::CcxSolution& step : reference::runCcxPress(file, push.looks.size())) {
        results.u.emplace_back(step.u.begin(), step.u.begin() + static_cast<std::ptrdiff_t>(push.points.size()));
        results.force.push_back(step.force);
    }
    // CalculiX does not say what a step took: the mean of all.
    results.seconds.push_back((childrensTime() - before) / static_cast<double>(push.looks.size()));
    return results;
}

}  // namespace

}  // namespace palpate::apps

int main(int argc, char** argv)
{
    return palpate::apps::rivalMain(argc, argv, "palpate-rival-calculix",
                                    "Solves a push of `palpate accuracy` with CalculiX", palpate::apps::solve);
}
