#include <base/rank_correlation.h>
#include <sweep/design.h>
#include <sweep/plan.h>
#include <sweep/report.h>
#include <sweep/sensitivity.h>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>
#include <vector>

namespace palpate::sweep {
namespace {

std::size_t stratum(double x, std::size_t count)
{
    return static_cast<std::size_t>(x * static_cast<double>(count));
}

TEST(LatinHypercube, EveryStratumOfEveryAxisHoldsOnePoint)
{
    for (const std::size_t samples : {1U, 2U, 7U, 100U, 1000U}) {
        for (const std::uint64_t seed : {1U, 2U, 77U}) {
            const auto points = latinHypercube(samples, 5, seed);
            for (std::size_t a = 0; a < 5; ++a) {
                std::set<std::size_t> seen;
                for (const auto& p : points) {
                    EXPECT_GE(p[a], 0.0);
                    EXPECT_LT(p[a], 1.0);
                    seen.insert(stratum(p[a], samples));
                }
                EXPECT_EQ(seen.size(), samples);
            }
        }
    }
    EXPECT_NE(latinHypercube(50, 2, 1), latinHypercube(50, 2, 2));
}

// A (t, s)-sequence in base 2 (Niederreiter 1992): the first 2^m points leave no interval of length 2^-m of an axis empty,
// and in the first two axes, where t = 0, no box of volume 2^-m; a digital shift changes neither.
TEST(SobolPoints, ElementaryBoxesHoldOnePointEach)
{
    for (const std::uint64_t seed : {1U, 2U, 3U}) {
        const auto points = sobolPoints(256, 6, seed);
        for (std::size_t m = 0; m <= 8; ++m) {
            const std::size_t count = std::size_t{1} << m;
            for (std::size_t a = 0; a < 6; ++a) {
                std::set<std::size_t> seen;
                for (std::size_t i = 0; i < count; ++i) {
                    seen.insert(stratum(points[i][a], count));
                }
                EXPECT_EQ(seen.size(), count) << "axis " << a;
            }
            for (std::size_t k = 0; k <= m; ++k) {
                std::set<std::pair<std::size_t, std::size_t>> boxes;
                for (std::size_t i = 0; i < count; ++i) {
                    boxes.emplace(stratum(points[i][0], std::size_t{1} << k), stratum(points[i][1], count >> k));
                }
                EXPECT_EQ(boxes.size(), count);
            }
        }
    }
}

TEST(SaltelliPoints, EachMixedPointTakesOneCoordinateFromTheOther)
{
    constexpr std::size_t axes = 3, block = axes + 2;
    const auto points = saltelliPoints(8, axes, 5);
    ASSERT_EQ(points.size(), 8 * block);
    for (std::size_t s = 0; s < 8; ++s) {
        const auto &a = points[s * block], &b = points[s * block + 1];
        for (std::size_t i = 0; i < axes; ++i) {
            auto mixed = a;
            mixed[i] = b[i];
            EXPECT_EQ(points[s * block + 2 + i], mixed);
        }
    }
}

// How often each axis moves from one point to the next; every move is one step long.
std::vector<int> movesOf(const UnitPoints& points, std::size_t first, std::size_t last)
{
    std::vector<int> moved(points[first].size());
    for (std::size_t i = first; i < last; ++i) {
        for (std::size_t a = 0; a < moved.size(); ++a) {
            const double step = points[i + 1][a] - points[i][a];
            moved[a] += step != 0 ? 1 : 0;
            EXPECT_TRUE(step == 0 || std::abs(std::abs(step) - morrisStep) < 1e-12) << step;
        }
    }
    return moved;
}

TEST(MorrisPoints, ATrajectoryMovesEachAxisOnceByTheStep)
{
    constexpr std::size_t axes = 4;
    const auto points = morrisPoints(20, axes, 9);
    ASSERT_EQ(points.size(), 20 * (axes + 1));
    for (std::size_t t = 0; t < points.size(); t += axes + 1) {
        EXPECT_EQ(movesOf(points, t, t + axes), std::vector<int>(axes, 1));
    }
    for (const auto& p : points) {
        EXPECT_TRUE(std::ranges::all_of(p, [](double x) { return x >= 0 && x < 1; }));
    }
}

std::vector<double> outputsAt(const UnitPoints& points, double (*f)(const std::vector<double>&))
{
    std::vector<double> out;
    std::ranges::transform(points, std::back_inserter(out), f);
    return out;
}

// Ishigami and Homma 1990 with a = 7, b = 0.1: S = (0.3139, 0.4424, 0), T = (0.5576, 0.4424, 0.2437).
double ishigami(const std::vector<double>& u)
{
    const auto x = [&](std::size_t i) { return std::numbers::pi * (2 * u[i] - 1); };
    return std::sin(x(0)) + 7 * std::pow(std::sin(x(1)), 2) + 0.1 * std::pow(x(2), 4) * std::sin(x(0));
}

TEST(SobolIndices, OfTheIshigamiFunctionAreTheClosedForm)
{
    const auto indices = sobolIndices(outputsAt(saltelliPoints(4096, 3, 1), ishigami), 3);
    const std::vector<double> first{0.3139, 0.4424, 0.0}, total{0.5576, 0.4424, 0.2437};
    ASSERT_EQ(indices.size(), 3U);
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(indices[i].first, first[i], 0.02);
        EXPECT_NEAR(indices[i].total, total[i], 0.02);
        EXPECT_LT(std::abs(indices[i].total - total[i]), 3 * indices[i].totalError + 0.01);
        EXPECT_GT(indices[i].firstError, 0.0);
    }
}

const std::vector<double> gParameters{0, 1, 4.5, 9, 99};

// Sobol's g-function: V_i = 1 / (3 (1 + a_i)^2), S_i = V_i / V, T_i = V_i prod_{j != i} (1 + V_j) / V.
double gFunction(const std::vector<double>& u)
{
    double out = 1;
    for (std::size_t i = 0; i < u.size(); ++i) {
        out *= (std::abs(4 * u[i] - 2) + gParameters[i]) / (1 + gParameters[i]);
    }
    return out;
}

TEST(SobolIndices, OfTheGFunctionAreTheClosedForm)
{
    const std::size_t axes = gParameters.size();
    const auto indices = sobolIndices(outputsAt(saltelliPoints(8192, axes, 4), gFunction), axes);
    double all = 1;
    for (const double a : gParameters) {
        all *= 1 + 1 / (3 * (1 + a) * (1 + a));
    }
    for (std::size_t i = 0; i < axes; ++i) {
        const double own = 1 / (3 * (1 + gParameters[i]) * (1 + gParameters[i]));
        EXPECT_NEAR(indices[i].first, own / (all - 1), 0.02);
        EXPECT_NEAR(indices[i].total, own * all / (1 + own) / (all - 1), 0.02);
    }
}

TEST(SobolIndices, LeaveOutSamplesWithAValueThatIsNone)
{
    const auto points = saltelliPoints(512, 3, 1);
    auto outputs = outputsAt(points, ishigami);
    auto shorter = outputs;
    shorter.erase(shorter.begin() + 5, shorter.begin() + 10);
    outputs[7] = std::nan("");
    const auto some = sobolIndices(outputs, 3), without = sobolIndices(shorter, 3);
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_EQ(some[i].first, without[i].first);
    }
    EXPECT_TRUE(sobolIndices(std::vector<double>(512 * 5, 1.0), 3).empty()) << "nothing varies";
}

// f = sum c_i x_i has effects c_i without spread; with a product of two axes theirs depend on each other.
TEST(MorrisEffects, OfALinearFunctionAreItsSlopesAndOfAProductSpread)
{
    const auto points = morrisPoints(30, 3, 2);
    const auto linear = morrisEffects(points, outputsAt(points, [](const auto& x) { return 3 * x[0] - 2 * x[1]; }));
    EXPECT_NEAR(linear[0].mean, 3, 1e-9);
    EXPECT_NEAR(linear[1].mean, -2, 1e-9);
    EXPECT_NEAR(linear[1].absolute, 2, 1e-9);
    EXPECT_NEAR(linear[2].absolute, 0, 1e-9);
    EXPECT_NEAR(linear[0].spread, 0, 1e-6);
    const auto product = morrisEffects(points, outputsAt(points, [](const auto& x) { return x[0] * x[1]; }));
    EXPECT_GT(product[0].spread, 0.1);
    EXPECT_NEAR(product[2].absolute, 0, 1e-9);
}

SweepPlan screening()
{
    const auto axis = [](const char* name, std::vector<KeyValue> values) {
        Axis a;
        a.name = name;
        a.values = std::move(values);
        a.high = 1;
        return a;
    };
    SweepPlan plan;
    plan.design = DesignKind::morris;
    plan.axes = {axis("a", {}), axis("b", {0.0, 1.0}),          axis("w", {"x", "y"}), axis("k", {}),
                 axis("l", {}), axis("three", {0.0, 0.5, 1.0}), axis("one", {0.0})};
    plan.axes[3].whole = plan.axes[4].whole = plan.axes[4].log = true;
    plan.axes[4].low = 1;
    plan.axes[4].high = 100;
    plan.outputs = {{"y", ""}};
    plan.points = morrisPoints(6, plan.axes.size(), 2);
    return plan;
}

// y = a + b + w_y + k + ln(l) / ln(100) + three has an effect of 1 over the whole range of each axis, although axes of
// values and of whole numbers move by more than Morris's step. An axis with one value has none, and leaves the ranking
// there.
TEST(MorrisEffects, OfListsWordsAndWholeNumbersAreOverTheRangeToo)
{
    const SweepPlan plan = screening();
    std::vector<std::optional<SweepRow>> rows;
    for (std::size_t i = 0; i < plan.cases(); ++i) {
        const auto v = sweepPoint(plan, i).variables;
        SweepRow& row = rows.emplace_back(SweepRow()).value();
        row.index = i;
        row.outputs = {v.at("a") + v.at("b") + v.at("w_y") + v.at("k") + std::log(v.at("l")) / std::log(100.0) +
                       v.at("three")};
    }
    const auto ranked = sensitivity(plan, rows)["outputs"]["y"];
    ASSERT_EQ(ranked.size(), 7U);
    for (const auto& entry : ranked) {
        EXPECT_NEAR(entry["values"][0].get<double>(), entry["axis"] == "one" ? 0 : 1, 1e-9) << entry;
        EXPECT_NEAR(entry["values"][2].get<double>(), 0, 1e-6) << entry;
    }
}

std::vector<std::optional<SweepRow>> rowsOf(const SweepPlan& plan, double (*f)(const std::vector<double>&))
{
    std::vector<std::optional<SweepRow>> rows(plan.cases());
    for (std::size_t i = 0; i < rows.size(); ++i) {
        rows[i] = SweepRow();
        rows[i]->index = i;
        rows[i]->outputs = {f(plan.points[i])};
    }
    return rows;
}

// One of 8 samples has a case that failed: the ranking is of 7, and says so. Where there is no ranking, every axis has
// null.
TEST(Sensitivity, SaysHowManySamplesAreWholeAndNullWhereThereIsNone)
{
    for (const DesignKind kind : {DesignKind::saltelli, DesignKind::morris, DesignKind::sobol, DesignKind::grid}) {
        SweepPlan plan;
        plan.design = kind;
        plan.axes.resize(2);
        plan.axes[0].name = "a";
        plan.axes[1].name = "b";
        plan.axes[0].high = plan.axes[1].high = 1;
        plan.axes[0].steps = plan.axes[1].steps = 3;
        plan.outputs = {{"y", ""}};
        plan.points = kind == DesignKind::saltelli ? saltelliPoints(8, 2, 1)
                      : kind == DesignKind::morris ? morrisPoints(8, 2, 1)
                      : kind == DesignKind::sobol
                          ? sobolPoints(8, 2, 1)
                          : UnitPoints{{0, 0}, {0, 1}, {1, 0}, {1, 1}, {2, 0}, {2, 1}, {0, 2}, {1, 2}};
        auto rows = rowsOf(plan, [](const std::vector<double>& u) { return 3 * u[0] + u[1]; });
        rows[3]->error = "no";
        const auto some = sensitivity(plan, rows);
        EXPECT_EQ(some["samples"], 8) << some;
        EXPECT_EQ(some["used"]["y"], 7) << some;
        const auto constant = sensitivity(plan, rowsOf(plan, [](const std::vector<double>&) { return 0.1; }));
        EXPECT_EQ(constant["used"]["y"], 8);
        ASSERT_EQ(constant["outputs"]["y"].size(), 2U) << constant;
        for (const auto& entry : constant["outputs"]["y"]) {
            EXPECT_EQ(entry["values"].size(), constant["measures"].size()) << constant;
            EXPECT_TRUE(std::ranges::all_of(entry["values"], [](const auto& v) { return v.is_null(); })) << constant;
        }
    }
}

TEST(MorrisEffects, AreNoneWhereAnAxisMovesAndNoCaseIsThere)
{
    const UnitPoints points{{0, 0}, {1, 0}, {1, 1}};
    EXPECT_TRUE(morrisEffects(points, std::vector<double>{1, std::nan(""), 3}).empty());
    EXPECT_EQ(morrisEffects({{0, 0}, {1, 0}, {1, 0}}, std::vector<double>{1, 3, 3}).at(0).mean, 2);
}

// Over a whole grid the shares of an additive function add up to 1, each its own variance.
TEST(MainEffect, OfAnAdditiveFunctionIsItsShareOfTheVariance)
{
    std::vector<double> outputs;
    std::vector<std::size_t> i1, i2;
    for (std::size_t i = 0; i < 5; ++i) {
        for (std::size_t j = 0; j < 7; ++j) {
            outputs.push_back(3.0 * static_cast<double>(i) + static_cast<double>(j * j));
            i1.push_back(i);
            i2.push_back(j);
        }
    }
    const double variance1 = 9.0 * 2.0;  // of 0 .. 4
    double mean = 91.0 / 7.0, variance2 = 0;
    for (std::size_t j = 0; j < 7; ++j) {
        variance2 += std::pow(static_cast<double>(j * j) - mean, 2) / 7;
    }
    EXPECT_NEAR(mainEffect(outputs, i1), variance1 / (variance1 + variance2), 1e-12);
    EXPECT_NEAR(mainEffect(outputs, i2), variance2 / (variance1 + variance2), 1e-12);
}

// The mean of equal values is off by a rounding, and what is left of them is no variance.
TEST(MainEffect, WhatDoesNotVaryDependsOnNothing)
{
    std::vector<std::size_t> levels;
    for (std::size_t i = 0; i < 9; ++i) {
        levels.push_back(i % 3);
    }
    for (const double value : {0.0, 0.1, 1.1, -3e7, 1e-200}) {
        const std::vector<double> same(9, value);
        EXPECT_TRUE(std::isnan(mainEffect(same, levels))) << value;
        EXPECT_TRUE(sobolIndices(std::vector<double>(4 * 9, value), 2).empty()) << value;
    }
    std::vector<double> little(9, 0.1);
    little[0] = 0.1 + 1e-9;
    EXPECT_GT(mainEffect(little, levels), 0.0);
}

TEST(RankCorrelation, SeesOrderOnlyAndSharesTies)
{
    std::vector<double> x, rising, falling;
    for (int i = 0; i < 20; ++i) {
        x.push_back(i);
        rising.push_back(std::exp(0.3 * i));
        falling.push_back(-std::pow(i, 3));
    }
    EXPECT_NEAR(base::rankCorrelation(x, rising), 1, 1e-12);
    EXPECT_NEAR(base::rankCorrelation(x, falling), -1, 1e-12);
    // Ranks 1.5, 1.5, 3, 4 against 1, 2, 3, 4: Pearson's r of them is 4.5 / sqrt(4.5 * 5).
    EXPECT_NEAR(base::rankCorrelation(std::vector<double>{1, 1, 2, 3}, std::vector<double>{5, 6, 7, 8}),
                4.5 / std::sqrt(22.5), 1e-12);
}

}  // namespace
}  // namespace palpate::sweep
