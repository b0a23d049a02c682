#include <base/quantities.h>
#include <base/rank_correlation.h>
#include <base/round_step.h>

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

namespace palpate::base {
namespace {

TEST(RoundStep, IsTheNextOneTwoOrFive)
{
    for (const auto& [value, below, above] : {std::array{3.0, 2.0, 5.0}, {0.07, 0.05, 0.1}, {600, 500, 1000}, {2, 2, 2}}) {
        EXPECT_DOUBLE_EQ(roundStep(value, false), below);
        EXPECT_DOUBLE_EQ(roundStep(value, true), above);
    }
}

TEST(MultiplesIn, HaveBothEndsAndAnEnd)
{
    EXPECT_EQ(multiplesIn(-2, 4, 2), (std::vector<double>{-2, 0, 2, 4}));
    EXPECT_EQ(multiplesIn(0.1, 0.3, 0.1).size(), 3U) << "though 3 times 0.1 is above 0.3";
    EXPECT_TRUE(multiplesIn(0.1, 0.9, 1).empty());
    EXPECT_EQ(multiplesIn(1e17, 1e17, 0.1).size(), 1U) << "doubles lie 16 apart there";
    EXPECT_LE(multiplesIn(1e17, 1e17 + 16, 5).size(), 4U);
    EXPECT_TRUE(multiplesIn(INFINITY, -INFINITY, 1).empty());
}

TEST(PixelsOf, TakesWidthAndHeightAlone)
{
    EXPECT_EQ(pixelsOf("1280x960"), std::pair(1280, 960));
    for (const char* const wrong : {"", "x", "1280", "1280x", "x960", "1280x960 ", " 1280x960", "1280 x960", "1280x960x3",
                                    "1280X960", "1e3x960", "99999999999x960", "-1x5", "0x0", "5x-1"}) {
        EXPECT_FALSE(pixelsOf(wrong)) << wrong;
    }
}

TEST(RankCorrelation, OfWhatHasNoRanksIsNone)
{
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const std::vector<double> whole{1, 2, 3, 4}, holed{1, 2, nan, 4}, shorter{1, 2};
    EXPECT_TRUE(std::isnan(rankCorrelation(whole, holed)));
    EXPECT_TRUE(std::isnan(rankCorrelation(holed, whole)));
    EXPECT_THROW(rankCorrelation(whole, shorter), std::runtime_error);
}

}  // namespace
}  // namespace palpate::base
