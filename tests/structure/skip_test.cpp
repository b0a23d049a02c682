#include <gtest/gtest.h>

#include <cstdlib>

namespace palpate {
namespace {

// A program for skips_test.py, which asks it to skip.
TEST(Skip, OnlyWhenAsked)
{
    if (const char* reason = std::getenv("PALPATE_SKIP_REASON"); reason != nullptr) {
        GTEST_SKIP() << reason;
    }
}

// Its neighbour in the suite.
TEST(Skip, FailsWhenAsked)
{
    EXPECT_EQ(std::getenv("PALPATE_FAIL"), nullptr);
}

}  // namespace
}  // namespace palpate
