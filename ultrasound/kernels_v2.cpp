#include <ultrasound/kernels_body.h>

#include <ultrasound/kernels_sets.h>

namespace palpate::ultrasound {

const Kernels kernelsV2 = table("x86-64-v2");

}  // namespace palpate::ultrasound
