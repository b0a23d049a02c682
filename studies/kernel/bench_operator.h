#pragma once

#include <studies/kernel/machine_rates.h>

#include <string>
#include <vector>

namespace palpate::studies {

/// Instruction sets that level `elastic` is compiled for, narrowest first. Forces have the same bits in all.
struct KernelSets {
    std::vector<std::string> built;
    std::vector<std::string> runs;  // those that this machine has
};

KernelSets kernelSets();

/// What the operator has to do for one cell, counted from the formulas of chainmail/kernels.h as they are factored there.
struct OperatorCost {
    double additions = 0;
    double multiplications = 0;
    double bytes = 0;  // that have to be read and written: displacement, two moduli, result
};
OperatorCost operatorCost(bool finiteStrain) noexcept;

/// One timing of the operator on one window.
struct OperatorCase {
    std::string set;  // instruction set
    bool finiteStrain = false;
    int window = 0;             // nodes along each side
    double secondsPerNode = 0;  // measured
    double boundPerNode = 0;    // seconds that the machine needs at least
    bool boundByMemory = false;

    double boundFraction() const noexcept { return secondsPerNode > 0.0 ? boundPerNode / secondsPerNode : 0.0; }
};

/// The least time for a node [s]: additions, multiplications and both together at the machine's rates, or the bytes at that
/// of its second-level cache, whichever takes longer.
double minTime(const OperatorCost& cost, const MachineRates& rates) noexcept;

struct OperatorBench {
    struct Set {
        std::string name;
        MachineRates rates;
    };
    std::vector<Set> sets;            // narrowest first
    std::vector<OperatorCase> cases;  // the widest set's come last
};

/// Times every instruction set that this machine has on cubes of these nodes along each side.
OperatorBench benchOperator(const std::vector<int>& windows);

/// The case of this set, window and strain. Throws std::out_of_range.
const OperatorCase& caseOf(const OperatorBench& bench, const std::string& set, bool finiteStrain, int window);

}  // namespace palpate::studies
