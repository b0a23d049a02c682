#include <studies/kernel/kernel_work.h>

#include <base/folds.h>
#include <studies/kernel/bench_operator.h>

#include <algorithm>
#include <array>
#include <string_view>

namespace palpate::studies {

namespace {

using namespace chainmail;

constexpr std::size_t operations = 19;
constexpr std::size_t operators = 4;  // of them, the first ones

struct Meaning {
    std::string_view name;
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

// So many nodes, and so many floats of each, read and written.
void add(std::string_view operation, auto nodes, double perNode) noexcept
{
    const auto* const at = std::ranges::find(meanings, operation, &Meaning::name);
    Tally& t = tallies[static_cast<std::size_t>(at - meanings.begin())];
    t.calls += 1;
    t.nodes += static_cast<double>(nodes);
    t.floats += perNode * static_cast<double>(nodes);
}

// A pass over `n` floats of fields with three components, so many fields read and written.
void pass(std::string_view operation, auto n, double fields) noexcept
{
    add(operation, static_cast<double>(n) / 3, 3 * fields);
}

constexpr double operatorFloats = 8;  // displacement, two moduli, result

void countOperators(Kernels& k) noexcept
{
    k.apply = [](const Layout& l, CellStiffness s, const float* u, float* out, float* scratch) noexcept {
        add("apply", l.count, operatorFloats);
        counted->apply(l, s, u, out, scratch);
    };
    k.residualOf = [](const Layout& l, CellStiffness s, const float* open, const float* r, const float* u, float* out,
                      float* scratch) noexcept {
        add("residualOf", l.count, operatorFloats + 4);
        counted->residualOf(l, s, open, r, u, out, scratch);
    };
    k.smoothOf = [](const Layout& l, CellStiffness s, const Smoother& by, float* u, float* out, float* scratch) noexcept {
        add("smoothOf", l.count, operatorFloats + 7);
        counted->smoothOf(l, s, by, u, out, scratch);
    };
    k.applyFinite = [](const Layout& l, CellStiffness s, float inverse, const float* u, float* out,
                       float* scratch) noexcept {
        add("applyFinite", l.count, operatorFloats);
        return counted->applyFinite(l, s, inverse, u, out, scratch);
    };
}

void countPasses(Kernels& k) noexcept
{
    k.dots = [](const float* x, const float* a, const float* b, std::size_t n, double* sums) noexcept {
        pass("dots", n, a == b ? 2 : 3);
        counted->dots(x, a, b, n, sums);
    };
    k.combine = [](const float* x, float a, const float* y, float* out, std::size_t n) noexcept {
        pass("combine", n, 3);
        counted->combine(x, a, y, out, n);
    };
    k.warmStart = [](float step, const StepFields& to, std::size_t n) noexcept {
        pass("warmStart", n, 4 + 3);
        counted->warmStart(step, to, n);
    };
    k.direct = [](const float* z, float beta, const float* last, float step, const StepFields& to, std::size_t n) noexcept {
        pass("direct", n, 3 + 2);
        counted->direct(z, beta, last, step, to, n);
    };
    k.keepStep = [](const KeptStep& step, const float* f, const StepFields& to, std::size_t n, double* sums) noexcept {
        pass("keepStep", n, 6 + 5);
        counted->keepStep(step, f, to, n, sums);
    };
    k.negate = [](const float* mask, const float* x, float* y, std::size_t count) noexcept {
        add("negate", count, 1 + 3 + 6);
        return counted->negate(mask, x, y, count);
    };
    k.smoothFirst = [](float weight, const float* diagonal, const float* r, float* z, std::size_t count) noexcept {
        add("smoothFirst", count, 1 + 3 + 3);
        counted->smoothFirst(weight, diagonal, r, z, count);
    };
    k.smooth = [](float weight, const float* diagonal, const float* r, const float* q, float* z,
                  std::size_t count) noexcept {
        add("smooth", count, 1 + 6 + 6);
        counted->smooth(weight, diagonal, r, q, z, count);
    };
    k.chebyshev = [](float shrink, float weight, const Defect& by, float* f, float* z) noexcept {
        add("chebyshev", by.count, 1 + 6 + 12);
        counted->chebyshev(shrink, weight, by, f, z);
    };
    k.blend = [](const float* border, const float* x, float* y, std::size_t count) noexcept {
        add("blend", count, 1 + 3 + 6);
        counted->blend(border, x, y, count);
    };
    k.addMasked = [](const float* mask, const float* x, float* y, std::size_t count) noexcept {
        add("addMasked", count, 1 + 3 + 6);
        counted->addMasked(mask, x, y, count);
    };
}

void countTransfers(Kernels& k) noexcept
{
    k.average = [](const float* a, const float* b, float* out, std::size_t n) noexcept {
        pass("average", n, 3);
        counted->average(a, b, out, n);
    };
    k.hat = [](const float* a, const float* b, const float* c, float* out, std::size_t n) noexcept {
        pass("hat", n, 4);
        counted->hat(a, b, c, out, n);
    };
    k.spread = [](const float* from, int nodes, float* to) noexcept {
        pass("spread", nodes, 1.5);
        counted->spread(from, nodes, to);
    };
    k.gatherAdd = [](const float* from, int nodes, float* to) noexcept {
        pass("gatherAdd", nodes, 2.0);
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
        if (t.calls <= 0.0) {
            continue;
        }
        const OperatorCost cell = i < operators ? operatorCost(meanings[i].name == "applyFinite") : OperatorCost{};
        const double nodes = t.nodes / parts;
        all.push_back({meanings[i].name.data(), meanings[i].purpose, t.calls / parts, nodes, nodes * cell.additions,
                       nodes * cell.multiplications, static_cast<double>(sizeof(float)) * t.floats / parts});
    }
    return all;
}

double minTime(std::span<const KernelWork> work, const MachineRates& rates) noexcept
{
    return base::sumOf(work, [&](const KernelWork& w) {
        return minTime(OperatorCost{w.additions, w.multiplications, w.bytes}, rates);
    });
}

}  // namespace palpate::studies
