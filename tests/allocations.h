#pragma once

#include <cstdint>

namespace palpate::tests {

/// Heap allocations of the calling thread so far. Link palpate_allocations: it replaces operator new.
std::uint64_t allocations() noexcept;

/// How often operator new is called while `work` runs.
template <typename Work>
std::uint64_t allocationsIn(Work&& work)
{
    const std::uint64_t before = allocations();
    work();
    return allocations() - before;
}

}  // namespace palpate::tests
