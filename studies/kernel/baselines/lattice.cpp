#include <studies/kernel/baselines/lattice.h>

#include <base/error.h>
#include <studies/kernel/kernel_rivals.h>
#include <studies/kernel/node_values.h>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <array>
#include <memory>
#include <utility>

namespace palpate::studies {

using namespace chainmail;

namespace {

constexpr std::size_t movesPerNode = 4;  // held nodes that disagree could keep others moving for ever
constexpr float rounding = 1e-5F;        // fraction of the spacing

void move(FifoScratch& scratch, std::span<Vec3f> u, Node n, Vec3f to)
{
    u[n] = to;
    if (scratch.seen[n] != scratch.pass) {
        scratch.seen[n] = scratch.pass;
        scratch.moved.push_back(n);
    }
    if (scratch.waits[n] == 0) {
        scratch.waits[n] = 1;
        scratch.queue.push_back(n);
    }
}

// Spacing [m], and the fraction of the table's limits that erred least over presses and drags of a 10 mm sphere in the
// scenes `block` and `layered`, among those that cost under a millisecond at 2 mm: the work grows with the share's inverse
// cube.
constexpr std::array<std::pair<double, double>, 3> tightened{{{4e-3, 0.25}, {2e-3, 0.15}, {1e-3, 0.15}}};

volume::NodeGrid gridOf(const BaselineScene& scene, double spacing)
{
    const auto grid = volume::affordableGrid(scene.tissue.box(), spacing, maxTrialNodes);
    base::failIf(grid.spacing > 1.001 * spacing,
                 "lattice baseline: {:g} mm would need over {} nodes; use {:.2g} mm or more", 1e3 * spacing, maxTrialNodes,
                 1e3 * grid.spacing);
    return grid;
}

// The table with all slack of links multiplied by `fraction`.
volume::TissueTable withLimits(const volume::TissueTable& table, double fraction)
{
    volume::TissueTable out = table;
    for (auto& row : out.rows) {
        row.compress = 1.0 - fraction * (1.0 - row.compress);
        row.stretch = 1.0 + fraction * (row.stretch - 1.0);
        row.shear *= fraction;
    }
    return out;
}

Lattice latticeOf(const BaselineScene& scene, double spacing, double fraction)
{
    const auto grid = gridOf(scene, spacing);
    return {grid, scene.tissue.tissueOn(grid), withLimits(scene.tissue.table(), fraction)};
}

// ChainMail from rest, with what it needs to start anew.
struct FifoMail {
    FifoMail(Lattice made, double radius)
        : lattice(std::move(made)),
          scratch(lattice),
          u(lattice.tissue.size(), Vec3f(0.0F)),
          seeds(maxPressSeeds(lattice, radius + lattice.grid.spacing))
    {
    }

    void press(const TrialLoad& load)
    {
        for (const Node n : scratch.moved) {
            u[n] = Vec3f(0.0F);
        }
        // Tissue gives way along the press, as far as the tool is in now: it slides along under one that is dragged. The
        // surface lies half a spacing outside its nodes.
        const TrialPath& path = load.path();
        const double depth = load.pose().pressed - path.gap;
        const Vec3 to = path.at(load.pose());
        const double radius = path.tool.radius + 0.5 * lattice.grid.spacing;
        const std::size_t count = depth > 0.0 ? pressSeeds(lattice, to - depth * path.inward, to, radius, seeds) : 0;
        propagateFifo(lattice, u, scratch, std::span(seeds).first(count));
    }

    Lattice lattice;
    FifoScratch scratch;
    std::vector<Vec3f> u;
    std::vector<Seed> seeds;
};

}  // namespace

FifoScratch::FifoScratch(const Lattice& lattice)
    : seen(lattice.tissue.size(), 0), held(lattice.tissue.size(), 0), waits(lattice.tissue.size(), 0)
{
}

std::size_t propagateFifo(const Lattice& lattice, std::span<Vec3f> u, FifoScratch& scratch, std::span<const Seed> seeds)
{
    ++scratch.pass;
    scratch.queue.clear();
    scratch.moved.clear();
    for (const Seed& seed : seeds) {
        scratch.held[seed.node] = scratch.pass;
        move(scratch, u, seed.node, seed.u);
    }
    const float least = rounding * static_cast<float>(lattice.grid.spacing);
    const std::size_t most = movesPerNode * lattice.tissue.size();
    std::size_t moves = 0;
    for (std::size_t head = 0; head < scratch.queue.size(); ++head) {
        const Node a = scratch.queue[head];
        scratch.waits[a] = 0;
        for (int side = 0; side < 6 && moves < most; ++side) {
            const Node b = lattice.beside(a, side);
            if (!lattice.isNode(b) || lattice.isFixed(b) || scratch.held[b] == scratch.pass) {
                continue;
            }
            const Vec3f step = correction(u[b] - u[a], side, lattice.between(a, b));
            if (glm::dot(step, step) > least * least) {
                move(scratch, u, b, u[b] + step);
                ++moves;
            }
        }
    }
    return moves;
}

TrialModel fifoMailModel(const BaselineScene& scene, double spacing, double fraction)
{
    auto mail = std::make_shared<FifoMail>(latticeOf(scene, spacing, fraction), scene.path.tool.radius);
    return {[mail](const TrialLoad& load) {
                mail->press(load);
                return ElasticResult{};
            },
            [mail](Vec3 rest) { return displacementIn(mail->lattice, mail->u, rest); },
            {},
            [mail] { return mail->scratch.moved.size(); }};
}

TrialModel orderedMailModel(const BaselineScene& scene, double spacing)
{
    auto lattice = std::make_shared<const Lattice>(latticeOf(scene, spacing, 1.0));
    return chainMailModel(lattice, scene.path, static_cast<std::uint32_t>(lattice->tissue.size()));
}

std::vector<Baseline> latticeBaselines(const BaselineScene& scene)
{
    std::vector<Baseline> all;
    for (const auto& [spacing, fraction] : tightened) {
        all.push_back({"chainmail_fifo", fmt::format("{:g} mm", 1e3 * spacing),
                       [=, fraction = fraction, spacing = spacing] { return fifoMailModel(scene, spacing, fraction); }});
    }
    for (const double spacing : {4e-3, 2e-3}) {
        all.push_back(
            {"chainmail", fmt::format("{:g} mm", 1e3 * spacing), [=] { return orderedMailModel(scene, spacing); }});
    }
    return all;
}

}  // namespace palpate::studies
