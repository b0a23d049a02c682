#include <haptics/measures.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>

namespace palpate::haptics {
namespace {

// Compared with another session's, a needle that was never inside is not one that stayed far from every vessel.
TEST(Measures, WhatASessionCannotHaveIsNoNumber)
{
    const auto valueOf = [](const char* key, const Score& s) {
        const auto all = measures();
        return std::ranges::find(all, std::string_view(key), &Measure::key)->value(s);
    };
    Score s;
    s.vitalMargin = std::numeric_limits<double>::infinity();
    s.markError = std::numeric_limits<double>::infinity();
    EXPECT_TRUE(std::isnan(valueOf("vital_margin_mm", s)));
    EXPECT_TRUE(std::isnan(valueOf("mark_error_mm", s)));
    s.aim.task = datasets::SessionTask::find;
    EXPECT_TRUE(std::isinf(valueOf("mark_error_mm", s)));  // nothing was marked: further off than any mark
    s.vitalMargin = 3e-3;
    s.marks = 1;
    s.markError = 2e-3;
    EXPECT_DOUBLE_EQ(valueOf("vital_margin_mm", s), 3.0);
    EXPECT_DOUBLE_EQ(valueOf("mark_error_mm", s), 2.0);
}

}  // namespace
}  // namespace palpate::haptics
