#include <studies/accuracy/elastic_formulas.h>
#include <studies/accuracy/kernel_verification.h>

#include <gtest/gtest.h>

#include <cmath>
#include <map>

namespace palpate::studies {
namespace {

// E 3 kPa, nu 0.45: 4/3 x 3000 / 0.7975 x sqrt(0.01) x 0.001^1.5 N.
TEST(ContactFormulas, HertzAndThePunchOnAHalfSpace)
{
    EXPECT_NEAR(hertzForce(3000, 0.45, 0.01, 1e-3), 0.01586095, 1e-8);
    EXPECT_NEAR(hertzForce(3000, 0.45, 0.01, 4e-3), 8.0 * hertzForce(3000, 0.45, 0.01, 1e-3), 1e-12);
    EXPECT_NEAR(flatPunchForce(3000, 0.0, 0.01, 1e-3), 0.06, 1e-12);
    EXPECT_NEAR(flatPunchForce(3000, 0.5, 0.01, 1e-3), 0.08, 1e-12);
}

// A layer is stiffer than a half-space, the more so the thinner it is; a very deep one is none.
TEST(ContactFormulas, LayersTendToTheHalfSpace)
{
    for (const double nu : {0.3, 0.45, 0.49}) {
        EXPECT_EQ(bondedLayerFactor(nu, 0.0), 1.0);
        EXPECT_EQ(deepPunchFactor(nu, 0.0), 1.0);
        double before = 1.0;
        for (double chi = 0.02; chi <= 0.26; chi += 0.02) {
            EXPECT_GT(bondedLayerFactor(nu, chi), before);
            before = bondedLayerFactor(nu, chi);
        }
    }
    // Of first order both are the same: what a layer does to a point's load.
    const double slope = (bondedLayerFactor(0.45, 1e-6) - 1.0) / 1e-6;
    EXPECT_NEAR(slope, (deepPunchFactor(0.45, 1e-6) - 1.0) / 1e-6, 1e-4);
    // The paper's own numbers for nu = 0.5: 1 + 1.133 chi + 1.283 chi^2 + 0.769 chi^3 + 0.0975 chi^4.
    const double chi = 0.25;
    const double paper = 1.0 + 1.133 * chi + 1.283 * chi * chi + 0.769 * std::pow(chi, 3) + 0.0975 * std::pow(chi, 4);
    EXPECT_NEAR(bondedLayerFactor(0.5, chi), paper, 2e-3);
}

TEST(ContactFormulas, HayesTableIsReadWhereItHasARow)
{
    EXPECT_EQ(thinLayerPunchFactor(0.3, 0.2), 1.207);
    EXPECT_EQ(thinLayerPunchFactor(0.45, 1.0), 3.085);
    EXPECT_EQ(thinLayerPunchFactor(0.45, 0.3), 0.0);
    EXPECT_EQ(thinLayerPunchFactor(0.4, 0.2), 0.0);
    EXPECT_EQ(thinLayerPunchFactor(0.3, 0.0), 0.0);
}

// All rows hold; the patch is exact at any spacing; a punch's error halves with the spacing.
TEST(KernelVerification, ClosedFormsHold)
{
    std::size_t told = 0;
    const auto rows = verifyKernel(true, [&](const std::string&) { ++told; });
    std::map<std::string, std::vector<KernelVerification>> problems;
    for (const KernelVerification& row : rows) {
        EXPECT_TRUE(row.holds()) << row.problem << ", " << row.setting << ": " << row.errorPercent << " %";
        EXPECT_FALSE(row.source.empty());
        problems[row.problem].push_back(row);
    }
    EXPECT_EQ(problems.size(), 7U);
    EXPECT_EQ(told, 28U);
    for (const auto& [name, own] : problems) {
        if (name.starts_with("patch")) {
            EXPECT_LT(std::abs(own[0].errorPercent), 0.01);
        } else if (name.starts_with("flat punch")) {
            EXPECT_GT(own[1].order, 0.5) << name;
            EXPECT_LT(std::abs(own.back().errorPercent), 0.5 * std::abs(own[1].errorPercent)) << name;
        } else if (name.starts_with("sphere that just touches")) {
            EXPECT_EQ(own.size(), 32U);
            for (std::size_t i = 0; i < own.size(); i += 2) {
                EXPECT_GE(std::abs(own[i + 1].errorPercent), std::abs(own[i].errorPercent)) << own[i].setting;
            }
        }
    }
}

}  // namespace
}  // namespace palpate::studies
