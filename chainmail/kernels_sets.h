#pragma once

#include <chainmail/kernels.h>

namespace palpate::chainmail {

extern const Kernels kernelsV2;
extern const Kernels kernelsAvx2;
extern const Kernels kernelsAvx512;

}  // namespace palpate::chainmail
