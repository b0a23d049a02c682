#pragma once

#include <cstdint>

namespace palpate::tests {

/// Heap allocations of the calling thread so far. Link palpate_allocations: it replaces operator new and delete.
std::uint64_t allocations() noexcept;
/// And what it gave back to the heap; a null pointer does not count.
std::uint64_t frees() noexcept;

/// How often operator new is called while `work` runs.
template <typename Work>
std::uint64_t allocationsIn(Work&& work)
{
    const std::uint64_t before = allocations();
    work();
    return allocations() - before;
}

/// How often operator new and operator delete are called while `work` runs.
template <typename Work>
std::uint64_t heapCallsIn(Work&& work)
{
    const std::uint64_t before = allocations() + frees();
    work();
    return allocations() + frees() - before;
}

}  // namespace palpate::tests
