#define PALPATE_LANES 16
#include <chainmail/kernels_body.h>

#include <chainmail/kernels_sets.h>

namespace palpate::chainmail {

const Kernels kernelsAvx512 = table("AVX-512");

}  // namespace palpate::chainmail
