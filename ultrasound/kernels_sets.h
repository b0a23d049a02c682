#pragma once

#include <ultrasound/kernels.h>

namespace palpate::ultrasound {

extern const Kernels kernelsV2;
extern const Kernels kernelsAvx2;

}  // namespace palpate::ultrasound
