#include "allocations.h"

#include <cstdlib>
#include <new>

namespace {

thread_local std::uint64_t allocated = 0;
thread_local std::uint64_t freed = 0;

void* take(std::size_t size) noexcept
{
    ++allocated;
    return std::malloc(size == 0 ? 1 : size);
}

// aligned_alloc() wants a multiple of the alignment.
void* takeAligned(std::size_t size, std::align_val_t alignment) noexcept
{
    ++allocated;
    const auto to = static_cast<std::size_t>(alignment);
    return std::aligned_alloc(to, (size == 0 ? to : size + to - 1) / to * to);
}

void* orThrow(void* p)
{
    if (p == nullptr) {
        throw std::bad_alloc();
    }
    return p;
}

void give(void* p) noexcept
{
    freed += p != nullptr ? 1 : 0;
    std::free(p);
}

}  // namespace

std::uint64_t palpate::tests::allocations() noexcept
{
    return allocated;
}

std::uint64_t palpate::tests::frees() noexcept
{
    return freed;
}

void* operator new(std::size_t size)
{
    return orThrow(take(size));
}

void* operator new(std::size_t size, const std::nothrow_t&) noexcept
{
    return take(size);
}

void* operator new(std::size_t size, std::align_val_t alignment)
{
    return orThrow(takeAligned(size, alignment));
}

void operator delete(void* p) noexcept
{
    give(p);
}

void operator delete(void* p, std::size_t) noexcept
{
    give(p);
}

void operator delete(void* p, std::align_val_t) noexcept
{
    give(p);
}

void operator delete(void* p, std::size_t, std::align_val_t) noexcept
{
    give(p);
}
