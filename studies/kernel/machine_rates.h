#pragma once

#include <cstddef>

namespace palpate::studies {

/// What one core of this machine can do with one instruction set, measured with small loops that do nothing else.
struct MachineRates {
    double additions = 0;        // single precision, alone [1/s]
    double multiplications = 0;  // alone [1/s]
    double both = 0;             // as many of each, together [1/s]
    double bytes = 0;            // read and written, in a copy within the second-level cache [1/s]
};

/// Loops of one instruction set; each returns operations, or bytes.
struct RateLoops {
    const char* name;  // as Kernels::name
    double (*add)(int rounds) noexcept;
    double (*multiply)(int rounds) noexcept;
    double (*both)(int rounds) noexcept;
    double (*copy)(const float* from, float* to, std::size_t n) noexcept;
};

/// Best of a few tries for the instruction set called `name`, see chainmail::Kernels. Throws std::runtime_error for one
/// that is not known.
MachineRates machineRates(const char* name);

extern const RateLoops ratesV2;
extern const RateLoops ratesAvx2;
extern const RateLoops ratesAvx512;

}  // namespace palpate::studies
