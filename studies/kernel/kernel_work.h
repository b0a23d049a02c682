#pragma once

#include <chainmail/kernels.h>
#include <studies/kernel/machine_rates.h>

#include <span>
#include <vector>

namespace palpate::studies {

/// What one operation of chainmail::Kernels had to do.
struct KernelWork {
    const char* operation = "";  // as in chainmail::Kernels
    const char* purpose = "";    // what a call of the solver needs it for
    double calls = 0;
    double nodes = 0;            // slots of the windows that it went over, rows filled up to whole vectors
    double additions = 0;        // of operators: the formulas' own; passes over vectors are bound by their bytes
    double multiplications = 0;  // as above
    double bytes = 0;            // read and written
};

/// The widest set of this machine, and a count of what it is asked to do. Only one may be alive at a time, and what it
/// counts is for one thread. Counting takes some nanoseconds per call: not for timings.
class CountedKernels {
public:
    CountedKernels() noexcept;
    CountedKernels& operator=(CountedKernels&&) = delete;

    /// The operations that count: the same results, to the bit.
    const chainmail::Kernels& kernels() const noexcept;
    /// Since this was made, each divided by `parts`; those that were never called are left out.
    std::vector<KernelWork> work(double parts) const;
};

/// The least time for the work [s]: of each operation its additions, multiplications and both together at the machine's
/// rates, or its bytes at that of a copy in the second-level cache, whichever takes longer.
double minTime(std::span<const KernelWork> work, const MachineRates& rates) noexcept;

}  // namespace palpate::studies
