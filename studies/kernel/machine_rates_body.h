// Included by one source per instruction set, which defines PALPATE_LANES. Nothing here has external linkage, so that no
// vector code leaks into programs on lesser machines.

#include <studies/kernel/machine_rates.h>

#include <cstring>
#include <utility>

namespace palpate::studies {

namespace {

constexpr int W = PALPATE_LANES;
constexpr std::size_t chains =
    12;  // independent of each other: more than latency times units of any machine, fewer than registers
using Lanes = float __attribute__((vector_size(4 * W)));

// Keeps the compiler from knowing the value.
inline void hide(Lanes& v) noexcept
{
    asm volatile("" : "+x"(v));
}

// The first `Additions` chains add, the others multiply.
template <std::size_t Additions, std::size_t... Chain>
double arithmeticOf(int rounds, std::index_sequence<Chain...>) noexcept
{
    Lanes one = Lanes{} + 1.0F;
    hide(one);
    // The compiler must not see that the chains are alike.
    Lanes value[] = {(static_cast<void>(Chain), one)...};
    (hide(value[Chain]), ...);
    for (int i = 0; i < rounds; ++i) {
        ((value[Chain] = Chain < Additions ? value[Chain] + one : value[Chain] * one), ...);
    }
    (hide(value[Chain]), ...);
    return static_cast<double>(rounds) * sizeof...(Chain) * W;
}

template <std::size_t Additions>
double arithmetic(int rounds) noexcept
{
    return arithmeticOf<Additions>(rounds, std::make_index_sequence<chains>());
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

}  // namespace palpate::studies
