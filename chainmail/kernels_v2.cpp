#define PALPATE_LANES 4
#include <chainmail/kernels_body.h>

#include <chainmail/kernels_sets.h>

namespace palpate::chainmail {

const Kernels kernelsV2 = table("x86-64-v2");

}  // namespace palpate::chainmail
