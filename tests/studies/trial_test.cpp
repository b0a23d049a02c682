#include <studies/kernel/kernel_rivals.h>
#include <studies/kernel/kernel_trial.h>

#include <tests/studies/small_block.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <cmath>
#include <vector>

namespace palpate::studies {
namespace {

constexpr double spacing = 2e-3;
constexpr double speed = 20e-3;

// The block, its body and the 5 mm sphere's way, and the path's converged solution: made once.
struct PressedTrial {
    haptics::SessionModel model = smallBlock();
    TrialPlace place = trialPlace(*model.tissue, model.surface, model.approach.entry, model.approach.aim);
    TrialBody body = trialBody(*model.tissue, model.surface, spacing, 0.49, 1U << 20);
    TrialPath path = trialPath(*model.tissue, model.surface, place, trialTools()[0], spacing);
    std::array<double, 1> speeds{speed};
    Reference reference = solveReference(body.body, path, speeds, {});
};

const PressedTrial& trialPressed()
{
    static const PressedTrial p;
    return p;
}

std::size_t looksIn(const std::vector<TrialTick>& ticks, TrialPhase phase)
{
    return static_cast<std::size_t>(
        std::ranges::count_if(ticks, [&](const TrialTick& t) { return t.look && t.phase == phase; }));
}

TEST(TrialPath, GoesInThenSidewaysThenRests)
{
    const auto& p = trialPressed();
    EXPECT_NEAR(p.place.thickness, 16e-3, 1.5e-3);
    EXPECT_NEAR(p.path.press, 0.5e-3 + 4e-3, 1e-9);
    EXPECT_NEAR(glm::dot(p.path.inward, p.path.sideways), 0.0, 1e-12);
    for (const double v : {20e-3, 100e-3}) {
        const auto ticks = schedule(p.path, v);
        EXPECT_EQ(looksIn(ticks, TrialPhase::press), 4U);
        EXPECT_EQ(looksIn(ticks, TrialPhase::turn), 2U);
        EXPECT_GE(looksIn(ticks, TrialPhase::drag), 3U);
        EXPECT_EQ(looksIn(ticks, TrialPhase::rest), 1U);
        for (std::size_t i = 1; i < ticks.size(); ++i) {
            const Vec3 step = p.path.way(ticks[i].pose) - p.path.way(ticks[i - 1].pose);
            EXPECT_LE(glm::length(step), 1.15 * v * 1e-3);
        }
        EXPECT_TRUE(ticks.back().look);
        EXPECT_EQ(ticks.back().pose, (TrialPose{p.path.press, p.path.drag}));
    }
}

// A thin layer is not pressed through: 40 % of it is the most.
TEST(TrialPath, SparesThinTissue)
{
    const auto& p = trialPressed();
    TrialPlace thin = p.place;
    thin.thickness = 5e-3;
    EXPECT_NEAR(trialPath(*p.model.tissue, p.model.surface, thin, trialTools()[1], spacing).press, 2.5e-3, 1e-9);
}

TEST(TrialPath, ANeedleHoldsAPointAndAShaftAllOfItsLength)
{
    const auto& p = trialPressed();
    const TrialPath needle = trialPath(*p.model.tissue, p.model.surface, p.place, trialTools()[2], spacing);
    ASSERT_EQ(needle.ties.size(), 1U);
    const double e = volume::Tissue::Reader(*p.model.tissue).youngsModulus(needle.ties[0].rest);
    EXPECT_GT(e, 0.0);
    EXPECT_NEAR(needle.ties[0].along, 8.0 * e * spacing, 1e-6 * e);
    const TrialPath shaft = trialPath(*p.model.tissue, p.model.surface, p.place, trialTools()[3], spacing);
    double length = 0.0;
    for (const chainmail::Tie& tie : shaft.ties) {
        EXPECT_LT(glm::distance(tie.rest, p.place.entry + (length + 0.5 * tie.piece.length) * p.place.approach), 1e-9);
        length += tie.piece.length;
    }
    EXPECT_NEAR(length, std::min(20e-3, 0.8 * p.place.shaft), 1e-9);
    EXPECT_NEAR(shaft.ties.front().piece.rod, length, 1e-9);
}

// The whole grid with many cycles per tick is the reference, to the tolerance at which a tick ends.
TEST(KernelTrial, TheReferenceHasNoErrorAgainstItself)
{
    const auto& p = trialPressed();
    EXPECT_LT(p.reference.residual, 1e-4);
    const TrialResult result = elasticTrial(p.body.body, p.path, speed, p.reference, wholeGrid(8, volume::SmallStrain{}));
    EXPECT_LT(spreadOf(result.looks, &TrialErrors::rms).worst, 1.0);
    EXPECT_LT(spreadOf(result.looks, &TrialErrors::force).worst, 1.5);
    EXPECT_GT(result.meanTouched, 10.0);
    EXPECT_GT(result.p50, 0.0);
}

// Tissue that stays where it is misses the largest displacement by all of it; the force is no question of its shape.
TEST(KernelTrial, NothingMissesEverythingUnderTheTool)
{
    const auto& p = trialPressed();
    const TrialResult result = runTrial(nothingModel(), p.path, speed, p.reference);
    EXPECT_NEAR(spreadOf(result.looks, &TrialErrors::max).median, 100.0, 1e-3);
    EXPECT_EQ(spreadOf(result.looks, &TrialErrors::force).worst, 0.0);
    EXPECT_GT(spreadOf(result.looks, &TrialErrors::near).median, spreadOf(result.looks, &TrialErrors::rms).median - 1e-9);
}

// Halving the displacement makes half the error, at every node.
TEST(KernelTrial, ErrorsAreSharesOfTheLargestDisplacement)
{
    const auto& p = trialPressed();
    const ReferenceState* now = nullptr;
    TrialModel half = nothingModel();
    half.tick = [&](const TrialLoad& load) {
        for (const ReferenceState& s : p.reference.states) {
            now = s.pose == load.pose() ? &s : now;
        }
        return chainmail::ElasticResult{};
    };
    half.displacement = [&](Vec3 rest) {
        for (std::size_t i = 0; i < p.reference.position.size(); ++i) {
            if (Vec3(p.reference.position[i]) == rest) {
                return 0.5 * Vec3(now->u[i]);
            }
        }
        return Vec3(0.0);
    };
    half.force = [&] { return 0.9 * now->force; };
    const TrialResult halved = runTrial(half, p.path, speed, p.reference);
    const TrialResult none = runTrial(nothingModel(), p.path, speed, p.reference);
    ASSERT_EQ(halved.looks.size(), none.looks.size());
    for (std::size_t i = 0; i < none.looks.size(); ++i) {
        EXPECT_NEAR(halved.looks[i].rms, 0.5 * none.looks[i].rms, 1e-6);
        EXPECT_NEAR(halved.looks[i].max, 50.0, 1e-4);
        EXPECT_LT(halved.looks[i].force, 10.0 + 1e-9);
    }
    EXPECT_NEAR(halved.looks.back().force, 10.0, 1e-6);
}

// The worst look has the largest error, on whichever side of the reference it is; one that is no number is not lost.
TEST(KernelTrial, TheWorstLookKeepsItsSignAndNoNumberWins)
{
    const auto spread = [](std::vector<double> energies) {
        std::vector<TrialErrors> looks;
        for (const double e : energies) {
            looks.push_back({});
            looks.back().energy = e;
        }
        return spreadOf(looks, &TrialErrors::energy);
    };
    EXPECT_EQ(spread({-1.0, -5.0, 2.0}).worst, -5.0);
    EXPECT_EQ(spread({-1.0, -5.0, 2.0}).median, -1.0);
    for (const auto& looks :
         {std::vector<double>{1.0, NAN, 2.0}, std::vector<double>{NAN, 1.0}, std::vector<double>{1.0, NAN}}) {
        EXPECT_TRUE(std::isnan(spread(looks).worst));
        EXPECT_TRUE(std::isnan(spread(looks).median));
    }
    const auto& p = trialPressed();
    std::vector<Vec3> u(p.reference.position.size(), Vec3(0.0));
    u[0].x = NAN;
    EXPECT_TRUE(std::isnan(errorsOf(u, {}, p.reference, {}, p.reference.states.back()).max));
}

TEST(KernelTrial, WindowsAreBetterThanChainMailAndChainMailIsBetterThanNothing)
{
    const auto& p = trialPressed();
    const chainmail::Lattice lattice(p.body.cells, p.model.tissue->tissueOn(p.body.cells), p.model.tissue->table());
    const auto rms = [](const TrialResult& r) { return spreadOf(std::span(r.looks).first(4), &TrialErrors::rms).median; };
    const double windows = rms(elasticTrial(p.body.body, p.path, speed, p.reference, {.window = 9, .cycles = 2}));
    const double chain = rms(chainMailTrial(lattice, p.path, speed, p.reference, 5000));
    const double nothing = rms(runTrial(nothingModel(), p.path, speed, p.reference));
    EXPECT_LT(windows, 0.5 * chain);
    EXPECT_LT(chain, nothing);
}

TEST(KernelTrial, AnotherSpeedThanTheReferencesIsRefused)
{
    const auto& p = trialPressed();
    EXPECT_THROW(runTrial(nothingModel(), p.path, 0.1, p.reference), std::logic_error);
}

TEST(KernelTrial, TheBestRunAtEqualErrorIsTheFastest)
{
    const auto run = [](double rms, double seconds) {
        RivalRun r;
        r.result.looks = {{TrialPhase::press, rms}};
        r.result.mean = seconds;
        return r;
    };
    const std::vector<RivalRun> runs{run(0.5, 9e-4), run(1.0, 6e-4), run(2.0, 2e-4)};
    EXPECT_DOUBLE_EQ(ratioAtEqualError(runs, &TrialErrors::rms, 1.0, 2e-4), 3.0);
    EXPECT_DOUBLE_EQ(ratioAtEqualError(runs, &TrialErrors::rms, 0.1, 2e-4), 0.0);
}

}  // namespace
}  // namespace palpate::studies
