#pragma once

#include <studies/kernel/machine_rates.h>

namespace palpate::studies {

extern const RateLoops ratesV2;
extern const RateLoops ratesAvx2;
extern const RateLoops ratesAvx512;

}  // namespace palpate::studies
