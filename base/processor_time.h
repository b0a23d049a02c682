#pragma once

#include <ctime>

namespace palpate::base {

/// Time that the processor has spent on the calling thread [s]: what others do beside it does not count.
inline double processorTime() noexcept
{
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace palpate::base
