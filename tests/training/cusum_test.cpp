#include <training/cusum.h>

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace palpate::training {
namespace {

// Weights of p0 = 0.1, p1 = 0.3: ln 3 = 1.0986 and ln(7/9) = -0.2513; limits ln 18 = 2.8904 and ln 9.5 = 2.2513.
TEST(Cusum, SignalsByHand)
{
    const CusumPlan plan;
    EXPECT_NEAR(plan.failureWeight(), std::log(3), 1e-12);
    EXPECT_NEAR(plan.successWeight(), std::log(7.0 / 9.0), 1e-12);
    const auto good = cusum(plan, std::vector<bool>(9, false));
    for (int n = 0; n < 9; ++n) {
        EXPECT_NEAR(good[n].learning, 0.251314 * (n + 1), 1e-5);
        EXPECT_EQ(good[n].proficient, n == 8);
        EXPECT_EQ(good[n].alarm, 0);
    }
    const auto bad = cusum(plan, {true, true, true, false});
    EXPECT_FALSE(bad[1].alarmed);
    EXPECT_TRUE(bad[2].alarmed);
    EXPECT_EQ(bad[3].alarm, 0) << "a chart begins anew after its signal";
}

// With these figures a failure takes the learning chart to 0 from wherever it is, and three successes in a row signal: the
// mean waiting time for a run of r successes of chance q is (1 - q^r) / ((1 - q) q^r) (W. Feller, An introduction to
// probability theory and its applications I, XIII.7).
TEST(Cusum, RunLengthIsThatOfRunsOfSuccesses)
{
    const CusumPlan plan{.p0 = 0.05, .p1 = 0.6, .alpha = 0.05, .beta = 0.1};
    ASSERT_GT(plan.failureWeight(), plan.learningLimit());
    ASSERT_EQ(std::ceil(plan.learningLimit() / -plan.successWeight()), 3);
    for (const double failure : {0.01, 0.1, 0.3, 0.7}) {
        const double q = 1 - failure;
        EXPECT_NEAR(averageRunLength(plan, CusumChart::learning, failure), (1 - q * q * q) / (failure * q * q * q),
                    1e-9 * std::pow(q, -3) / failure);
    }
}

TEST(Cusum, RunLengthOfCertainSessions)
{
    const CusumPlan plan;
    EXPECT_NEAR(averageRunLength(plan, CusumChart::learning, 0), 9, 1e-12);
    EXPECT_NEAR(averageRunLength(plan, CusumChart::alarm, 1), 3, 1e-12);
    EXPECT_TRUE(std::isinf(averageRunLength(plan, CusumChart::learning, 1)));
    EXPECT_TRUE(std::isinf(averageRunLength(plan, CusumChart::alarm, 0)));
}

// Who never fails is learnt when all successes together reach the limit, also where one of them hardly moves the chart.
TEST(Cusum, RunLengthWhereTheRatesAreClose)
{
    for (const auto& [p0, p1] :
         {std::pair(0.001, 0.002), std::pair(0.01, 0.011), std::pair(0.1, 0.101), std::pair(0.03, 0.07)}) {
        const CusumPlan plan{.p0 = p0, .p1 = p1};
        const double steps = std::ceil(plan.learningLimit() / -plan.successWeight());
        EXPECT_NEAR(averageRunLength(plan, CusumChart::learning, 0) / steps, 1, 2e-2) << p0 << " and " << p1;
        // Fewer failures: later alarms, sooner learnt.
        EXPECT_LT(averageRunLength(plan, CusumChart::learning, 0.5 * p0), averageRunLength(plan, CusumChart::learning, p0));
        EXPECT_GT(averageRunLength(plan, CusumChart::alarm, 0.5 * p0), averageRunLength(plan, CusumChart::alarm, p0));
    }
}

// The charts as they are drawn, over simulated sessions, against the Markov chain. 4000 signals: the mean's standard error
// is at most 1.6 %.
TEST(Cusum, SignalsComeAsOftenAsTheMarkovChainSays)
{
    const std::vector<CusumPlan> plans{{}, {.p0 = 0.05, .p1 = 0.15, .alpha = 0.1, .beta = 0.1}, {.p0 = 0.1, .p1 = 0.13}};
    std::mt19937_64 random(20261122);
    for (const CusumPlan& plan : plans) {
        for (const double failure : {plan.p0, 0.5 * (plan.p0 + plan.p1), plan.p1}) {
            std::vector<double> sessions{0, 0}, signals{0, 0};
            std::bernoulli_distribution fails(failure);
            while (std::min(signals[0], signals[1]) < 4000 && sessions[0] < 4e6) {
                std::vector<bool> failed(100000);
                for (std::size_t n = 0; n < failed.size(); ++n) {
                    failed[n] = fails(random);
                }
                const auto chart = cusum(plan, failed);
                // Only whole runs, up to the last signal.
                double lastAlarm = 0, lastLearnt = 0;
                for (std::size_t n = 0; n < chart.size(); ++n) {
                    signals[0] += chart[n].alarmed ? 1 : 0;
                    signals[1] += chart[n].proficient ? 1 : 0;
                    lastAlarm = chart[n].alarmed ? static_cast<double>(n + 1) : lastAlarm;
                    lastLearnt = chart[n].proficient ? static_cast<double>(n + 1) : lastLearnt;
                }
                sessions[0] += lastAlarm;
                sessions[1] += lastLearnt;
            }
            const double alarm = sessions[0] / signals[0], learnt = sessions[1] / signals[1];
            EXPECT_NEAR(alarm / averageRunLength(plan, CusumChart::alarm, failure), 1, 0.1) << failure;
            EXPECT_NEAR(learnt / averageRunLength(plan, CusumChart::learning, failure), 1, 0.1) << failure;
            RecordProperty("sessions_to_alarm", std::to_string(alarm));
        }
    }
}

}  // namespace
}  // namespace palpate::training
