// Vectors of PALPATE_LANES floats. Only kernels_body.h includes it.

#include <chainmail/kernels.h>

#include <cstring>

namespace palpate::chainmail {

namespace {

constexpr int W = PALPATE_LANES;
using Lanes = float __attribute__((vector_size(4 * W)));
using Half = float __attribute__((vector_size(2 * W)));

inline Lanes load(const float* p) noexcept
{
    Lanes v;
    std::memcpy(&v, p, sizeof v);
    return v;
}

inline void store(float* p, Lanes v) noexcept
{
    std::memcpy(p, &v, sizeof v);
}

// The lanes one to the left: the last of `before`, then all but the last of `v`.
inline Lanes shifted(Lanes before, Lanes v) noexcept
{
#if PALPATE_LANES == 4
    return __builtin_shufflevector(before, v, 3, 4, 5, 6);
#elif PALPATE_LANES == 8
    return __builtin_shufflevector(before, v, 7, 8, 9, 10, 11, 12, 13, 14);
#else
    return __builtin_shufflevector(before, v, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30);
#endif
}

// Lane by lane onto the sum, and not the lanes' own sum: that would group them by the vector's width.
void addLanes(double& sum, Lanes v) noexcept
{
    for (int i = 0; i < W; ++i) {
        sum += static_cast<double>(v[i]);
    }
}

}  // namespace

}  // namespace palpate::chainmail
