#include <base/error.h>
#include <planner/planner.h>
#include <studies/accuracy/accuracy.h>
#include <studies/accuracy/references.h>
#include <studies/kernel/kernel_rivals.h>

#include <tests/error_of.h>
#include <tests/studies/small_block.h>

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace palpate::planner {
namespace {

using datasets::ModelLevel;

Plan planned(double error, double budget, bool all = false, bool needle = false)
{
    static const haptics::SessionModel block = studies::smallBlock();
    haptics::SessionModel model = block;
    if (needle) {
        model.scene.tool = {};
    }
    PlanRequest request;
    request.error = error;
    request.budget = budget;
    request.speed = 0.05;
    request.all = all;
    return planModel(model, request, [](const std::string&) {});
}

// The converged solution takes most of the time on a large body: who waits sees it go on, and whoever gives up is heard at
// the next look.
TEST(Planner, SaysEachLookOfTheConvergedSolutionAndMayBeEndedThere)
{
    const haptics::SessionModel block = studies::smallBlock();
    PlanRequest request;
    request.speed = 0.05;
    std::vector<std::string> told;
    const auto untilLook = [&](const std::string& what) {
        told.push_back(what);
        base::failIf(what.starts_with("the converged solution, 3 of"), "enough");
    };
    EXPECT_EQ(tests::errorOf([&] { planModel(block, request, untilLook); }), "enough");
    ASSERT_EQ(told.size(), 4U);
    for (std::size_t i = 1; i < told.size(); ++i) {
        EXPECT_TRUE(told[i].starts_with(fmt::format("the converged solution, {} of ", i))) << told[i];
    }
}

// 1000 slots x (2 + 1.5 x 10) ns + 100 points x (50 + 1.5 x 100) ns + 20 us.
TEST(Planner, TimeIsCountedAndNotMeasured)
{
    PlanCandidate c;
    EXPECT_DOUBLE_EQ(predictedTime(c, {}), 20.0);
    c.level = ModelLevel::elastic;
    c.slots = 1000;
    c.touched = 100;
    c.meanCycles = 1.5;
    c.elastic.law = volume::SmallStrain{};
    const PlanCosts costs{.small = {2, 10, 50, 100}, .finite = {4, 20, 50, 100}, .nsPerMove = 200, .usPerTick = 20};
    EXPECT_NEAR(predictedTime(c, costs), 20.0 + 17.0 + 20.0, 1e-9);
    c.elastic.law = volume::NeoHookean{};
    EXPECT_NEAR(predictedTime(c, costs), 20.0 + 34.0 + 20.0, 1e-9);
    c.level = ModelLevel::chainmail;
    EXPECT_NEAR(predictedTime(c, costs), 40.0, 1e-9);
}

// Times that follow the law are explained by it, whatever mixture of models they come from; a cost that is nowhere is zero.
TEST(TickCosts, TheFitFindsTheCostsThatMadeTheTimes)
{
    const LawCosts made{1.5, 9.0, 60.0, 0.0};
    std::vector<TickSample> samples;
    for (const double slots : {4000.0, 9000.0, 30000.0}) {
        for (const double cycles : {0.7, 1.3, 2.0}) {
            for (const double contacts : {40.0, 300.0}) {
                samples.push_back({"", {slots, cycles, contacts}, false, 0.0});
                samples.back().microseconds = tickTime(made, samples.back().work);
            }
        }
    }
    const LawCosts found = fitCosts(samples);
    EXPECT_NEAR(found.perSlot, made.perSlot, 0.02);
    EXPECT_NEAR(found.perSlotCycle, made.perSlotCycle, 0.02);
    EXPECT_NEAR(found.perContact, made.perContact, 1.0);
    EXPECT_NEAR(found.perContactCycle, 0.0, 1.0);
    EXPECT_THROW(fitCosts(std::span(samples).first(3)), std::runtime_error);
}

// Whoever asks for little gets the rigid body; the tighter the error, the dearer the model.
TEST(Planner, PicksTheCheapestThatHoldsBoth)
{
    const Plan loose = planned(0.9, 1e-3);
    ASSERT_TRUE(loose.choice);
    EXPECT_EQ(loose.candidates[*loose.choice].level, ModelLevel::spring);
    const Plan tight = planned(0.04, 1e-3);
    ASSERT_TRUE(tight.choice);
    const PlanCandidate& c = tight.candidates[*tight.choice];
    EXPECT_EQ(c.level, ModelLevel::elastic);
    EXPECT_LE(c.error, 4.0);
    EXPECT_LE(c.microseconds, 1e3);
    for (std::size_t i = 0; i < *tight.choice; ++i) {
        EXPECT_TRUE(tight.candidates[i].tried);
        EXPECT_FALSE(tight.candidates[i].holdsError && tight.candidates[i].holdsBudget);
    }
}

// Of the rigid body and of ChainMail nobody knows by how much their force is off: they hold no limit of it.
TEST(Planner, AForceThatIsNotKnownHoldsNoLimit)
{
    static const haptics::SessionModel model = studies::smallBlock();
    PlanRequest request;
    request.error = 0.9;
    request.forceError = 0.5;
    request.budget = 1e-3;
    request.speed = 0.05;
    const Plan plan = planModel(model, request, [](const std::string&) {});
    ASSERT_TRUE(plan.choice);
    EXPECT_EQ(plan.candidates[*plan.choice].level, ModelLevel::elastic);
    EXPECT_LE(plan.candidates[*plan.choice].force.value_or(100), 50.0);
    for (const PlanCandidate& c : plan.candidates) {
        EXPECT_TRUE(c.force || !c.holdsError) << c.name();
    }
}

// The search leaves candidates out, and finds what trying every one of them finds. A needle has one contact and needs fewer
// cycles than a ball: of what a ball needs, models that held both limits were left out as over the budget.
TEST(Planner, ChoosesWhatAnExhaustiveSearchChooses)
{
    for (const bool needle : {false, true}) {
        const Plan whole = planned(0.01, 4e-4, true, needle);
        for (const double error : {0.04, 0.2}) {
            const auto cheapest = std::ranges::find_if(
                whole.candidates, [&](const PlanCandidate& c) { return c.tried && c.error <= 100.0 * error; });
            ASSERT_NE(cheapest, whole.candidates.end());
            for (const double room : {0.99, 1.01}) {
                if (cheapest->level == ModelLevel::spring && room < 1.0) {
                    continue;  // no tick takes less
                }
                const Plan quick = planned(error, 1e-6 * room * cheapest->microseconds, false, needle);
                ASSERT_EQ(quick.choice.has_value(), room > 1.0) << needle << error;
                if (quick.choice) {
                    EXPECT_EQ(quick.candidates[*quick.choice].microseconds, cheapest->microseconds) << needle << error;
                }
                const auto tried = [](const Plan& p) { return std::ranges::count_if(p.candidates, &PlanCandidate::tried); };
                EXPECT_LE(tried(quick), tried(whole));
            }
        }
    }
}

// What the planner predicts from test pushes against its own solution, outside finite elements find too: within a
// factor 1.5.
TEST(Planner, PredictsTheErrorAgainstOutsideFiniteElements)
{
    auto scene = *datasets::builtInScene("plate");
    scene.model.level = ModelLevel::spring;
    auto tissue = std::make_shared<const volume::Tissue>(datasets::sceneVolume(scene));
    const auto model = std::make_shared<const haptics::SessionModel>(haptics::buildModel(scene, tissue));
    studies::AccuracySubject subject = studies::accuracySubject(model);
    const auto [outside, info] =
        studies::solvedReference("plate", subject, "neo-hookean", {PALPATE_REFERENCES, {}}, [](const std::string&) {});
    for (const double error : {0.015}) {
        PlanRequest request;
        request.error = error;
        request.speed = subject.speed;
        const Plan plan = planModel(*model, request, [](const std::string&) {});
        ASSERT_TRUE(plan.choice);
        const PlanCandidate& c = plan.candidates[*plan.choice];
        ASSERT_EQ(c.level, ModelLevel::elastic);
        const studies::TrialBody body =
            studies::trialBody(*tissue, model->surface, c.elastic.spacing, subject.poissonCap(), studies::maxTrialNodes);
        const studies::TrialResult found =
            studies::elasticTrial(body.body, subject.path, subject.speed, outside,
                                  {.window = c.elastic.window, .cycles = c.elastic.cycles, .law = c.elastic.law});
        const double ratio = studies::spreadOf(found.looks, &studies::TrialErrors::near).worst / c.error;
        EXPECT_GT(ratio, 1.0 / 1.5) << c.name();
        EXPECT_LT(ratio, 1.5) << c.name();
    }
}

// A 4 mm deep dent of a 5 mm sphere strains fat by far more than small strain is for: both laws are candidates then.
TEST(Planner, LargeStrainIsHeldAgainstFiniteStrain)
{
    const Plan plan = planned(0.9, 1e-3);
    EXPECT_GT(plan.strain, largeStrain);
    EXPECT_TRUE(plan.finiteReference);
    EXPECT_TRUE(std::ranges::any_of(plan.candidates, [](const PlanCandidate& c) {
        return c.level == ModelLevel::elastic && !volume::isSmall(c.elastic.law);
    }));
}

TEST(Planner, SaysTheNearestWhenNothingHoldsBoth)
{
    const Plan plan = planned(1e-5, 3e-5);
    EXPECT_FALSE(plan.choice);
    EXPECT_TRUE(plan.candidates[plan.nearest].tried);
}

TEST(Planner, ABudgetUnderEveryModelIsRefused)
{
    const std::string error = tests::errorOf([] { planned(0.04, 1e-6); });
    EXPECT_EQ(error, "budget: 1 us: every model takes over 20 us per tick: give more");
}

TEST(Planner, TheSameSceneGetsTheSamePlan)
{
    const Plan a = planned(0.04, 5e-4), b = planned(0.04, 5e-4);
    ASSERT_EQ(a.candidates.size(), b.candidates.size());
    EXPECT_EQ(a.choice, b.choice);
    for (std::size_t i = 0; i < a.candidates.size(); ++i) {
        EXPECT_EQ(a.candidates[i].rms, b.candidates[i].rms);
        EXPECT_EQ(a.candidates[i].microseconds, b.candidates[i].microseconds);
    }
}

}  // namespace
}  // namespace palpate::planner
