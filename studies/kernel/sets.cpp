#include <studies/kernel/sets.h>

#include <chainmail/kernels_sets.h>

namespace palpate::studies {

KernelSets kernelSets()
{
    using namespace chainmail;
    KernelSets sets{{kernelsV2.name, kernelsAvx2.name, kernelsAvx512.name}, {}};
    for (const Kernels* set : supportedKernels()) {
        sets.runs.emplace_back(set->name);
    }
    return sets;
}

}  // namespace palpate::studies
