#include "models.h"

#include <haptics/contact_law.h>

#include <gtest/gtest.h>

#include <fmt/format.h>

#include <cmath>

namespace palpate::haptics {
namespace {

// Simone and Okamura 2002, bovine liver: f = 0.0020 z + 0.0023 z^2 N with z in mm, for a needle 1 mm across; E = 2 kPa lies
// in the range published for liver.
TEST(DepthLaw, IsTheLiverCurveOfSimoneAndOkamura)
{
    auto model = tests::modelOf(tests::layeredScene);
    model.scene.tool.radius = 0.5e-3;
    const auto law = needleLaw(model, {2000.0, 0.49});
    for (double z = 1.0; z <= 10.0; z += 1.0) {
        const double published = 0.0020 * z + 0.0023 * z * z;
        EXPECT_NEAR(law.force(1e-3 * z), published, 0.1 * published + 0.001) << z;
    }
}

TEST(DepthLaw, DepthInvertsForceAndTheSlopeStaysBounded)
{
    const DepthLaw law{30.0, 12000.0, 1000.0};
    double before = 0.0;
    for (double z = 0.0; z < 0.1; z += 1e-4) {
        const double f = law.force(z);
        EXPECT_NEAR(law.depth(f), z, 1e-12);
        EXPECT_LE(f - before, 1000.0 * 1e-4 * (1 + 1e-9));
        before = f;
    }
    const DepthLaw spring{250.0, 0.0, 1000.0};
    EXPECT_DOUBLE_EQ(spring.force(0.01), 2.5);
    EXPECT_DOUBLE_EQ(spring.depth(2.5), 0.01);
}

// Hertz: F = 4/3 E / (1 - nu^2) sqrt(R) d^1.5.
TEST(SphereForce, IsHertz)
{
    const auto& model = tests::blockSphere();
    const LocalTissue fat{3250.0, 0.45};
    for (const double d : {0.5e-3, 2e-3, 8e-3}) {
        const double hertz = 4.0 / 3.0 * 3250.0 / (1 - 0.45 * 0.45) * std::sqrt(10e-3) * std::pow(d, 1.5);
        EXPECT_NEAR(sphereForce(model, fat, d), hertz, 1e-12);
    }
    const LocalTissue bone{1e9, 0.3};
    EXPECT_LE(sphereForce(model, bone, 2e-3), stiffestContact * 2e-3 * (1 + 1e-9));
}

// F_BFFB = K d, equation 2 of the thesis.
TEST(SphereForce, IsEquationTwoAtLevelSpring)
{
    auto model = tests::modelOf(tests::blockScene);
    model.scene.model.level = datasets::ModelLevel::spring;
    model.scene.model.stiffness = 300.0;
    EXPECT_DOUBLE_EQ(sphereForce(model, {3250.0, 0.45}, 5e-3), 1.5);
}

// Pressing over the inclusion feels stiffer than beside it: palpation.
TEST(TissueUnder, FeelsTheInclusion)
{
    const auto& model = tests::blockSphere();
    const volume::Tissue::Reader reader(*model.tissue);
    const Vec3 inward(0, 1, 0);
    const auto over = tissueUnder(model, reader, {0, 0, 0}, inward, 10e-3);
    const auto beside = tissueUnder(model, reader, {0.035, 0, 0}, inward, 10e-3);
    EXPECT_NEAR(beside.youngsModulus, 3250.0, 50.0);
    EXPECT_GT(over.youngsModulus, 1.2 * beside.youngsModulus);
}

// Bone under fat is a floor. Under a punch of radius a, a layer of h = 5 a or 2.5 a over one is 1.25 or 1.6 times as stiff
// as a half space (W. C. Hayes et al., J. Biomechanics 5, 1972, nu = 0.45). The mean of the moduli alone was 8 to 30 times.
TEST(ContactLaw, BoneUnderFatIsAFloor)
{
    const auto modulusOver = [](double thick) {
        const auto model =
            tests::modelOf(fmt::format("name = \"floor\"\n[volume]\nphantom = \"block\"\n[volume.parameters]\n"
                                       "thickness_mm = {}\ntumours = 0\n[target]\nentry_mm = [0, 0, 0]\n"
                                       "aim_mm = [0, 3, 0]\n",
                                       thick));
        const volume::Tissue::Reader reader(*model.tissue);
        return tissueUnder(model, reader, {0, 0, 0}, {0, 1, 0}, 4e-3).youngsModulus;
    };
    const double deep = modulusOver(40);
    double before = 1.0;
    for (const double thick : {18.0, 15.0, 12.0, 10.0}) {
        const double times = modulusOver(thick) / deep;
        EXPECT_GE(times, before - 1e-9) << thick;
        EXPECT_LE(times, 2.5) << thick;
        before = times;
    }
}

}  // namespace
}  // namespace palpate::haptics
