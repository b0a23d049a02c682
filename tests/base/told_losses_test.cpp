#include <base/told_losses.h>

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace palpate::base {
namespace {

// Beside 99.62 points, shown as 100, and a bar that is not full.
TEST(ToldLosses, AreTheSmallOnesWhereThereAreNoLarger)
{
    using Told = std::vector<std::size_t>;
    EXPECT_EQ(toldLosses(std::vector{0.38, 0.04}), (Told{0}));
    EXPECT_EQ(toldLosses(std::vector{3.0, 0.6, 0.5}), (Told{0, 1}));
    EXPECT_EQ(toldLosses(std::vector{0.04}), Told());
    EXPECT_EQ(lossInWords(0.38), "-0.4");
    EXPECT_EQ(lossInWords(3.2), "-3");
    EXPECT_STREQ(headingOfLosses(100, 0), "Nothing was lost");
    EXPECT_STREQ(headingOfLosses(99.62, 1), "Less than a point was lost");
    EXPECT_STREQ(headingOfLosses(98.4, 4), "Where the points went");
}

}  // namespace
}  // namespace palpate::base
