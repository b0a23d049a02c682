#define PALPATE_LANES 16
#include <experiments/machine_rates_body.h>

#include <experiments/machine_rates_sets.h>

namespace palpate::experiments {

const RateLoops ratesAvx512 = table("AVX-512");

}  // namespace palpate::experiments
