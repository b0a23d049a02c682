#include <tests/channel/allocations.h>

#include <cstdlib>
#include <new>

namespace {
thread_local std::size_t count = 0;
}

std::size_t palpate::channel::allocations() noexcept
{
    return count;
}

void* operator new(std::size_t bytes)
{
    ++count;
    if (void* p = std::malloc(bytes))
        return p;
    throw std::bad_alloc();
}
void operator delete(void* p) noexcept
{
    std::free(p);
}
void operator delete(void* p, std::size_t) noexcept
{
    std::free(p);
}
