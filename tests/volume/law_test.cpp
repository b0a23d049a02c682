#include <volume/law.h>

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

namespace palpate::volume {
namespace {

constexpr double mu = 2.0;

TEST(Law, NamesAreDistinctAndLeadBackToTheirLaws)
{
    EXPECT_EQ(std::set(lawNames.begin(), lawNames.end()).size(), lawCount);
    for (const Law& law : laws) {
        EXPECT_EQ(lawNamed(nameOf(law)), law);
    }
    EXPECT_FALSE(lawNamed("hooke"));
    EXPECT_EQ(finiteOf(SmallStrain{}), Law(NeoHookean{}));
    EXPECT_EQ(finiteOf(Exponential{}), Law(Exponential{}));
}

// Of every law, for every b that a tissue may have, on both sides of the bounds at which a law goes on along its tangent:
// slope is twice the derivative of the energy, curvature that of the slope.
TEST(Law, SlopeAndCurvatureAreTheDerivativesOfTheEnergy)
{
    std::minstd_rand random(1);
    std::uniform_real_distribution<double> power(-3.0, 2.0);
    constexpr double step = 1e-5;
    for (const Law& law : laws) {
        for (int n = 0; n < 2000; ++n) {
            const double b = n % 4 == 0 ? -0.25 * std::pow(10.0, -std::abs(power(random))) : std::pow(10.0, power(random));
            const double i = std::pow(10.0, 0.6 * power(random)) + 2.0 * step;
            const Stiffening<double> low = beyond(law, mu, b, i - step), at = beyond(law, mu, b, i),
                                     high = beyond(law, mu, b, i + step);
            if (low.curvature == 0.0 || high.curvature == 0.0) {
                EXPECT_NEAR(high.slope, low.slope, 2.0 * step * (low.curvature + 1e-6 + mu));
                continue;
            }
            EXPECT_NEAR((high.energy - low.energy) / step, at.slope, 1e-5 * (std::abs(at.slope) + 1.0)) << b << " " << i;
            EXPECT_NEAR((high.slope - low.slope) / (2.0 * step), at.curvature, 1e-5 * (std::abs(at.curvature) + 1.0));
        }
    }
}

// W = mu/2 I + mu/4 b I^2, and W = mu/(2 b) (exp(b I) - 1).
TEST(Law, EnergiesAreThoseOfTheBooks)
{
    for (const double b : {-0.2, 1e-6, 0.3, 1.8, 7.0, 40.0}) {
        for (const double i : {1e-6, 1e-3, 0.05, 0.3, 0.9}) {
            const double shear = 0.5 * mu * i;
            EXPECT_NEAR(beyond(NeoHookean{}, mu, b, i).energy, 0.25 * mu * b * i * i, 1e-12 * shear);
            if (b * i < 4.0) {
                const double fung = 0.5 * mu / b * std::expm1(b * i);
                EXPECT_NEAR(shear + beyond(Exponential{}, mu, b, i).energy, fung, 3e-9 * fung) << b << " " << i;
                EXPECT_NEAR(mu + beyond(Exponential{}, mu, b, i).slope, mu * std::exp(b * i), 1e-8 * mu * std::exp(b * i));
            }
        }
    }
}

// Neither has a law any more where b is 0, and the exponential one begins as Yeoh's.
TEST(Law, WithoutStiffeningAllAreNeoHookeanAndAtFirstAllAreAlike)
{
    for (const double i : {0.0, 1e-3, 0.5, 20.0}) {
        for (const Law& law : laws) {
            EXPECT_EQ(beyond(law, mu, 0.0, i).energy, 0.0);
            EXPECT_EQ(beyond(law, mu, 0.0, i).slope, 0.0);
        }
    }
    EXPECT_NEAR(beyond(Exponential{}, mu, 5.0, 1e-4).slope, beyond(NeoHookean{}, mu, 5.0, 1e-4).slope, 1e-6);
}

// What has no bound on paper has one here: exp(4) times the shear modulus at rest, and finite for any invariant.
TEST(Law, TheExponentialStiffensUpToItsBound)
{
    for (const double b : {0.5, 18.0, 1000.0}) {
        for (const double i : {8.0, 1e3, 1e8}) {
            const Stiffening<double> at = beyond(Exponential{}, mu, b, i);
            EXPECT_NEAR(mu + at.slope, mu * std::exp(4.0), 1e-6);
            EXPECT_NEAR(at.energy / (0.5 * at.slope * (i - 4.0 / b) + beyond(Exponential{}, mu, b, 4.0 / b).energy), 1.0,
                        1e-9);
            const Stiffening<float> narrow = Exponential::beyond(2.0F, static_cast<float>(b), static_cast<float>(i));
            EXPECT_NEAR(static_cast<double>(narrow.energy) / at.energy, 1.0, 1e-5);
        }
    }
}

TEST(Law, SinglePrecisionIsNearDouble)
{
    const auto check = [](auto law) {
        if constexpr (decltype(law)::finite) {
            for (const float b : {-0.25F, 0.0F, 1e-4F, 2.2F, 18.0F}) {
                for (const float i : {1e-6F, 1e-3F, 0.1F, 0.7F, 3.0F}) {
                    const auto narrow = law.beyond(2.0F, b, i);
                    const auto wide = law.beyond(2.0, static_cast<double>(b), static_cast<double>(i));
                    EXPECT_NEAR(static_cast<double>(narrow.energy), wide.energy, 2e-6 * std::abs(wide.energy));
                    EXPECT_NEAR(static_cast<double>(narrow.slope), wide.slope, 2e-6 * std::abs(wide.slope));
                }
            }
        }
    };
    for (const Law& law : laws) {
        std::visit(check, law);
    }
}

// The tissue table's stiffenings are neo-Hookean's. Those that docs/kernel.md names for the exponential law have the same
// ratio of tangent moduli at 20 and 5 % strain, within 6 %.
TEST(Law, StiffeningsOfThePagesGiveTheTangentsOfTheTissueTable)
{
    const auto ratio = [](const Law& law, double b) {
        const auto stress = [&](double stretch) {
            const double i = stretch * stretch + 2.0 / stretch - 3.0;
            return (1.0 + beyond(law, 1.0, b, i).slope) * (stretch - 1.0 / (stretch * stretch));
        };
        // Of extension and compression, as the tissue table's 1 + 9 b e^2 is.
        const auto tangent = [&](double e) {
            constexpr double step = 1e-4;
            return stress(1.0 + e + step) - stress(1.0 + e - step) + stress(1.0 - e + step) - stress(1.0 - e - step);
        };
        return tangent(0.2) / tangent(0.05);
    };
    for (const auto& [table, page] : {std::pair(2.2, 1.8), std::pair(18.0, 7.0)}) {
        EXPECT_NEAR(ratio(Exponential{}, page) / ratio(NeoHookean{}, table), 1.0, 0.06) << table;
    }
}

}  // namespace
}  // namespace palpate::volume
