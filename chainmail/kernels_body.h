// Included by one source per instruction set, which defines PALPATE_LANES. Nothing here has external linkage, so that no
// vector code leaks into programs on lesser machines.

#include <chainmail/kernels_lanes.h>
//
#include <chainmail/kernels_modes.h>
//
#include <chainmail/kernels_layers.h>
//
#include <chainmail/kernels_cuts.h>
//
#include <chainmail/kernels_cells.h>
#include <chainmail/kernels_passes.h>

namespace palpate::chainmail {

namespace {

constexpr Kernels table(const char* name) noexcept
{
    return {name,    W,         apply,   residualOf, smoothOf, applyFinite, dots,   alongSlope,
            combine, warmStart, direct,  keepStep,   negate,   smoothFirst, smooth, chebyshev,
            blend,   addMasked, average, hat,        spread,   gatherAdd};
}

}  // namespace

}  // namespace palpate::chainmail
