#include <base/memory.h>

#include <gtest/gtest.h>

#include <unistd.h>

namespace palpate::base {
namespace {

TEST(Memory, IsSomeOfTheMachines)
{
    const double all = static_cast<double>(::sysconf(_SC_PHYS_PAGES)) * static_cast<double>(::sysconf(_SC_PAGESIZE));
    EXPECT_GT(availableMemory(), 0.0);
    EXPECT_LT(availableMemory(), all);
}

}  // namespace
}  // namespace palpate::base
