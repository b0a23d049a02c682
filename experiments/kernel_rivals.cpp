#include <experiments/kernel_rivals.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>

namespace palpate::experiments {

using namespace chainmail;

namespace {

constexpr double widestTip = 1.05e-3;  // a needle's tip as ChainMail holds it: a 14 G needle [m]

// Displacement between the nodes of a lattice: trilinear over those that are tissue.
Vec3 between(const Lattice& lattice, std::span<const Vec3f> u, Vec3 rest)
{
    const auto& grid = lattice.grid;
    const Vec3 at = glm::clamp((rest - grid.origin) / grid.spacing, Vec3(0.0), Vec3(grid.size - 1));
    const Index3 low = glm::min(Index3(at), grid.size - 2);
    const Vec3 t = at - Vec3(low);
    Vec3 sum(0.0);
    double weights = 0.0;
    for (int c = 0; c < 8; ++c) {
        const Index3 corner(c & 1, (c >> 1) & 1, c >> 2);
        const auto n = static_cast<Node>(grid.offset(low + corner));
        if (lattice.isNode(n)) {
            const Vec3 w = glm::mix(1.0 - t, t, Vec3(corner));
            sum += w.x * w.y * w.z * Vec3(u[n]);
            weights += w.x * w.y * w.z;
        }
    }
    return weights > 0.0 ? sum / weights : Vec3(0.0);
}

// What holds the lattice in a pose, as in haptics/.
std::size_t seedsOf(const Lattice& lattice, const TrialLoad& load, std::span<Seed> seeds, Yield& yield)
{
    const TrialPath& path = load.path();
    const Vec3 way = path.way(load.pose());
    if (!path.ties.empty()) {
        return dragSeeds(lattice, path.ties.front().rest, way, seeds);
    }
    const Vec3 first = path.start + path.gap * path.inward;
    const Vec3 now = path.start + way;
    if (load.pose().pressed <= path.gap) {
        return 0;
    }
    yield = Yield(glm::normalize(now - first));
    return pressSeeds(lattice, first, now, path.tool.radius, seeds);
}

}  // namespace

TrialBody trialBody(const volume::Tissue& tissue, const volume::DistanceField& surface, double wanted, double poissonCap,
                    std::size_t mostNodes)
{
    const double spacing = volume::affordableSpacing(tissue.box(), wanted, 2.0 * wanted, mostNodes);
    const auto cells = volume::coveringGrid(tissue.box(), spacing, 2.0 * spacing);
    return {cells, elasticBody(cells, tissue.materialOn(cells), surface, poissonCap)};
}

TrialResult elasticTrial(const ElasticBody& body, const TrialPath& path, double speed, const Reference& reference,
                         const ElasticOptions& options)
{
    Elastic elastic(body, options, TrialLoad(path).load().focus);
    return runTrial(elasticModel(elastic), path, speed, reference);
}

TrialResult chainMailTrial(const Lattice& lattice, const TrialPath& path, double speed, const Reference& reference,
                           std::uint32_t maxMoves)
{
    const std::size_t most = mostPressSeeds(lattice, std::max(path.tool.radius, widestTip));
    Deformation deformation(lattice, maxMoves, most);
    std::vector<Seed> seeds(most);
    const TrialModel model{[&](const TrialLoad& load) {
                               Yield yield(0.0F);
                               const std::size_t count = seedsOf(lattice, load, seeds, yield);
                               deformation.deform(std::span(seeds).first(count), yield);
                               return ElasticResult{};
                           },
                           [&](Vec3 rest) { return between(lattice, deformation.u(), rest); },
                           {},
                           [&] { return deformation.moved().size(); }};
    return runTrial(model, path, speed, reference);
}

std::vector<RivalRun> singleGridTrials(const volume::Tissue& tissue, const volume::DistanceField& surface,
                                       const TrialBody& fine, const TrialPath& path, double speed,
                                       const Reference& reference, const datasets::ElasticSettings& settings,
                                       int mostCycles)
{
    constexpr int coarsest = 4;
    constexpr int mostFineCycles = 2;
    const bool finite = settings.strain == datasets::Strain::finite;
    std::vector<RivalRun> runs;
    const auto run = [&](const ElasticBody& body, int coarsening, int cycles) {
        Elastic elastic(body, wholeGrid(cycles, finite), TrialLoad(path).load().focus);
        runs.push_back({coarsening, cycles, elastic.nodes(), runTrial(elasticModel(elastic), path, speed, reference)});
    };
    for (int cycles = 1; cycles <= std::min(mostCycles, mostFineCycles); ++cycles) {
        run(fine.body, 1, cycles);
    }
    for (int coarsening = 2; coarsening <= coarsest; ++coarsening) {
        const TrialBody coarse =
            trialBody(tissue, surface, coarsening * fine.cells.spacing, settings.poissonCap, fine.cells.count());
        for (int cycles = 1; cycles <= mostCycles; ++cycles) {
            run(coarse.body, coarsening, cycles);
        }
    }
    return runs;
}

double ratioAtEqualError(std::span<const RivalRun> runs, double TrialErrors::*figure, double error, double seconds)
{
    double best = 0.0;
    for (const RivalRun& run : runs) {
        const bool equal = spreadOf(run.result.looks, figure).median <= error;
        if (equal && (best == 0.0 || run.result.mean < best)) {
            best = run.result.mean;
        }
    }
    return best / seconds;
}

}  // namespace palpate::experiments
