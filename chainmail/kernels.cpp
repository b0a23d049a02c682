#include <chainmail/kernels.h>

#include <chainmail/kernels_sets.h>

namespace palpate::chainmail {

namespace {

struct Sets {
    std::array<const Kernels*, 3> list{};
    std::size_t count = 0;

    Sets() noexcept
    {
        list[count++] = &kernelsV2;
        if (__builtin_cpu_supports("avx2")) {
            list[count++] = &kernelsAvx2;
        }
        if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl")) {
            list[count++] = &kernelsAvx512;
        }
    }
};

}  // namespace

Layout Layout::of(int nx, int ny, int nz) noexcept
{
    Layout l;
    l.nx = nx;
    l.ny = ny;
    l.nz = nz;
    l.row = (static_cast<std::size_t>(nx) + lanes - 1) / lanes * lanes;
    l.plane = l.row * static_cast<std::size_t>(ny);
    l.count = l.plane * static_cast<std::size_t>(nz);
    return l;
}

std::span<const Kernels* const> supportedKernels() noexcept
{
    static const Sets sets;
    return {sets.list.data(), sets.count};
}

const Kernels& kernels() noexcept
{
    return *supportedKernels().back();
}

}  // namespace palpate::chainmail
