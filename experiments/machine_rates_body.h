// Included by one source per instruction set, which defines PALPATE_LANES. Nothing here has external linkage, so that no
// vector code leaks into programs on lesser machines.

#include <experiments/machine_rates.h>

#include <cstring>

namespace palpate::experiments {

namespace {

constexpr int W = PALPATE_LANES;
constexpr int chains = 12;  // independent of each other: more than latency times units of any machine, fewer than registers
using Lanes = float __attribute__((vector_size(4 * W)));

// Keeps the compiler from knowing the value.
inline void hide(Lanes& v) noexcept
{
    asm volatile("" : "+x"(v));
}

template <int Additions>
double arithmetic(int rounds) noexcept
{
    Lanes value[chains];
    Lanes one = Lanes{} + 1.0F;
    for (Lanes& v : value) {
        v = one;
    }
    hide(one);
    for (int i = 0; i < rounds; ++i) {
#pragma GCC unroll 12
        for (int c = 0; c < chains; ++c) {
            value[c] = c < Additions ? value[c] + one : value[c] * one;
            hide(value[c]);
        }
    }
    return static_cast<double>(rounds) * chains * W;
}

double copy(const float* from, float* to, std::size_t n) noexcept
{
    for (std::size_t i = 0; i < n; i += W) {
        Lanes v;
        std::memcpy(&v, from + i, sizeof v);
        hide(v);
        std::memcpy(to + i, &v, sizeof v);
    }
    return 2.0 * static_cast<double>(n * sizeof(float));
}

constexpr RateLoops table(const char* name) noexcept
{
    return {name, arithmetic<chains>, arithmetic<0>, arithmetic<chains / 2>, copy};
}

}  // namespace

}  // namespace palpate::experiments
