#include <studies/stability/theory.h>

#include <gtest/gtest.h>

#include <cmath>

namespace palpate::studies {
namespace {

TEST(StabilityTheory, SimulatedLimitsAgreeWithTheFormulas)
{
    const auto rows = theoryRows();
    EXPECT_EQ(rows.size(), 18U);
    for (const auto& row : rows) {
        EXPECT_LT(std::abs(row.errorPct()), 5.0) << row.name << ": " << row.predicted << " " << row.simulated;
    }
}

}  // namespace
}  // namespace palpate::studies
