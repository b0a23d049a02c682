#include "elastic_cells.h"

#include <gtest/gtest.h>

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
        expectSameBits(randomCells(size, random), [](const Kernels& k, Cells& c) {
            k.applyFinite(c.layout, c.stiffness(), 1.0F, c.u.data(), c.out.data(), c.scratch.data());
        });
    }
}

// The energy decides whether a step is halved: another set's must not decide otherwise.
TEST(ElasticSets, ApplyFiniteGivesTheSameEnergy)
{
    std::minstd_rand random(3);
    for (const Index3 size : sizes()) {
        Cells c = randomCells(size, random);
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

// The four fields of a step, each in turn as the one looked at; p may be d itself, and q may be e.
TEST(ElasticSets, AdvanceMovesFourFieldsElementByElement)
{
    Entry e;
    const std::size_t n = 3 * Entry::count;
    const float step = 0.37F;
    const float keep = -0.8F;
    for (int looked = 0; looked < 4; ++looked) {
        e.expect(
            [&](const Kernels& k, float* y) {
                std::array<Floats, 4> own;
                StepFields to;
                const std::array<float**, 4> slots{&to.u, &to.a, &to.d, &to.e};
                for (std::size_t f = 0; f < 4; ++f) {
                    own[f] = Floats(n);
                    *slots[f] = static_cast<int>(f) == looked ? y : own[f].data();
                }
                k.advance(step, e.a(), e.b(), keep, to, n);
            },
            [&](std::size_t i, float y) {
                const float by = step * (looked % 2 == 0 ? e.a()[i] : e.b()[i]);
                return (looked < 2 ? y : keep * y) + by;
            });
    }
    e.expect(
        [&](const Kernels& k, float* y) {
            Floats u(n), a(n), last(e.b(), e.b() + n);
            k.advance(step, y, last.data(), keep, {u.data(), a.data(), y, last.data()}, n);
        },
        [&](std::size_t, float y) { return keep * y + step * y; });
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
    e.expect([&](const Kernels& k, float* y) { k.residual(e.mask(), e.a(), e.c(), y, n); },
             [&](std::size_t i, float) { return e.mask()[i % n] * (e.a()[i] - e.c()[i]); });
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
             [&](std::size_t i, float) { return e.mask()[i % n] * -e.a()[i]; });
}

}  // namespace
}  // namespace palpate::chainmail
