#include <studies/kernel/kernel_work.h>

#include <studies/kernel/bench_operator.h>

#include <array>

namespace palpate::studies {

namespace {

using namespace chainmail;

enum class Operation : std::uint8_t {
    apply,
    residualOf,
    smoothOf,
    applyFinite,
    dots,
    combine,
    warmStart,
    direct,
    keepStep,
    negate,
    smoothFirst,
    smooth,
    chebyshev,
    blend,
    addMasked,
    average,
    hat,
    spread,
    gatherAdd,
    count
};
constexpr auto operations = static_cast<std::size_t>(Operation::count);

struct Meaning {
    const char* name;
    const char* purpose;
};
constexpr std::array<Meaning, operations> meanings{{
    {"apply", "force at small strain, and of a coarse window"},
    {"residualOf", "residual that the coarser window is to solve"},
    {"smoothOf", "last smoothing step of a window"},
    {"applyFinite", "force and energy at finite strain: once per cycle"},
    {"dots", "slope and curvature of a step"},
    {"combine", "sum of two fields"},
    {"warmStart", "start: along the last call's increment"},
    {"direct", "direction conjugate to the step before, and its trial"},
    {"keepStep", "end of a step, with its three products"},
    {"negate", "sign and degrees of freedom of a force"},
    {"smoothFirst", "first smoothing step; what a border takes"},
    {"smooth", "smoothing step with a residual at hand"},
    {"chebyshev", "steps that solve the coarsest window"},
    {"blend", "border nodes from the coarser window"},
    {"addMasked", "correction from the coarser window"},
    {"average", "between planes and rows, to the finer window"},
    {"hat", "between planes and rows, to the coarser window"},
    {"spread", "along rows, to the finer window"},
    {"gatherAdd", "along rows, to the coarser window"},
}};

// One count at a time: the operations are plain functions and have no place for it.
struct Tally {
    double calls = 0, nodes = 0, floats = 0;
};
std::array<Tally, operations> tallies;
const Kernels* counted = nullptr;

void add(Operation operation, double nodes, double floats) noexcept
{
    Tally& t = tallies[static_cast<std::size_t>(operation)];
    t.calls += 1;
    t.nodes += nodes;
    t.floats += floats;
}

// An operation on whole windows: so many floats per node, read and written.
void whole(Operation operation, const Layout& layout, double perNode) noexcept
{
    const auto nodes = static_cast<double>(layout.count);
    add(operation, nodes, perNode * nodes);
}

// A pass over `n` floats of fields with three components, so many fields read and written.
void pass(Operation operation, std::size_t n, double fields) noexcept
{
    add(operation, static_cast<double>(n) / 3, fields * static_cast<double>(n));
}

// A pass over `count` nodes with three components, and masks or diagonals of one: so many floats per node.
void masked(Operation operation, std::size_t count, double perNode) noexcept
{
    add(operation, static_cast<double>(count), perNode * static_cast<double>(count));
}

constexpr double operatorFloats = 8;  // displacement, two moduli, result

void countOperators(Kernels& k) noexcept
{
    k.apply = [](const Layout& l, CellStiffness s, const float* u, float* out, float* scratch) noexcept {
        whole(Operation::apply, l, operatorFloats);
        counted->apply(l, s, u, out, scratch);
    };
    k.residualOf = [](const Layout& l, CellStiffness s, const float* open, const float* r, const float* u, float* out,
                      float* scratch) noexcept {
        whole(Operation::residualOf, l, operatorFloats + 4);
        counted->residualOf(l, s, open, r, u, out, scratch);
    };
    k.smoothOf = [](const Layout& l, CellStiffness s, const Smoother& by, float* u, float* out, float* scratch) noexcept {
        whole(Operation::smoothOf, l, operatorFloats + 7);
        counted->smoothOf(l, s, by, u, out, scratch);
    };
    k.applyFinite = [](const Layout& l, CellStiffness s, float inverse, const float* u, float* out,
                       float* scratch) noexcept {
        whole(Operation::applyFinite, l, operatorFloats);
        return counted->applyFinite(l, s, inverse, u, out, scratch);
    };
}

void countPasses(Kernels& k) noexcept
{
    k.dots = [](const float* x, const float* a, const float* b, std::size_t n, double* sums) noexcept {
        pass(Operation::dots, n, a == b ? 2 : 3);
        counted->dots(x, a, b, n, sums);
    };
    k.combine = [](const float* x, float a, const float* y, float* out, std::size_t n) noexcept {
        pass(Operation::combine, n, 3);
        counted->combine(x, a, y, out, n);
    };
    k.warmStart = [](float step, const StepFields& to, std::size_t n) noexcept {
        pass(Operation::warmStart, n, 4 + 5);
        counted->warmStart(step, to, n);
    };
    k.direct = [](const float* z, float beta, const float* last, float step, const StepFields& to, std::size_t n) noexcept {
        pass(Operation::direct, n, 3 + 2);
        counted->direct(z, beta, last, step, to, n);
    };
    k.keepStep = [](const KeptStep& step, const float* f, const StepFields& to, std::size_t n, double* sums) noexcept {
        pass(Operation::keepStep, n, 6 + 7);
        counted->keepStep(step, f, to, n, sums);
    };
    k.negate = [](const float* mask, const float* x, float* y, std::size_t count) noexcept {
        masked(Operation::negate, count, 1 + 3 + 6);
        return counted->negate(mask, x, y, count);
    };
    k.smoothFirst = [](float weight, const float* diagonal, const float* r, float* z, std::size_t count) noexcept {
        masked(Operation::smoothFirst, count, 1 + 3 + 3);
        counted->smoothFirst(weight, diagonal, r, z, count);
    };
    k.smooth = [](float weight, const float* diagonal, const float* r, const float* q, float* z,
                  std::size_t count) noexcept {
        masked(Operation::smooth, count, 1 + 6 + 6);
        counted->smooth(weight, diagonal, r, q, z, count);
    };
    k.chebyshev = [](float shrink, float weight, const Defect& by, float* f, float* z) noexcept {
        masked(Operation::chebyshev, by.count, 1 + 6 + 12);
        counted->chebyshev(shrink, weight, by, f, z);
    };
    k.blend = [](const float* border, const float* x, float* y, std::size_t count) noexcept {
        masked(Operation::blend, count, 1 + 3 + 6);
        counted->blend(border, x, y, count);
    };
    k.addMasked = [](const float* mask, const float* x, float* y, std::size_t count) noexcept {
        masked(Operation::addMasked, count, 1 + 3 + 6);
        counted->addMasked(mask, x, y, count);
    };
}

void countTransfers(Kernels& k) noexcept
{
    k.average = [](const float* a, const float* b, float* out, std::size_t n) noexcept {
        pass(Operation::average, n, 3);
        counted->average(a, b, out, n);
    };
    k.hat = [](const float* a, const float* b, const float* c, float* out, std::size_t n) noexcept {
        pass(Operation::hat, n, 4);
        counted->hat(a, b, c, out, n);
    };
    k.spread = [](const float* from, int nodes, float* to) noexcept {
        add(Operation::spread, nodes / 3.0, 1.5 * nodes);
        counted->spread(from, nodes, to);
    };
    k.gatherAdd = [](const float* from, int nodes, float* to) noexcept {
        add(Operation::gatherAdd, nodes / 3.0, 2.0 * nodes);
        counted->gatherAdd(from, nodes, to);
    };
}

const Kernels& countingKernels() noexcept
{
    static const Kernels counting = [] {
        Kernels k = kernels();
        countOperators(k);
        countPasses(k);
        countTransfers(k);
        return k;
    }();
    return counting;
}

}  // namespace

CountedKernels::CountedKernels() noexcept
{
    tallies = {};
    counted = &chainmail::kernels();
}

const Kernels& CountedKernels::kernels() const noexcept
{
    return countingKernels();
}

std::vector<KernelWork> CountedKernels::work(double parts) const
{
    std::vector<KernelWork> all;
    for (std::size_t i = 0; i < operations; ++i) {
        const Tally& t = tallies[i];
        const auto operation = static_cast<Operation>(i);
        if (t.calls <= 0.0) {
            continue;
        }
        const bool isOperator = operation <= Operation::applyFinite;
        const OperatorCost cell = isOperator ? operatorCost(operation == Operation::applyFinite) : OperatorCost{};
        const double nodes = t.nodes / parts;
        all.push_back({meanings[i].name, meanings[i].purpose, t.calls / parts, nodes, nodes * cell.additions,
                       nodes * cell.multiplications, static_cast<double>(sizeof(float)) * t.floats / parts});
    }
    return all;
}

double minTime(std::span<const KernelWork> work, const MachineRates& rates) noexcept
{
    double sum = 0;
    for (const KernelWork& w : work) {
        sum += minTime(OperatorCost{w.additions, w.multiplications, w.bytes}, rates);
    }
    return sum;
}

}  // namespace palpate::studies
