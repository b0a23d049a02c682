#include <studies/kernel/baselines/lattice.h>

#include <studies/kernel/baselines/fifo_mail.h>
#include <studies/kernel/baselines/mean_sweeps.h>
#include <studies/kernel/baselines/relaxed_grid.h>
#include <studies/kernel/kernel_rivals.h>
#include <studies/kernel/node_values.h>

#include <fmt/format.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

namespace palpate::studies {

using namespace chainmail;

namespace {

// Spacing [m], and the fraction of the table's limits that erred least over presses and drags of a 10 mm sphere in the
// scenes `block` and `layered`, among those that cost under a millisecond at 2 mm: the work grows with the share's inverse
// cube.
constexpr std::array<std::pair<double, double>, 3> tightened{{{4e-3, 0.25}, {2e-3, 0.15}, {1e-3, 0.15}}};
// Of a tick's increment through ChainMail, in radii of the contact: chosen as above. Shorter errs more, longer overshoots
// while the contact is still small.
constexpr double reachInRadii = 8.0;

volume::NodeGrid gridOf(const BaselineScene& scene, double spacing)
{
    const auto grid = volume::affordableGrid(scene.tissue.box(), spacing, maxTrialNodes);
    if (grid.spacing > 1.001 * spacing) {
        throw std::runtime_error(fmt::format("lattice baseline: {:g} mm would need over {} nodes; use {:.2g} mm or more",
                                             1e3 * spacing, maxTrialNodes, 1e3 * grid.spacing));
    }
    return grid;
}

RigidSphere sphereOf(const TrialLoad& load)
{
    const auto& shape = load.load().tools.front().shape;
    return {shape.b, shape.radiusB};
}

Lattice latticeOf(const BaselineScene& scene, double spacing, double fraction)
{
    const auto grid = gridOf(scene, spacing);
    return {grid, scene.tissue.tissueOn(grid), withLimits(scene.tissue.table(), fraction)};
}

// ChainMail from rest, with what it needs to start anew.
struct FifoMail {
    FifoMail(Lattice made, double radius, int meanSweeps)
        : lattice(std::move(made)),
          scratch(lattice),
          u(lattice.tissue.size(), Vec3f(0.0F)),
          seeds(maxPressSeeds(lattice, radius + lattice.grid.spacing)),
          sweeps(meanSweeps)
    {
        if (sweeps > 0) {
            means.emplace(lattice);
        }
    }

    void press(const TrialLoad& load)
    {
        toRest();
        // Tissue gives way along the press, as far as the tool is in now: it slides along under one that is dragged. The
        // surface lies half a spacing outside its nodes.
        const TrialPath& path = load.path();
        const double depth = load.pose().pressed - path.gap;
        const Vec3 to = path.at(load.pose());
        const double radius = path.tool.radius + 0.5 * lattice.grid.spacing;
        const std::size_t count = depth > 0.0 ? pressSeeds(lattice, to - depth * path.inward, to, radius, seeds) : 0;
        propagateFifo(lattice, u, scratch, std::span(seeds).first(count));
        if (means) {
            held.assign(scratch.moved.begin(), scratch.moved.begin() + static_cast<std::ptrdiff_t>(count));
            means->sweep(u, scratch.moved, held, sweeps);
        }
    }

    void toRest()
    {
        if (!means) {
            for (const Node n : scratch.moved) {
                u[n] = Vec3f(0.0F);
            }
            return;
        }
        const int width = means->high().x - means->low().x + 1;
        for (int z = means->low().z; z <= means->high().z; ++z) {
            for (int y = means->low().y; y <= means->high().y; ++y) {
                std::fill_n(&u[lattice.grid.offset({means->low().x, y, z})], std::max(width, 0), Vec3f(0.0F));
            }
        }
    }

    Lattice lattice;
    FifoScratch scratch;
    std::vector<Vec3f> u;
    std::vector<Seed> seeds;
    std::vector<Node> held;
    std::optional<MeanSweeps> means;
    int sweeps;
};

// All that the sphere can get at.
volume::Box reachOf(const TrialPath& path)
{
    const Vec3 end = path.way({path.press, path.drag});
    const Vec3 turn = path.way({path.press, 0.0});
    const double around = path.tool.radius + path.press;
    return {path.start + glm::min(Vec3(0.0), glm::min(turn, end)) - around,
            path.start + glm::max(Vec3(0.0), glm::max(turn, end)) + around};
}

struct Relaxed {
    Relaxed(const BaselineScene& scene, double spacing, int sweepsPerTick, bool predict)
        : body(trialBody(scene.tissue, scene.surface, gridOf(scene, spacing).spacing, scene.poissonCap, maxTrialNodes)),
          grid(body.body.levels.front(), scene.surface, reachOf(scene.path)),
          sweeps(sweepsPerTick)
    {
        if (predict) {
            mail.emplace(body.body.levels.front());
        }
    }

    void press(const TrialLoad& load)
    {
        const RigidSphere sphere = sphereOf(load);
        const double step = before ? glm::distance(sphere.centre, *before) : 0.0;
        before = sphere.centre;
        if (mail && step > 0.0 && grid.wayTo(sphere, seeds) > 0) {
            for (const Node n : mail->spread(seeds, step / reachAt(load))) {
                grid.add(n, mail->increment(n));
            }
        }
        touched = grid.project(sphere);
        if (touched > 0 || !atRest) {
            atRest = false;
            grid.sweep(sphere, sweeps);
            force = grid.force();
        }
    }

    // How far the increment goes: in proportion to the contact's radius, as in a half-space.
    double reachAt(const TrialLoad& load) const
    {
        const double depth = std::max(load.pose().pressed - load.path().gap, 0.0);
        return reachInRadii * std::max(std::sqrt(load.path().tool.radius * depth), body.cells.spacing);
    }

    TrialBody body;
    RelaxedGrid grid;
    std::optional<IncrementMail> mail;
    std::vector<Seed> seeds;
    std::optional<Vec3> before;  // where the sphere was in the last tick [m]
    Vec3 force{0.0};
    std::size_t touched = 0;
    int sweeps;
    bool atRest = true;
};

Baseline relaxed(const BaselineScene& scene, const char* method, double spacing, int sweeps, bool predict)
{
    return {method, fmt::format("{:g} mm, {} sweep{}", 1e3 * spacing, sweeps, sweeps == 1 ? "" : "s"),
            [=] { return relaxedModel(scene, spacing, sweeps, predict); }};
}

}  // namespace

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

TrialModel fifoMailModel(const BaselineScene& scene, double spacing, double fraction, int meanSweeps)
{
    auto mail = std::make_shared<FifoMail>(latticeOf(scene, spacing, fraction), scene.path.tool.radius, meanSweeps);
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

TrialModel relaxedModel(const BaselineScene& scene, double spacing, int sweeps, bool predict)
{
    auto state = std::make_shared<Relaxed>(scene, spacing, sweeps, predict);
    return {[state](const TrialLoad& load) {
                state->press(load);
                return ElasticResult{};
            },
            [state](Vec3 rest) { return state->grid.displacement(rest); }, [state] { return state->force; },
            [state] { return state->touched; }};
}

std::vector<Baseline> latticeBaselines(const BaselineScene& scene)
{
    std::vector<Baseline> all;
    for (const auto& [spacing, fraction] : tightened) {
        all.push_back({"chainmail_fifo", fmt::format("{:g} mm", 1e3 * spacing),
                       [=, fraction = fraction, spacing = spacing] { return fifoMailModel(scene, spacing, fraction, 0); }});
    }
    for (const double spacing : {4e-3, 2e-3}) {
        all.push_back(
            {"chainmail", fmt::format("{:g} mm", 1e3 * spacing), [=] { return orderedMailModel(scene, spacing); }});
    }
    // A hundred at 1 mm take half a second a tick, and are no better than a hundred at 2 mm.
    for (const auto& [spacing, sweeps] : {std::pair(2e-3, 10), std::pair(2e-3, 100), std::pair(1e-3, 10)}) {
        all.push_back({"chainmail_laplacian", fmt::format("{:g} mm, {} sweeps", 1e3 * spacing, sweeps),
                       [=, spacing = spacing, sweeps = sweeps] {
                           return fifoMailModel(scene, spacing, tightened.back().second, sweeps);
                       }});
    }
    for (const double spacing : {4e-3, 2e-3}) {
        for (const int sweeps : {1, 4, 10}) {
            all.push_back(relaxed(scene, "relaxation", spacing, sweeps, false));
            all.push_back(relaxed(scene, "chainmail_navier", spacing, sweeps, true));
        }
    }
    return all;
}

}  // namespace palpate::studies
