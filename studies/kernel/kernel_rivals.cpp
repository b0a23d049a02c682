#include <studies/kernel/kernel_rivals.h>

#include <studies/kernel/node_values.h>

#include <chainmail/level.h>
#include <occupancy/body.h>

#include <algorithm>
#include <utility>

namespace palpate::studies {

using namespace chainmail;

namespace {

constexpr double widestTip = 1.05e-3;  // a needle's tip as ChainMail holds it: a 14 G needle [m]

// How the tool holds the lattice in a pose, as in haptics/.
Grip gripOf(const TrialLoad& load)
{
    const TrialPath& path = load.path();
    const Vec3 way = path.way(load.pose());
    Grip grip;
    grip.radius = path.tool.radius;
    if (!path.ties.empty()) {
        grip.kind = Grip::Kind::point;
        grip.inside = true;
        grip.proxy = path.ties.front().rest;
        grip.position = grip.proxy + way;
    } else if (load.pose().pressed > path.gap) {
        grip.kind = Grip::Kind::press;
        grip.proxy = path.start + path.gap * path.inward;
        grip.position = path.start + way;
        grip.shape = {grip.position, grip.position, grip.radius, grip.radius};
    }
    return grip;
}

}  // namespace

TrialBody trialBody(const volume::Tissue& tissue, const volume::DistanceField& surface, double wanted, double poissonCap,
                    std::size_t maxNodes, Vec3 shift)
{
    auto cells = volume::affordableGrid(tissue.box(), wanted, maxNodes);
    cells.origin += cells.spacing * shift;
    return {cells,
            elasticBody(cells, tissue.materialOn(cells, surface), surface, poissonCap, 0.0, false, tissue.support())};
}

TrialResult elasticTrial(const ElasticBody& body, const TrialPath& path, double speed, const Reference& reference,
                         const ElasticOptions& options)
{
    Elastic elastic(body, options, TrialLoad(path).load().focus);
    return runTrial(elasticModel(elastic), path, speed, reference);
}

TrialModel chainMailModel(std::shared_ptr<const Lattice> lattice, const TrialPath& path, std::uint32_t maxMoves)
{
    struct Mail {
        Mail(std::shared_ptr<const Lattice> nodes, double radius, std::uint32_t maxMoves)
            : lattice(std::move(nodes)),
              deformation(*lattice, maxMoves, maxPressSeeds(*lattice, radius)),
              level(deformation, radius)
        {
        }
        std::shared_ptr<const Lattice> lattice;
        Deformation deformation;
        ChainMailLevel level;
    };
    auto mail = std::make_shared<Mail>(std::move(lattice), std::max(path.tool.radius, widestTip), maxMoves);
    return {[mail](const TrialLoad& load) {
                mail->level.deform(gripOf(load));
                return ElasticResult{};
            },
            [mail](Vec3 rest) { return displacementIn(*mail->lattice, mail->deformation.shape().u(), rest); },
            {},
            [mail] { return mail->deformation.moved().size(); }};
}

TrialResult chainMailTrial(const Lattice& lattice, const TrialPath& path, double speed, const Reference& reference,
                           std::uint32_t maxMoves)
{
    const std::shared_ptr<const Lattice> notOurs(&lattice, [](const Lattice*) {});
    return runTrial(chainMailModel(notOurs, path, maxMoves), path, speed, reference);
}

std::vector<RivalRun> singleGridTrials(const volume::Tissue& tissue, const volume::DistanceField& surface,
                                       const TrialBody& fine, const TrialPath& path, double speed,
                                       const Reference& reference, const datasets::ElasticSettings& settings, int maxCycles)
{
    constexpr int coarsest = 4;
    constexpr int maxFineCycles = 2;
    std::vector<RivalRun> runs;
    const auto run = [&](const ElasticBody& body, int coarsening, int cycles) {
        Elastic elastic(body, wholeGrid(cycles, settings.law), TrialLoad(path).load().focus);
        runs.push_back({coarsening, cycles, elastic.nodes(), runTrial(elasticModel(elastic), path, speed, reference)});
    };
    for (int cycles = 1; cycles <= std::min(maxCycles, maxFineCycles); ++cycles) {
        run(fine.body, 1, cycles);
    }
    for (int coarsening = 2; coarsening <= coarsest; ++coarsening) {
        const TrialBody coarse =
            trialBody(tissue, surface, coarsening * fine.cells.spacing, settings.poissonCap, fine.cells.count());
        for (int cycles = 1; cycles <= maxCycles; ++cycles) {
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

}  // namespace palpate::studies
