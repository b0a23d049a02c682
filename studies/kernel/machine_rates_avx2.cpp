#define PALPATE_LANES 8
#include <studies/kernel/machine_rates_body.h>

#include <studies/kernel/machine_rates.h>

namespace palpate::studies {

const RateLoops ratesAvx2 = table("AVX2");

}  // namespace palpate::studies
