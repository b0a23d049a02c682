#include <datasets/tables.h>
#include <haptics/scenery.h>
#include <ultrasound/checks.h>

#include <gtest/gtest.h>

#include <cmath>
#include <string_view>

namespace palpate::ultrasound {
namespace {

channel::TissueSound builtIn(std::string_view name)
{
    static const volume::TissueTable table = datasets::defaultTissues();
    return haptics::soundOf(table.rows[table.find(name).value()]);
}

void expectAll(const std::vector<Check>& checks)
{
    EXPECT_FALSE(checks.empty());
    for (const Check& c : checks) {
        EXPECT_TRUE(c.good()) << c.what << ": " << c.measured << " " << c.unit << ", wanted " << c.wanted << " +- "
                              << c.tolerance;
        EXPECT_GT(c.tolerance, 0) << c.what;
        EXPECT_NE(c.source, "") << c.what;
    }
}

// R = (Z2 - Z1) / (Z2 + Z1)
TEST(Checks, ReflectionsAreFresnels)
{
    expectAll(checkReflections(builtIn));
}

// 2 a f^p
TEST(Checks, SpeckleFadesWithTheTablesAttenuation)
{
    expectAll(checkAttenuation(builtIn));
}

TEST(Checks, APointIsAsWideAsTheBeamIs)
{
    expectAll(checkPointSpread(builtIn));
}

// Rayleigh: mean over deviation sqrt(pi / (4 - pi)) = 1.913
TEST(Checks, SpeckleIsFullyDeveloped)
{
    expectAll(checkSpeckle(builtIn));
}

TEST(Checks, SpeckleFollowsTheTissue)
{
    expectAll(checkMotion(builtIn));
}

TEST(Checks, ANeedleFadesWithItsAngle)
{
    expectAll(checkNeedle(builtIn));
}

TEST(Checks, ShadowsAreAsDarkAsLongAndAsWideAsTheirCause)
{
    expectAll(checkShadows(builtIn));
}

TEST(Checks, AWrongFigureFails)
{
    EXPECT_TRUE((Check{"", "", 1.0, 1.1, 0.1001, ""}.good()));
    EXPECT_FALSE((Check{"", "", 1.0, 1.2, 0.1, ""}.good()));
    EXPECT_FALSE((Check{"", "", std::nan(""), 1.2, 0.1, ""}.good()));
}

}  // namespace
}  // namespace palpate::ultrasound
