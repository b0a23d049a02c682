#include "elastic_cells.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <vector>

namespace palpate::chainmail {
namespace {

using tests::Cells;

Floats randomFloats(std::size_t n, std::minstd_rand& random)
{
    std::uniform_real_distribution<float> value(-1.0F, 1.0F);
    Floats out(n + Layout::lanes, 0.0F);
    for (std::size_t i = 0; i < n; ++i) {
        out[i] = value(random);
    }
    return out;
}

bool sameBits(const Floats& a, const Floats& b, std::size_t n)
{
    return std::memcmp(a.data(), b.data(), n * sizeof(float)) == 0;
}

std::vector<Index3> sizes()
{
    return {{2, 2, 2}, {3, 5, 4}, {15, 15, 15}, {16, 3, 2}, {17, 9, 6}, {33, 4, 7}, {48, 2, 3}, {50, 6, 5}};
}

// Runs `work` with every instruction set on the same cells, and compares what it leaves in `out` with the narrowest's.
template <typename Work>
void expectSameBits(const Cells& cells, const Work& work)
{
    Cells first = cells;
    work(*supportedKernels().front(), first);
    for (const Kernels* k : supportedKernels()) {
        Cells other = cells;
        work(*k, other);
        EXPECT_TRUE(sameBits(first.out, other.out, 3 * cells.layout.count)) << k->name << " " << cells.layout.nx;
    }
}

Cells randomCells(Index3 size, std::minstd_rand& random)
{
    Cells cells(size);
    cells.fillRandom(random);
    cells.moveRandom(0.4, random);
    return cells;
}

TEST(ElasticSets, ApplyGivesTheSameBits)
{
    std::minstd_rand random(1);
    for (const Index3 size : sizes()) {
        expectSameBits(randomCells(size, random), [](const Kernels& k, Cells& c) {
            k.apply(c.layout, c.stiffness(), c.u.data(), c.out.data(), c.scratch.data());
        });
    }
}

TEST(ElasticSets, ApplyFiniteGivesTheSameForces)
{
    std::minstd_rand random(2);
    for (const Index3 size : sizes()) {
        Cells cells = randomCells(size, random);
        cells.relief = 0.5F * static_cast<float>(size.x % 3);
        expectSameBits(cells, [](const Kernels& k, Cells& c) {
            k.applyFinite(c.layout, c.stiffness(), 1.0F, c.u.data(), c.out.data(), c.scratch.data());
        });
    }
}

// In one sweep what apply() and a pass over its answer do, to the bit.
TEST(ElasticSets, SweepsThatEndInAPassAreApplyAndThePass)
{
    std::minstd_rand random(5);
    for (const Index3 size : sizes()) {
        const Cells cells = randomCells(size, random);
        const Layout& l = cells.layout;
        const std::size_t n = l.count;
        const Floats r = randomFloats(3 * n, random);
        const Floats diagonal = randomFloats(n, random);
        for (const Kernels* k : supportedKernels()) {
            Cells c = cells;
            k->apply(l, c.stiffness(), c.u.data(), c.out.data(), c.scratch.data());
            Floats residual(l.fieldSize()), smoothed = c.u, out(l.fieldSize());
            k->residualOf(l, c.stiffness(), diagonal.data(), r.data(), c.u.data(), residual.data(), c.scratch.data());
            const Smoother smoother{0.4F, diagonal.data(), r.data()};
            k->smoothOf(l, c.stiffness(), smoother, smoothed.data(), out.data(), c.scratch.data());
            EXPECT_TRUE(sameBits(out, c.out, 3 * n)) << k->name;
            for (std::size_t i = 0; i < 3 * n; ++i) {
                const float off = r[i] - c.out[i];
                ASSERT_EQ(residual[i], diagonal[i % n] * off) << k->name << " " << i;
                ASSERT_EQ(smoothed[i], c.u[i] + 0.4F * diagonal[i % n] * off) << k->name << " " << i;
            }
        }
    }
}

// A row of the coarse window is spread by linear interpolation, and gathered by the transpose.
void expectRows(const Kernels& k, int nodes, const Floats& coarse, const float* row)
{
    Floats spread(64, 9.0F);
    k.spread(coarse.data(), nodes, spread.data());
    Floats gathered = coarse;
    k.gatherAdd(row, nodes, gathered.data());
    const auto count = static_cast<std::size_t>(nodes);
    for (std::size_t i = 0; i < count; i += 2) {
        EXPECT_EQ(spread[i], coarse[i / 2]) << k.name;
        EXPECT_EQ(gathered[i / 2], coarse[i / 2] + (row[i] + 0.5F * (row[static_cast<int>(i) - 1] + row[i + 1]))) << k.name;
    }
    for (std::size_t i = 1; i < count; i += 2) {
        EXPECT_EQ(spread[i], 0.5F * (coarse[i / 2] + coarse[i / 2 + 1])) << k.name;
    }
    EXPECT_EQ(gathered[count / 2 + 1], coarse[count / 2 + 1]) << k.name;
}

TEST(ElasticSets, RowsAreSpreadAndGathered)
{
    std::minstd_rand random(6);
    for (int nodes = 3; nodes <= 47; nodes += 2) {
        const Floats coarse = randomFloats(64, random);
        Floats fine = randomFloats(80, random);
        float* row = fine.data() + Layout::lanes;
        row[-1] = 0.0F;
        std::fill(row + nodes, fine.data() + fine.size(), 0.0F);
        for (const Kernels* k : supportedKernels()) {
            expectRows(*k, nodes, coarse, row);
        }
    }
}

// The energy decides whether a step is halved: another set's must not decide otherwise.
TEST(ElasticSets, ApplyFiniteGivesTheSameEnergy)
{
    std::minstd_rand random(3);
    for (const Index3 size : sizes()) {
        Cells c = randomCells(size, random);
        c.relief = 0.5F * static_cast<float>(size.x % 3);
        const auto energy = [&](const Kernels& k) {
            return k.applyFinite(c.layout, c.stiffness(), 1.0F, c.u.data(), c.out.data(), c.scratch.data());
        };
        const double first = energy(*supportedKernels().front());
        for (const Kernels* k : supportedKernels()) {
            EXPECT_EQ(energy(*k), first) << k->name << " " << size.x;
        }
    }
}

// Two sums at a time, each to the rounding of products in single precision.
TEST(ElasticSets, DotsGiveTheSameBits)
{
    std::minstd_rand random(4);
    for (std::size_t n = Layout::lanes; n < 20000; n = 3 * n + Layout::lanes) {
        const Floats x = randomFloats(n, random);
        const std::array both{randomFloats(n, random), randomFloats(n, random)};
        const auto dots = [&](const Kernels& k) {
            std::array<double, 2> sums{};
            k.dots(x.data(), both[0].data(), both[1].data(), n, sums.data());
            return sums;
        };
        const auto first = dots(*supportedKernels().front());
        for (std::size_t s = 0; s < 2; ++s) {
            double sum = 0.0;
            for (std::size_t i = 0; i < n; ++i) {
                sum += static_cast<double>(x[i]) * static_cast<double>(both[s][i]);
            }
            EXPECT_NEAR(first[s], sum, 1e-6 * static_cast<double>(n));
        }
        for (const Kernels* k : supportedKernels()) {
            EXPECT_EQ(dots(*k), first) << k->name;
        }
    }
}

// Sums of floats of one size are exact in doubles, in any order; of lanes from 2^-32 to 2^28 they are not.
TEST(ElasticSets, DotsOfSmallAndLargeNumbersGiveTheSameBits)
{
    std::minstd_rand random(3);
    constexpr std::size_t n = 8 * Layout::lanes;
    Floats x = randomFloats(n, random);
    const Floats ones(n + Layout::lanes, 1.0F);
    for (std::size_t i = 0; i < n; ++i) {
        x[i] = std::ldexp(x[i], 4 * static_cast<int>(7 * i % Layout::lanes) - 32);
    }
    const auto dots = [&](const Kernels& k) {
        std::array<double, 2> sums{};
        k.dots(x.data(), ones.data(), x.data(), n, sums.data());
        return sums;
    };
    for (const Kernels* k : supportedKernels()) {
        EXPECT_EQ(dots(*k), dots(*supportedKernels().front())) << k->name;
    }
}

// Only where both nodes have tissue.
TEST(ElasticSets, SlopesGiveTheSameBits)
{
    std::minstd_rand random(6);
    for (std::size_t n = Layout::lanes; n < 5000; n = 3 * n + Layout::lanes) {
        for (const std::size_t step : {std::size_t{1}, 3 * Layout::lanes}) {
            const Floats r = randomFloats(n + step, random), u = randomFloats(n + step, random);
            Floats tissue = randomFloats(n + step, random);
            std::ranges::transform(tissue, tissue.begin(), [](float t) { return t > -0.5F ? 1.0F : 0.0F; });
            double sum = 0.0;
            for (std::size_t i = 0; i < n; ++i) {
                sum +=
                    static_cast<double>(0.5F * tissue[i] * tissue[i + step] * (r[i] + r[i + step]) * (u[i + step] - u[i]));
            }
            const auto slope = [&](const Kernels& k) { return k.alongSlope(tissue.data(), r.data(), u.data(), step, n); };
            const double first = slope(*supportedKernels().front());
            EXPECT_NEAR(first, sum, 1e-6 * static_cast<double>(n));
            for (const Kernels* k : supportedKernels()) {
                EXPECT_EQ(slope(*k), first) << k->name;
            }
        }
    }
}

// Runs one entry of the table on random vectors with every set, and against plain arithmetic, element by element.
class Entry {
public:
    static constexpr std::size_t count = 16 * 37;

    Entry() : random_(5)
    {
        for (Floats* f : {&a_, &b_, &c_, &y_, &mask_}) {
            *f = randomFloats(3 * count, random_);
        }
        for (float& m : mask_) {
            m = m > 0.0F ? 1.0F : 0.0F;
        }
    }

    template <typename Run, typename Plain>
    void expect(const Run& run, const Plain& plain)
    {
        for (const Kernels* k : supportedKernels()) {
            Floats y = y_;
            run(*k, y.data());
            for (std::size_t i = 0; i < 3 * count; ++i) {
                ASSERT_EQ(y[i], plain(i, y_[i])) << k->name << " " << i;
            }
        }
    }

    const float* a() const { return a_.data(); }
    const float* b() const { return b_.data(); }
    const float* c() const { return c_.data(); }
    const float* mask() const { return mask_.data(); }

private:
    std::minstd_rand random_;
    Floats a_, b_, c_, y_, mask_;
};

TEST(ElasticSets, VectorSumsAreElementByElement)
{
    Entry e;
    const std::size_t n = 3 * Entry::count;
    const float s = 0.37F;
    e.expect([&](const Kernels& k, float* y) { k.combine(e.a(), s, y, y, n); },
             [&](std::size_t i, float y) { return e.a()[i] + s * y; });
    e.expect([&](const Kernels& k, float* y) { k.combine(y, s, e.a(), y, n); },
             [&](std::size_t i, float y) { return y + s * e.a()[i]; });
    e.expect([&](const Kernels& k, float* y) { k.average(e.a(), e.b(), y, n); },
             [&](std::size_t i, float) { return 0.5F * (e.a()[i] + e.b()[i]); });
    e.expect([&](const Kernels& k, float* y) { k.hat(e.a(), e.b(), e.c(), y, n); },
             [&](std::size_t i, float) { return e.b()[i] + 0.5F * (e.a()[i] + e.c()[i]); });
}

// The fields of a step, a value of its own in each.
struct StepOf {
    explicit StepOf(const Entry& e)
    {
        for (std::size_t f = 0; f < own.size(); ++f) {
            const std::array<const float*, 3> from{e.a(), e.b(), e.c()};
            own[f] = Floats(from[f % 3], from[f % 3] + 3 * Entry::count);
        }
    }
    StepFields fields(int looked, float* y)
    {
        StepFields to;
        const std::array<float**, 7> slots{&to.u, &to.a, &to.d, &to.e, &to.p, &to.q, &to.r};
        for (std::size_t f = 0; f < slots.size(); ++f) {
            *slots[f] = static_cast<int>(f) == looked ? y : own[f].data();
        }
        return to;
    }
    std::array<Floats, 7> own;
};

TEST(ElasticSets, GoingOnMovesItsFieldsElementByElement)
{
    Entry e;
    const std::size_t n = 3 * Entry::count;
    const float step = 0.37F;
    const StepOf was(e);
    const auto of = [&](int f, std::size_t i, int looked, float y) {
        return f == looked ? y : was.own[static_cast<std::size_t>(f)][i];
    };
    for (int looked = 0; looked < 7; ++looked) {
        e.expect([&](const Kernels& k, float* y) { k.warmStart(step, StepOf(e).fields(looked, y), n); },
                 [&](std::size_t i, float y) {
                     const float force = of(1, i, looked, y) + step * of(3, i, looked, y);
                     const std::array<float, 7> now{
                         of(0, i, looked, y) + step * of(2, i, looked, y), force, y, y, y, y, force};
                     return now[static_cast<std::size_t>(looked)];
                 });
    }
}

TEST(ElasticSets, AStepIsDirectedAndKeptElementByElement)
{
    Entry e;
    const std::size_t n = 3 * Entry::count;
    const StepOf was(e);
    const KeptStep step{.fraction = 0.9F, .base = 0.8F, .further = -0.2F, .length = 1.3F, .keep = 0.7F};
    const float* f = e.b();
    for (int looked = 0; looked < 7; ++looked) {
        const auto of = [&](int field, std::size_t i, float y) {
            return field == looked ? y : was.own[static_cast<std::size_t>(field)][i];
        };
        e.expect([&](const Kernels& k, float* y) { k.direct(e.c(), 0.3F, e.a(), 0.6F, StepOf(e).fields(looked, y), n); },
                 [&](std::size_t i, float y) {
                     const float p = e.c()[i] + 0.3F * e.a()[i];
                     return looked == 0 ? y + 0.6F * p : looked == 4 ? p : y;
                 });
        e.expect(
            [&](const Kernels& k, float* y) {
                std::array<double, 3> sums{};
                k.keepStep(step, f, StepOf(e).fields(looked, y), n, sums.data());
            },
            [&](std::size_t i, float y) {
                const float change = step.fraction * (f[i] - step.base * of(1, i, y));
                const std::array<float, 7> now{of(0, i, y) + step.further * of(4, i, y),
                                               of(1, i, y) + change,
                                               step.keep * of(2, i, y) + step.length * of(4, i, y),
                                               step.keep * of(3, i, y) + change,
                                               y,
                                               change,
                                               y};
                return now[static_cast<std::size_t>(looked)];
            });
    }
}

// Where the increment itself is the direction: taken again, d is the step; confirmed, it is what is kept of it.
TEST(ElasticSets, TheDirectionMayBeTheIncrement)
{
    Entry e;
    const std::size_t n = 3 * Entry::count;
    for (const auto& [length, keep] : {std::pair(1.3F, 0.0F), std::pair(0.0F, 0.7F)}) {
        const KeptStep step{.fraction = 1.0F, .base = 1.0F, .further = 0.1F, .length = length, .keep = keep};
        e.expect(
            [&](const Kernels& k, float* y) {
                StepOf own(e);
                StepFields to = own.fields(2, y);
                to.p = y;
                std::array<double, 3> sums{};
                k.keepStep(step, e.b(), to, n, sums.data());
            },
            [&](std::size_t, float y) { return keep * y + length * y; });
    }
}

// All sets give the same sums to the bit, and a plain loop about the same.
TEST(ElasticSets, SumsOfAStepAreThoseOfItsFields)
{
    Entry e;
    const std::size_t n = 3 * Entry::count;
    const KeptStep step{.fraction = 0.9F, .base = 0.8F, .further = -0.2F, .length = 1.3F, .keep = 0.7F};
    std::array<double, 3> first{};
    double negated = 0.0;
    for (const Kernels* k : supportedKernels()) {
        StepOf own(e);
        std::array<double, 3> sums{};
        const StepFields to = own.fields(-1, nullptr);
        k->keepStep(step, e.b(), to, n, sums.data());
        std::array<double, 3> plain{};
        for (std::size_t i = 0; i < n; ++i) {
            plain[0] += static_cast<double>(to.a[i]) * static_cast<double>(to.u[i]);
            plain[1] += static_cast<double>(to.a[i]) * static_cast<double>(to.d[i]);
            plain[2] += static_cast<double>(to.e[i]) * static_cast<double>(to.d[i]);
        }
        Floats y(e.b(), e.b() + n);
        const double product = k->negate(e.mask(), e.a(), y.data(), Entry::count);
        if (k == supportedKernels().front()) {
            first = sums;
            negated = product;
        }
        EXPECT_EQ(sums, first) << k->name;
        EXPECT_EQ(product, negated) << k->name;
        for (std::size_t i = 0; i < 3; ++i) {
            EXPECT_NEAR(sums[i], plain[i], 1e-4) << k->name;
        }
        double dot = 0.0;
        for (std::size_t i = 0; i < n; ++i) {
            dot += static_cast<double>(e.a()[i]) * static_cast<double>(y[i]);
        }
        EXPECT_NEAR(product, dot, 1e-4);
    }
}

TEST(ElasticSets, SmoothersAreElementByElement)
{
    Entry e;
    const std::size_t n = Entry::count;
    const float w = 0.41F;
    e.expect([&](const Kernels& k, float* y) { k.smoothFirst(w, e.b(), e.a(), y, n); },
             [&](std::size_t i, float) { return w * e.b()[i % n] * e.a()[i]; });
    e.expect([&](const Kernels& k, float* y) { k.smooth(w, e.b(), e.a(), e.c(), y, n); },
             [&](std::size_t i, float y) { return y + w * e.b()[i % n] * (e.a()[i] - e.c()[i]); });
    e.expect(
        [&](const Kernels& k, float* y) {
            Floats z(e.c(), e.c() + 3 * n);
            k.chebyshev(0.8F, w, {e.b(), e.a(), e.c(), n}, y, z.data());
        },
        [&](std::size_t i, float y) { return 0.8F * y + w * e.b()[i % n] * (e.a()[i] - e.c()[i]); });
    e.expect(
        [&](const Kernels& k, float* y) {
            Floats f(e.c(), e.c() + 3 * n);
            k.chebyshev(0.8F, w, {e.b(), e.a(), e.c(), n}, f.data(), y);
        },
        [&](std::size_t i, float y) { return y + (0.8F * e.c()[i] + w * e.b()[i % n] * (e.a()[i] - e.c()[i])); });
}

TEST(ElasticSets, MasksChooseNodeByNode)
{
    Entry e;
    const std::size_t n = Entry::count;
    e.expect([&](const Kernels& k, float* y) { k.blend(e.mask(), e.a(), y, n); },
             [&](std::size_t i, float y) { return y + e.mask()[i % n] * (e.a()[i] - y); });
    e.expect([&](const Kernels& k, float* y) { k.addMasked(e.mask(), e.a(), y, n); },
             [&](std::size_t i, float y) { return y + e.mask()[i % n] * e.a()[i]; });
    e.expect([&](const Kernels& k, float* y) { k.negate(e.mask(), e.a(), y, n); },
             [&](std::size_t i, float y) { return e.mask()[i % n] * -y; });
}

}  // namespace
}  // namespace palpate::chainmail
