// Passes over fields and rows. Only kernels_body.h includes it.

#include <chainmail/kernels.h>

namespace palpate::chainmail {

namespace {

// A sum of products, in sixteen partial sums at any width that are flushed into doubles: every instruction set adds in the
// same order.
class Products {
public:
    void add(int v, Lanes product) noexcept { part_[v] += product; }
    void flush() noexcept
    {
        for (Lanes& part : part_) {
            addLanes(sum_, part);
            part = Lanes{};
        }
    }
    double sum() const noexcept { return sum_; }

private:
    Lanes part_[Layout::lanes / W] = {};
    double sum_ = 0.0;
};

// Calls each(i, v) for the vectors of n floats, v of sixteen, and flush() now and then.
template <typename Each, typename Flush>
void inBlocks(std::size_t n, const Each& each, const Flush& flush) noexcept
{
    constexpr std::size_t block = 64 * Layout::lanes;
    for (std::size_t start = 0; start < n; start += block) {
        const std::size_t stop = start + block < n ? start + block : n;
        for (std::size_t i = start; i < stop; i += Layout::lanes) {
#pragma GCC unroll 4
            for (int v = 0; v < static_cast<int>(Layout::lanes) / W; ++v) {
                each(i + static_cast<std::size_t>(v * W), v);
            }
        }
        flush();
    }
}

void dots(const float* x, const float* a, const float* b, std::size_t n, double* sums) noexcept
{
    Products first;
    Products second;
    inBlocks(
        n,
        [&](std::size_t i, int v) {
            const Lanes common = load(x + i);
            first.add(v, common * load(a + i));
            second.add(v, common * load(b + i));
        },
        [&] {
            first.flush();
            second.flush();
        });
    sums[0] = first.sum();
    sums[1] = second.sum();
}

double alongSlope(const float* tissue, const float* r, const float* u, std::size_t step, std::size_t n) noexcept
{
    Products sum;
    inBlocks(
        n,
        [&](std::size_t i, int v) {
            const Lanes both = 0.5F * load(tissue + i) * load(tissue + i + step);
            sum.add(v, both * (load(r + i) + load(r + i + step)) * (load(u + i + step) - load(u + i)));
        },
        [&] { sum.flush(); });
    return sum.sum();
}

void combine(const float* x, float a, const float* y, float* out, std::size_t n) noexcept
{
    for (std::size_t i = 0; i < n; i += W) {
        store(out + i, load(x + i) + a * load(y + i));
    }
}

void warmStart(float step, const StepFields& to, std::size_t n) noexcept
{
    for (std::size_t i = 0; i < n; i += W) {
        const Lanes a = load(to.a + i) + step * load(to.e + i);
        store(to.u + i, load(to.u + i) + step * load(to.d + i));
        store(to.a + i, a);
        store(to.r + i, a);
    }
}

void smoothFirst(float weight, const float* diagonal, const float* r, float* z, std::size_t count) noexcept
{
    for (std::size_t c = 0; c < 3; ++c, r += count, z += count) {
        for (std::size_t i = 0; i < count; i += W) {
            store(z + i, weight * load(diagonal + i) * load(r + i));
        }
    }
}

void smooth(float weight, const float* diagonal, const float* r, const float* q, float* z, std::size_t count) noexcept
{
    for (std::size_t c = 0; c < 3; ++c, r += count, q += count, z += count) {
        for (std::size_t i = 0; i < count; i += W) {
            store(z + i, load(z + i) + weight * load(diagonal + i) * (load(r + i) - load(q + i)));
        }
    }
}

// f = shrink f + weight * diagonal (r - q),  z += f
void chebyshev(float shrink, float weight, const Defect& by, float* f, float* z) noexcept
{
    for (std::size_t c = 0; c < 3 * by.count; c += by.count) {
        for (std::size_t i = 0; i < by.count; i += W) {
            const Lanes off = load(by.r + c + i) - load(by.q + c + i);
            const Lanes next = shrink * load(f + c + i) + weight * load(by.diagonal + i) * off;
            store(f + c + i, next);
            store(z + c + i, load(z + c + i) + next);
        }
    }
}

void addMasked(const float* m, const float* x, float* y, std::size_t count) noexcept
{
    for (std::size_t c = 0; c < 3; ++c, x += count, y += count) {
        for (std::size_t i = 0; i < count; i += W) {
            store(y + i, load(y + i) + load(m + i) * load(x + i));
        }
    }
}

double negate(const float* m, const float* x, float* y, std::size_t count) noexcept
{
    Products product;
    for (std::size_t c = 0; c < 3; ++c, x += count, y += count) {
        inBlocks(
            count,
            [&](std::size_t i, int v) {
                const Lanes force = load(m + i) * -load(y + i);
                store(y + i, force);
                product.add(v, load(x + i) * force);
            },
            [&] { product.flush(); });
    }
    return product.sum();
}

void direct(const float* z, float beta, const float* last, float step, const StepFields& to, std::size_t n) noexcept
{
    for (std::size_t i = 0; i < n; i += W) {
        const Lanes p = load(z + i) + beta * load(last + i);
        store(to.p + i, p);
        store(to.u + i, load(to.u + i) + step * p);
    }
}

void keepStep(const KeptStep& step, const float* f, const StepFields& to, std::size_t n, double* sums) noexcept
{
    Products work;
    Products slope;
    Products curvature;
    inBlocks(
        n,
        [&](std::size_t i, int v) {
            const Lanes p = load(to.p + i);
            const Lanes change = step.fraction * (load(f + i) - step.base * load(to.a + i));
            const Lanes u = load(to.u + i) + step.further * p;
            const Lanes a = load(to.a + i) + change;
            const Lanes d = step.keep * load(to.d + i) + step.length * p;
            const Lanes e = step.keep * load(to.e + i) + change;
            store(to.u + i, u);
            store(to.a + i, a);
            store(to.q + i, change);
            store(to.d + i, d);
            store(to.e + i, e);
            work.add(v, a * u);
            slope.add(v, a * d);
            curvature.add(v, e * d);
        },
        [&] {
            work.flush();
            slope.flush();
            curvature.flush();
        });
    sums[0] = work.sum();
    sums[1] = slope.sum();
    sums[2] = curvature.sum();
}

void average(const float* a, const float* b, float* out, std::size_t n) noexcept
{
    for (std::size_t i = 0; i < n; i += W) {
        store(out + i, 0.5F * (load(a + i) + load(b + i)));
    }
}

void hat(const float* a, const float* b, const float* c, float* out, std::size_t n) noexcept
{
    for (std::size_t i = 0; i < n; i += W) {
        store(out + i, load(b + i) + 0.5F * (load(a + i) + load(c + i)));
    }
}

void spread(const float* from, int nodes, float* to) noexcept
{
    for (int i = 0; i < nodes; i += W) {
        Half a;
        Half b;
        std::memcpy(&a, from + i / 2, sizeof a);
        std::memcpy(&b, from + i / 2 + 1, sizeof b);
        b = 0.5F * (a + b);
#if PALPATE_LANES == 4
        store(to + i, __builtin_shufflevector(a, b, 0, 2, 1, 3));
#elif PALPATE_LANES == 8
        store(to + i, __builtin_shufflevector(a, b, 0, 4, 1, 5, 2, 6, 3, 7));
#else
        store(to + i, __builtin_shufflevector(a, b, 0, 8, 1, 9, 2, 10, 3, 11, 4, 12, 5, 13, 6, 14, 7, 15));
#endif
    }
    std::memset(to + nodes, 0, static_cast<std::size_t>((W - nodes % W) % W) * sizeof(float));
}

void gatherAdd(const float* from, int nodes, float* to) noexcept
{
    for (int i = 0; i < nodes; i += W) {
        const Lanes sum = load(from + i) + 0.5F * (load(from + i - 1) + load(from + i + 1));
        Half coarse;
        std::memcpy(&coarse, to + i / 2, sizeof coarse);
#if PALPATE_LANES == 4
        coarse += __builtin_shufflevector(sum, sum, 0, 2);
#elif PALPATE_LANES == 8
        coarse += __builtin_shufflevector(sum, sum, 0, 2, 4, 6);
#else
        coarse += __builtin_shufflevector(sum, sum, 0, 2, 4, 6, 8, 10, 12, 14);
#endif
        std::memcpy(to + i / 2, &coarse, sizeof coarse);
    }
}

void blend(const float* border, const float* x, float* y, std::size_t count) noexcept
{
    for (std::size_t c = 0; c < 3; ++c, x += count, y += count) {
        for (std::size_t i = 0; i < count; i += W) {
            const Lanes old = load(y + i);
            store(y + i, old + load(border + i) * (load(x + i) - old));
        }
    }
}

}  // namespace

}  // namespace palpate::chainmail
