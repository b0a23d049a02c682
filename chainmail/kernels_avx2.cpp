#define PALPATE_LANES 8
#include <chainmail/kernels_body.h>

#include <chainmail/kernels_sets.h>

namespace palpate::chainmail {

const Kernels kernelsAvx2 = table("AVX2");

}  // namespace palpate::chainmail
