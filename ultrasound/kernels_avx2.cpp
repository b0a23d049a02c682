#include <ultrasound/kernels_body.h>

#include <ultrasound/kernels_sets.h>

namespace palpate::ultrasound {

const Kernels kernelsAvx2 = table("AVX2");

}  // namespace palpate::ultrasound
