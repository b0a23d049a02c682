#define PALPATE_LANES 4
#include <studies/kernel/machine_rates_body.h>

#include <studies/kernel/machine_rates.h>

namespace palpate::studies {

const RateLoops ratesV2 = table("x86-64-v2");

}  // namespace palpate::studies
