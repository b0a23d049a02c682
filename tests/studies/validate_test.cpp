#include <studies/validate/cell_body.h>
#include <studies/validate/experiment.h>
#include <studies/validate/measurements.h>

#include <tests/error_of.h>
#include <tests/folder.h>

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>

namespace palpate::studies {
namespace {

double uniaxialEnergy(const Incompressible& law, double stretch)
{
    return law.energy(stretch * stretch + 2.0 / stretch - 3.0);
}

// Nominal stress of a bar is dW/dstretch, beyond the bound of softening too.
TEST(Yeoh, StressIsTheDerivativeOfEnergy)
{
    constexpr double step = 1e-5;
    using Case = std::pair<volume::Law, double>;
    for (const auto& [of, b] :
         {Case(volume::NeoHookean{}, 0.0), Case(volume::NeoHookean{}, 1.5), Case(volume::NeoHookean{}, -0.12),
          Case(volume::NeoHookean{}, -0.25), Case(volume::Exponential{}, 1.8), Case(volume::Exponential{}, -0.2)}) {
        const Incompressible law{2.0, b, of};
        for (const double stretch : {0.45, 0.6, 0.9, 1.2, 1.6, 2.4}) {
            const double scale = 1.0 + std::abs(uniaxialStress(law, stretch));
            const double slope = (uniaxialEnergy(law, stretch + step) - uniaxialEnergy(law, stretch - step)) / (2.0 * step);
            EXPECT_NEAR(uniaxialStress(law, stretch), slope, 1e-5 * scale) << b;
        }
    }
}

// At rest the tangent is Young's modulus, 3 mu.
TEST(Yeoh, TangentAtRestIsHookes)
{
    constexpr double step = 1e-4;
    const Incompressible law{2.0, -0.2};
    EXPECT_NEAR((uniaxialStress(law, 1.0 + step) - uniaxialStress(law, 1.0 - step)) / (2.0 * step), 6.0, 1e-5);
}

// Of all laws and all b that a tissue may have: more stretch, more stress.
TEST(Yeoh, StressOfAStretchAlwaysRises)
{
    for (const volume::Law& law : volume::laws) {
        for (double b = -0.25; b < 20.0; b += b < 0.3 ? 0.01 : 0.7) {
            double before = uniaxialStress({1.0, b, law}, 0.2);
            for (double stretch = 0.21; stretch < 6.0; stretch += 0.01) {
                const double now = uniaxialStress({1.0, b, law}, stretch);
                ASSERT_GT(now, before) << volume::nameOf(law) << " " << b << " at " << stretch;
                before = now;
            }
        }
    }
}

// Without friction the deformation is uniform: load = area times the closed form, whatever the cells' size.
TEST(CompressedCylinder, WithoutFrictionIsTheClosedForm)
{
    Cylinder shape;
    shape.cell = 5e-3;
    const double area = std::numbers::pi * shape.radius * shape.radius;
    for (const double b : {0.0, -0.2, 0.5}) {
        const auto loads = compressionLoads(shape, b, false, {0.1, 0.4});
        EXPECT_NEAR(loads[0] / area, -uniaxialStress({1.0, b}, 0.9), 0.01 * loads[0] / area) << b;
        EXPECT_NEAR(loads[1] / area, -uniaxialStress({1.0, b}, 0.6), 0.02 * loads[1] / area) << b;
    }
}

// A clamped beam under a small load at its end: F L^3 / 3 E I and the shear's F L / (5/6 G A). The markers' feet are at the
// end of the beam, and turn little.
TEST(SiliconeBeam, SmallDropIsThatOfBeamTheory)
{
    Beam beam;
    beam.youngsModulus = 1e6;
    beam.poisson = 0.45;
    beam.gravity = Vec3(0.0);
    beam.tipLoad = 0.1;
    beam.cell = 5e-3;
    const double inertia = std::pow(30e-3, 4) / 12.0;
    const double shear = beam.youngsModulus / (2.0 * (1.0 + beam.poisson));
    const double drop =
        beam.tipLoad * 1e-3 / (3.0 * beam.youngsModulus * inertia) + beam.tipLoad * 0.1 / (5.0 / 6.0 * shear * 9e-4);
    // A clamp that also holds the beam's width makes so short a beam a little stiffer.
    EXPECT_NEAR(-beamMarkers(beam)[1].z, drop, 0.08 * drop);
    // Twice as stiff: half the drop.
    const double once = beamMarkers(beam)[1].z;
    beam.youngsModulus *= 2.0;
    EXPECT_NEAR(beamMarkers(beam)[1].z, 0.5 * once, 0.01 * std::abs(once));
}

// The weight of the clamped beam is held at the clamp.
TEST(CellBody, ReactionsBalanceLoads)
{
    CellBody body({4, 2, 2}, 5e-3);
    volume::forEachIndex(Index3(0), Index3(3, 1, 1), [&](Index3 cell) { body.fill(cell, {1e5, 0.45, 0.0}); });
    volume::forEachIndex(Index3(0), Index3(0, 2, 2), [&](Index3 node) {
        for (int c = 0; c < 3; ++c) {
            body.prescribe(node, c, 0.0);
        }
    });
    body.load({4, 1, 1}, Vec3(0.01, -0.02, 0.03));
    ASSERT_TRUE(body.solve(1e-4, 2000));
    Vec3 sum(0.0);
    volume::forEachIndex(Index3(0), Index3(0, 2, 2), [&](Index3 node) { sum += body.reaction(node); });
    EXPECT_NEAR(sum.x, -0.01, 2e-5);
    EXPECT_NEAR(sum.y, 0.02, 2e-5);
    EXPECT_NEAR(sum.z, -0.03, 2e-5);
}

TEST(FittedRelaxation, WeightsAreFoundAgain)
{
    for (const volume::Relaxation& wanted :
         {volume::Relaxation{{0.35, 0.4}}, volume::Relaxation{{0.0, 0.3}}, volume::Relaxation{{0.2, 0.0}}}) {
        std::vector<double> seconds, ratios;
        for (double t = 0.1; t < 60.0; t *= 1.4) {
            seconds.push_back(t);
            ratios.push_back(wanted.remaining(t));
        }
        const volume::Relaxation found = fittedRelaxation(seconds, ratios);
        EXPECT_NEAR(found.weights[0], wanted.weights[0], 1e-9);
        EXPECT_NEAR(found.weights[1], wanted.weights[1], 1e-9);
    }
    // Ratios over 1 ask for a weight under 0.
    EXPECT_EQ(fittedRelaxation({1.0, 10.0}, {1.1, 1.2}).weights, (std::array<double, 2>{0.0, 0.0}));
}

// Walls s apart whose forces are exponential with mean m give L / s exp(-limit / m) falls over the limit, m larger on
// average.
TEST(FittedWalls, AreThoseThatMakeTheFalls)
{
    for (const double mean : {0.05, 0.22, 1.5}) {
        for (const double spacing : {3e-3, 20e-3}) {
            constexpr double length = 60e-3;
            const LiverLaw law = fittedWalls(length / spacing * std::exp(-minRupture / mean), minRupture + mean, length);
            EXPECT_NEAR(law.wallSpacing, spacing, 1e-9);
            EXPECT_NEAR(law.wallForce, mean, 1e-9);
        }
    }
    EXPECT_EQ(fittedWalls(0.0, minRupture, 60e-3).wallSpacing, 0.0);
}

// Walls every 5 mm make a needle's force fall several times on 60 mm, and none does without them.
TEST(NeedleStroke, InnerWallsMakeRuptures)
{
    EXPECT_EQ(needleStroke({.cutting = 0.3}, {}, 60e-3, {}).falls, 0U);
    EXPECT_GE(needleStroke({.cutting = 0.3, .wallSpacing = 5e-3, .wallForce = 0.25}, {}, 60e-3, {}).falls, 2U);
}

// A needle that stands keeps of its force what the series of the tissue says, tip and shaft alike.
TEST(NeedleStroke, HeldForceFollowsTheTissuesSeries)
{
    const std::vector<double> at{0.0, 0.2, 1.0, 5.0};
    const volume::Relaxation relaxation{{0.38, 0.4}};
    const NeedleStroke stroke = needleStroke({.cutting = 0.3, .relaxation = relaxation}, {}, 20e-3, at);
    const NeedleStroke stiff = needleStroke({.cutting = 0.3}, {}, 20e-3, at);
    for (std::size_t i = 0; i < at.size(); ++i) {
        EXPECT_NEAR(stroke.held[i] / stroke.held[0], relaxation.remaining(at[i]), 0.02) << at[i];
        EXPECT_NEAR(stiff.held[i] / stiff.held[0], 1.0, 0.02) << at[i];
    }
    // Tissue that is cut is new: the way in has the table's forces, a little earlier since new tissue gives way less.
    for (std::size_t i = 3; i < stroke.in.size(); ++i) {
        EXPECT_NEAR(stroke.in[i], stiff.in[i], 0.07 * stiff.in[i]) << i;
    }
}

TEST(Measurements, MissingAndDamagedFilesSaySo)
{
    const tests::Folder folder;
    EXPECT_THROW(Measurements(folder / "none.csv"), NoMeasurement);
    EXPECT_THROW(measurementFile({folder.path()}, "none.csv"), NoMeasurement);
    std::ofstream(folder / "short.csv") << "# what\na,b\n1,2\n3\n";
    std::ofstream(folder / "words.csv") << "a,b\n1,soft\n\"2\",nan\n3,inf\n";
    try {
        Measurements(folder / "short.csv");
        FAIL();
    } catch (const std::runtime_error& e) {
        EXPECT_NE(std::string(e.what()).find("line 4"), std::string::npos) << e.what();
    }
    const Measurements words(folder / "words.csv");
    EXPECT_EQ(words.number(1, "a"), 2.0);
    EXPECT_THROW(words.number(1, "b"), std::runtime_error);
    EXPECT_THROW(words.number(2, "b"), std::runtime_error);
    EXPECT_THROW(words.number(0, "b"), std::runtime_error);
    EXPECT_THROW(words.number(0, "c"), std::runtime_error);
}

// An error that is no number is not lost in a maximum, and no experiment with it holds.
TEST(Experiment, AnErrorThatIsNoNumberFails)
{
    EXPECT_EQ(largerError(1.0, 2.0), 2.0);
    EXPECT_EQ(largerError(2.0, 1.0), 2.0);
    EXPECT_TRUE(std::isnan(largerError(NAN, 1.0)));
    EXPECT_TRUE(std::isnan(largerError(1.0, NAN)));
    const ErrorSummary summary = summaryOf({1.0, NAN, 2.0});
    EXPECT_TRUE(std::isnan(summary.rms));
    EXPECT_TRUE(std::isnan(summary.worst));
    Experiment e;
    e.error = summary.worst;
    e.bound = 100.0;
    e.judge();
    EXPECT_EQ(e.verdict, Verdict::fails);
}

// Six curves of 20 mm in and out, and what they hold; `gap`: no curve has a force from 10 to 12 mm; `start`: curve 1 has
// one at 0 s.
void writeNeedleCurves(const tests::Folder& folder, bool gap, bool start)
{
    std::ofstream curves(folder / "curves.csv"), hold(folder / "hold.csv");
    curves << "curve,phase,x_mm,F_mean_N,F_max_N,F_min_N\n";
    hold << "curve,t_hold_s,F_N\n";
    for (int curve = 0; curve < 6; ++curve) {
        for (double x = 0.25; x < 20.0; x += 0.5) {
            if (!gap || x < 10.0 || x > 12.0) {
                curves << curve << ",ins," << x << ",0.5,0.6,0.4\n" << curve << ",ret," << x << ",-0.1,0,-0.2\n";
            }
        }
        for (const double seconds : {0.0, 1.0, 10.0}) {
            if (start || curve != 1 || seconds > 0.0) {
                hold << curve << "," << seconds << "," << 1.0 - 0.05 * seconds << "\n";
            }
        }
    }
}

TEST(NeedleInLiver, RefusesCurvesWithoutAStartOrWithABinThatNoneReaches)
{
    const tests::Folder folder;
    const auto error = [&] {
        return tests::errorOf(
            [&] { needleInLiver(folder / "curves.csv", folder / "hold.csv", [](const std::string&) {}); });
    };
    writeNeedleCurves(folder, true, true);
    EXPECT_NE(error().find("no curve with an odd number has a force at 10 to 12 mm"), std::string::npos) << error();
    writeNeedleCurves(folder, false, false);
    EXPECT_NE(error().find("curve 1 must begin with a force above 0 at t_hold_s = 0"), std::string::npos) << error();
}

}  // namespace
}  // namespace palpate::studies
