#include <ultrasound/kernels.h>

#include <ultrasound/kernels_sets.h>

#include <array>

namespace palpate::ultrasound {

std::span<const Kernels* const> supportedKernels() noexcept
{
    static const std::array<const Kernels*, 2> all{&kernelsV2, &kernelsAvx2};
    static const std::size_t count = __builtin_cpu_supports("avx2") != 0 ? 2 : 1;
    return std::span(all).first(count);
}

const Kernels& kernels() noexcept
{
    return *supportedKernels().back();
}

}  // namespace palpate::ultrasound
