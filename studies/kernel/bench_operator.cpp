#include <studies/kernel/bench_operator.h>

#include <chainmail/kernels_sets.h>
#include <chainmail/window.h>

#include <algorithm>
#include <chrono>
#include <iterator>
#include <random>
#include <stdexcept>

namespace palpate::studies {

KernelSets kernelSets()
{
    using namespace chainmail;
    KernelSets sets{{kernelsV2.name, kernelsAvx2.name, kernelsAvx512.name}, {}};
    std::ranges::transform(supportedKernels(), std::back_inserter(sets.runs), &Kernels::name);
    return sets;
}

using namespace chainmail;

namespace {

constexpr double spacing = 2e-3;  // [m]
constexpr int operatorTries = 15;
constexpr double nodesPerTry = 2e6;

// A cube of fat with random displacements.
struct Cube {
    explicit Cube(int window) : layout(Layout::of(window, window, window))
    {
        mu.assign(layout.count + Layout::lanes, 0.0F);
        lambda = mu;
        u.assign(layout.fieldSize(), 0.0F);
        out = u;
        scratch.assign(layout.scratchSize(), 0.0F);
        std::mt19937 random(1);
        std::uniform_real_distribution<float> shift(-1e-4F, 1e-4F);
        constexpr float scaled = static_cast<float>(1e3 * spacing / 32.0);
        volume::forEachIndex(Index3(0), Index3(window - 1), [&](Index3 n) {
            const std::size_t at = layout.at(n.x, n.y, n.z);
            if (n.x + 1 < window && n.y + 1 < window && n.z + 1 < window) {
                mu[at] = scaled;
                lambda[at] = 49.0F * scaled;
            }
            for (std::size_t c = 0; c < 3; ++c) {
                u[c * layout.count + at] = shift(random);
            }
        });
    }

    CellStiffness stiffness() const noexcept { return {mu.data(), lambda.data()}; }
    double nodes() const noexcept
    {
        return static_cast<double>(layout.nx) * static_cast<double>(layout.ny) * static_cast<double>(layout.nz);
    }
    double cells() const noexcept
    {
        return static_cast<double>(layout.nx - 1) * static_cast<double>(layout.ny - 1) * static_cast<double>(layout.nz - 1);
    }

    Layout layout;
    Floats mu, lambda, u, out, scratch;
};

// The best of a few tries, each of many calls.
template <typename Call>
double secondsPerNode(const Cube& cube, Call&& call)
{
    using Clock = std::chrono::steady_clock;
    const int calls = std::max(1, static_cast<int>(nodesPerTry / cube.nodes()));
    double best = 1.0;
    for (int i = 0; i < operatorTries; ++i) {
        const auto start = Clock::now();
        for (int c = 0; c < calls; ++c) {
            call();
        }
        best = std::min(best, std::chrono::duration<double>(Clock::now() - start).count() / calls);
    }
    return best / cube.nodes();
}

OperatorCase timed(const std::string& set, bool finite, Cube& cube, const MachineRates& rates, double seconds)
{
    const OperatorCost cost = operatorCost(finite);
    const double fraction = cube.cells() / cube.nodes();
    const double least = minTime(cost, rates);
    return {set, finite, cube.layout.nx, seconds, fraction * least, least <= cost.bytes / rates.bytes};
}

void timeSet(const Kernels& k, const MachineRates& rates, Cube& cube, std::vector<OperatorCase>& cases)
{
    constexpr float inverse = static_cast<float>(1.0 / spacing);
    const double linear = secondsPerNode(
        cube, [&] { k.apply(cube.layout, cube.stiffness(), cube.u.data(), cube.out.data(), cube.scratch.data()); });
    cases.push_back(timed(k.name, false, cube, rates, linear));
    const double finite = secondsPerNode(cube, [&] {
        k.applyFinite(cube.layout, cube.stiffness(), inverse, cube.u.data(), cube.out.data(), cube.scratch.data());
    });
    cases.push_back(timed(k.name, true, cube, rates, finite));
}

}  // namespace

// Instructions of the compiled loops over cells, additions and multiplications (tests/structure/operator_cost_test.py
// counts them again), for whole cells whose tissue does not stiffen; a division is left out. Eight floats go in and out.
OperatorCost operatorCost(bool finiteStrain) noexcept
{
    constexpr double bytes = 8 * sizeof(float);
    return finiteStrain ? OperatorCost{322, 236, bytes} : OperatorCost{128, 27, bytes};
}

double minTime(const OperatorCost& cost, const MachineRates& rates) noexcept
{
    return std::max(
        {cost.additions / rates.additions, cost.multiplications / rates.multiplications,
         (cost.additions + cost.multiplications) / std::max({rates.both, rates.additions, rates.multiplications}),
         cost.bytes / rates.bytes});
}

OperatorBench benchOperator(const std::vector<int>& windows)
{
    OperatorBench bench;
    for (const Kernels* k : supportedKernels()) {
        bench.sets.push_back({k->name, machineRates(k->name)});
    }
    for (const int window : windows) {
        Cube cube(window);
        for (std::size_t i = 0; i < bench.sets.size(); ++i) {
            timeSet(*supportedKernels()[i], bench.sets[i].rates, cube, bench.cases);
        }
    }
    return bench;
}

const OperatorCase& caseOf(const OperatorBench& bench, const std::string& set, bool finiteStrain, int window)
{
    const auto is = [&](const OperatorCase& c) {
        return c.set == set && c.finiteStrain == finiteStrain && c.window == window;
    };
    if (const auto found = std::ranges::find_if(bench.cases, is); found != bench.cases.end()) {
        return *found;
    }
    throw std::out_of_range("operator: there is no such case");
}

}  // namespace palpate::studies
