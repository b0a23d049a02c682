#pragma once

#include <chainmail/kernels.h>

#include <cstddef>

namespace palpate::studies {

/// Floats of working memory that plainApply() needs.
std::size_t plainScratch(const chainmail::Layout& layout) noexcept;

/// What Kernels::apply() does, as plain loops over cells that the compiler turns into AVX2 code by itself: no sums shared
/// between neighbouring cells, no rows kept in registers. The baseline of the benchmark. Needs a machine with AVX2.
void plainApply(const chainmail::Layout& layout, chainmail::CellStiffness stiffness, const float* u, float* out,
                float* scratch) noexcept;

}  // namespace palpate::studies
