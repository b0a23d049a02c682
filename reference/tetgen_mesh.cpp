#include <reference/tetgen_mesh.h>

#include <base/child_process.h>
#include <base/error.h>
#include <base/folds.h>
#include <base/temporary_folder.h>
#include <base/units.h>
#include <reference/mesh_parts.h>
#include <reference/tetgen_job.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ranges>
#include <stdexcept>

namespace palpate::reference {

namespace {

constexpr double regularVolume = 0.117851;  // of a tetrahedron with edges of 1
constexpr double sameVolume = 1e-6;         // fraction of the body's volume

std::array<double, 3> threeMillimetres(Vec3 p)
{
    return {units::mm * p.x, units::mm * p.y, units::mm * p.z};
}

TetGenJob jobOf(const Surfaces& surfaces, const TetGenOptions& options)
{
    TetGenJob job;
    job.switches = options.switches;
    std::ranges::transform(surfaces.points, std::back_inserter(job.points), threeMillimetres);
    std::ranges::transform(surfaces.facets, std::back_inserter(job.facets), &Surfaces::Facet::points);
    for (const auto& seed : surfaces.seeds) {
        const double edge = units::mm * options.largest;
        job.regions.push_back({threeMillimetres(seed.point), 1.0 + static_cast<double>(job.regions.size()),
                               regularVolume * edge * edge * edge});
    }
    return job;
}

TetGenResult run(const TetGenJob& job, const TetGenOptions& options)
{
    const base::TemporaryFolder folder("TetGen's surfaces");
    const auto in = folder / "job", out = folder / "result";
    write(in, job);
    const auto program = options.program.empty() ? base::programFolder() / "palpate-mesh" : options.program;
    base::ChildProcess child(program, {"--tetgen-job", in.string(), out.string()}, "it is what runs TetGen: build it too");
    if (child.wait(options.seconds) < 0) {
        throw std::runtime_error(child.killed() ? "it crashed" : fmt::format("it took over {:g} s", options.seconds));
    }
    TetGenResult result = readResult(out);
    base::failIf(!result.error.empty(), "{}", result.error);
    return result;
}

// TetGen says less of surfaces that cross than it knows.
std::string whatCrosses(const Surfaces& surfaces, const TetGenOptions& options)
{
    try {
        const std::size_t count = crossingFacets(surfaces, options).size();
        return count > 0 ? fmt::format(" ({} of {} facets cross others)", count, surfaces.facets.size()) : std::string();
    } catch (const std::runtime_error&) {
        return {};
    }
}

TetGenResult filled(const Surfaces& surfaces, const TetGenOptions& options)
{
    try {
        return run(jobOf(surfaces, options), options);
    } catch (const std::runtime_error& e) {
        throw base::error("TetGen cannot mesh these surfaces: {}{}; another --size may do, or --surface", e.what(),
                          whatCrosses(surfaces, options));
    }
}

TetMesh meshOf(const TetGenResult& result, const Surfaces& surfaces)
{
    TetMesh mesh;
    for (std::size_t p = 0; p < result.points.size(); ++p) {
        const auto& q = result.points[p];
        // Those of the surfaces are what they were, to the bit.
        mesh.points.push_back(p < surfaces.points.size() ? surfaces.points[p] : Vec3(q[0], q[1], q[2]) / units::mm);
    }
    for (std::size_t t = 0; t < result.tets.size(); ++t) {
        // What has no seed lies outside, in a hollow of the body: TetGen fills that too.
        if (result.region[t] < 1 || static_cast<std::size_t>(result.region[t]) > surfaces.seeds.size()) {
            continue;
        }
        mesh.tets.push_back(result.tets[t]);
        mesh.tissue.push_back(surfaces.seeds[static_cast<std::size_t>(result.region[t] - 1)].tissue);
    }
    // TetGen turns its tetrahedra the other way round. All alike: one that is flipped stays so, and is found.
    const double sum =
        base::sumOf(std::views::iota(0UL, mesh.tets.size()), [&](std::size_t t) { return sixVolumes(mesh, t); });
    if (sum < 0.0) {
        for (auto& tet : mesh.tets) {
            std::swap(tet[2], tet[3]);
        }
    }
    return mesh;
}

void checkVolumes(const TetMesh& mesh, const Surfaces& surfaces)
{
    const std::vector<double> wanted = enclosedVolumes(surfaces);
    double all = 0.0;
    std::vector<std::uint8_t> rows;
    for (std::size_t row = 0; row < wanted.size(); ++row) {
        rows.push_back(static_cast<std::uint8_t>(row));
        all += std::abs(wanted[row]);
    }
    const std::vector<double> made = volumesOf(mesh, rows);
    for (std::size_t row = 0; row < wanted.size(); ++row) {
        base::failIf(std::abs(made[row] - wanted[row]) > sameVolume * all,
                     "TetGen's mesh has {:g} ml of tissue {} where its surfaces enclose {:g} ml: "
                     "take another --size",
                     1e6 * made[row], row, 1e6 * wanted[row]);
    }
}

}  // namespace

TetMesh fillSurfaces(const Surfaces& surfaces, const TetGenOptions& options)
{
    TetMesh mesh = meshOf(filled(surfaces, options), surfaces);
    checkVolumes(mesh, surfaces);
    dropUnusedPoints(mesh);
    return mesh;
}

std::vector<std::array<std::uint32_t, 3>> crossingFacets(const Surfaces& surfaces, const TetGenOptions& options)
{
    TetGenOptions diagnose = options;
    diagnose.switches = std::string("d");
    auto faces = run(jobOf(surfaces, diagnose), options).faces;
    for (auto& face : faces) {
        std::ranges::sort(face);
    }
    return faces;
}

}  // namespace palpate::reference
