#define PALPATE_LANES 16
#include <studies/kernel/machine_rates_body.h>

#include <studies/kernel/machine_rates.h>

namespace palpate::studies {

const RateLoops ratesAvx512 = table("AVX-512");

}  // namespace palpate::studies
