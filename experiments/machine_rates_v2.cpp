#define PALPATE_LANES 4
#include <experiments/machine_rates_body.h>

#include <experiments/machine_rates_sets.h>

namespace palpate::experiments {

const RateLoops ratesV2 = table("x86-64-v2");

}  // namespace palpate::experiments
