#pragma once

#include <cstddef>

namespace palpate::channel {

/// How often the calling thread has taken memory from the heap. operator new is replaced for this test program, in a source
/// file of its own because GCC warns of a mismatch where it can see both sides inlined.
std::size_t allocations() noexcept;

}  // namespace palpate::channel
