#pragma once

#include <string>
#include <vector>

namespace palpate::studies {

/// Instruction sets that level `elastic` is compiled for, narrowest first. Forces have the same bits in all.
struct KernelSets {
    std::vector<std::string> built;
    std::vector<std::string> runs;  // those that this machine has
};

KernelSets kernelSets();

}  // namespace palpate::studies
