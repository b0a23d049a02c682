#define PALPATE_LANES 8
#include <experiments/machine_rates_body.h>

#include <experiments/machine_rates_sets.h>

namespace palpate::experiments {

const RateLoops ratesAvx2 = table("AVX2");

}  // namespace palpate::experiments
