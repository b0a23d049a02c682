#pragma once

#include <experiments/machine_rates.h>

namespace palpate::experiments {

extern const RateLoops ratesV2;
extern const RateLoops ratesAvx2;
extern const RateLoops ratesAvx512;

}  // namespace palpate::experiments
