#include <studies/thesis/tasks_measure.h>
#include <studies/thesis/tasks_scene.h>
#include <studies/thesis/tasks_search.h>
#include <studies/thesis/tasks_thesis.h>

#include <tests/error_of.h>

#include <glm/geometric.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

namespace palpate::studies {
namespace {

struct Points {
    std::vector<double> x, y;
};

// NIST StRD data set Norris; certified values of the same page (linear regression, lower level of difficulty).
Points norris()
{
    return {{0.2, 337.4, 118.2, 884.6, 10.1,  226.5, 666.3, 996.3, 448.6, 777.0, 558.2, 0.4,
             0.6, 775.5, 666.9, 338.0, 447.5, 11.6,  556.0, 228.1, 995.8, 887.6, 120.2, 0.3,
             0.3, 556.8, 339.1, 887.2, 999.0, 779.0, 11.1,  118.3, 229.2, 669.1, 448.9, 0.5},
            {0.1, 338.8, 118.1, 888.0, 9.2,   228.1, 668.5, 998.5, 449.1, 778.9, 559.2, 0.3,
             0.1, 778.1, 668.8, 339.3, 448.9, 10.8,  557.7, 228.3, 998.0, 888.8, 119.6, 0.3,
             0.6, 557.6, 339.3, 888.0, 998.5, 778.9, 10.2,  117.6, 228.9, 668.4, 449.2, 0.2}};
}

TEST(TasksFit, AgreesWithTheCertifiedValuesOfNorris)
{
    const Points p = norris();
    const LineFit fit = fitLine(p.x, p.y);
    ASSERT_EQ(fit.points, 36U);
    EXPECT_NEAR(fit.slope, 1.00211681802045, 1e-12);
    EXPECT_NEAR(fit.slopeError, 0.429796848199937e-3, 1e-13);
    EXPECT_NEAR(fit.intercept, -0.262323073774029, 1e-10);
    EXPECT_NEAR(fit.interceptError, 0.232818234301152, 1e-11);
    EXPECT_NEAR(fit.residual, 0.884796396144373, 1e-11);
    EXPECT_NEAR(fit.rSquared, 0.999993745883712, 1e-13);
    EXPECT_FALSE(fit.flat());
}

// The thesis fitted its Table 2 with "Origin". Its A1 to A4 come out to the last digit that Table 4 has.
TEST(TasksFit, TurnsTheThesissTable2IntoItsTable4)
{
    for (const char* event : {"A1", "A2", "A3", "A4"}) {
        const auto& s = *thesisSeries(event);
        const LineFit fit = fitLine(s.objects, s.seconds);
        EXPECT_NEAR(fit.slope, s.line.slope, 0.5e-5 * thesisUnit) << event;
        EXPECT_NEAR(fit.slopeError, s.line.slopeError, 0.5e-9 * thesisUnit) << event;
        EXPECT_NEAR(fit.intercept, s.line.intercept, 0.51e-5 * thesisUnit) << event;
        EXPECT_NEAR(fit.interceptError, s.line.interceptError, 0.5e-5 * thesisUnit) << event;
    }
}

TEST(TasksFit, PointsOnALineHaveNoErrors)
{
    const std::vector<double> x{1, 2, 4, 1e6}, y{-1, -3, -7, 1 - 2e6};
    const LineFit fit = fitLine(x, y);
    EXPECT_NEAR(fit.slope, -2.0, 1e-12);
    EXPECT_NEAR(fit.intercept, 1.0, 1e-6);
    EXPECT_NEAR(fit.slopeError, 0.0, 1e-12);
    EXPECT_NEAR(fit.rSquared, 1.0, 1e-12);
    EXPECT_NE(tests::errorOf([&] { fitLine(std::vector<double>{1, 2}, std::vector<double>{1, 2}); }), "");
    EXPECT_NE(tests::errorOf([&] { fitLine(std::vector<double>{3, 3, 3}, std::vector<double>{1, 2, 3}); }), "");
}

// Quantiles of any table of Student's t.
TEST(TasksFit, QuantilesAreThoseOfTables)
{
    EXPECT_NEAR(studentQuantile(1), 12.706, 1e-3);
    EXPECT_NEAR(studentQuantile(12), 2.179, 1e-3);
    EXPECT_NEAR(studentQuantile(1'000'000), 1.960, 1e-3);
}

// Of flat data 95 % are found flat, whatever the spacing of the points; data that rise by far more than their noise never.
TEST(TasksFit, FlatDataAreFoundFlatNineteenTimesInTwenty)
{
    std::mt19937 random(7);
    std::normal_distribution<double> noise;
    const std::vector<double> x{25, 50, 100, 200, 400, 600, 1e3, 1e4, 1e5, 1e6};
    constexpr int trials = 4000;
    int flat = 0, flatThoughSteep = 0;
    for (int i = 0; i < trials; ++i) {
        std::vector<double> level, steep;
        for (const double at : x) {
            level.push_back(300.0 + noise(random));
            steep.push_back(level.back() + 1e-4 * at);
        }
        flat += fitLine(x, level).flat() ? 1 : 0;
        flatThoughSteep += fitLine(x, steep).flat() ? 1 : 0;
    }
    const double sigma = std::sqrt(trials * 0.95 * 0.05);
    EXPECT_NEAR(flat, 0.95 * trials, 4.0 * sigma);
    EXPECT_EQ(flatThoughSteep, 0);
}

// The numbers of chapter V: Y_F = 0.0459 ms, Y_MT = Y_AF = 0.026 ms, equation 29 without its monitoring: 1.596 (0.1 ms).
TEST(TasksModel, GivesTheNumbersOfTheThesis)
{
    const TaskModel m = thesisModel();
    EXPECT_NEAR(m.feedback.intercept, 0.0459e-3, 0.0003e-3);
    EXPECT_NEAR(m.feedback.slope, 0.0, 1e-12);
    EXPECT_NEAR(m.monitoring.intercept, 0.026e-3, 0.0005e-3);
    EXPECT_NEAR(m.additional.intercept, 0.026e-3, 0.0005e-3);
    EXPECT_NEAR(m.servo().at(600), (1.259 + 0.00975 * 600) * thesisUnit, 0.01e-3);
    EXPECT_NEAR(m.total().intercept - m.monitoring.intercept, 1.596 * thesisUnit, 0.002e-3);
}

// Taken over lines the model is A7's line, whatever was measured.
TEST(TasksModel, AddsUpToTheEventWithEverythingOn)
{
    std::mt19937 random(3);
    std::uniform_real_distribution<double> value(-1, 1);
    for (int i = 0; i < 100; ++i) {
        std::vector<EventLine> lines;
        for (const char* event : {"A1", "A2", "A4", "A6", "A7", "A9"}) {
            lines.push_back({event, {value(random), value(random)}});
        }
        const TaskModel m = taskModel(lines);
        EXPECT_NEAR(m.total().slope, lines[4].line.slope, 1e-12);
        EXPECT_NEAR(m.total().intercept, lines[4].line.intercept, 1e-12);
        EXPECT_NEAR((m.servo().at(7) + m.graphics.at(7)), lines[0].line.at(7), 1e-12);
    }
    EXPECT_NE(tests::errorOf([] { taskModel({}); }).find("needs event"), std::string::npos);
}

// Pieces of the balls' label that hang together, corners included.
std::size_t pieces(volume::LabelImage image, std::uint16_t label)
{
    std::size_t count = 0;
    std::vector<Index3> open;
    volume::forEachIndex(Index3(1), image.size - 2, [&](Index3 n) {
        if (image.values[image.offset(n)] != label) {
            return;
        }
        ++count;
        open.assign(1, n);
        image.values[image.offset(n)] = 0;
        while (!open.empty()) {
            const Index3 at = open.back();
            open.pop_back();
            volume::forEachIndex(at - 1, at + 1, [&](Index3 m) {
                if (image.values[image.offset(m)] == label) {
                    image.values[image.offset(m)] = 0;
                    open.push_back(m);
                }
            });
        }
    });
    return count;
}

TEST(InclusionBlock, HasAsManySeparateBallsAsAskedFor)
{
    for (const std::size_t n : {1U, 25U, 27U, 600U, 4097U, 20000U}) {
        const auto image = inclusionLabels({n, 0, 5});
        EXPECT_EQ(pieces(image, 3), n);
        EXPECT_EQ(image.values, inclusionLabels({n, 0, 5}).values) << "same spec, same block";
        EXPECT_EQ(inclusionsOf({n, 0, 5}).size(), n);
    }
    EXPECT_NE(inclusionLabels({600, 0, 5}).values, inclusionLabels({600, 0, 6}).values);
}

// Whatever their number they fill about a tenth.
TEST(InclusionBlock, BallsFillATenthWhateverTheirNumber)
{
    for (const std::size_t n : {27U, 125U, 729U, 32768U}) {
        const auto image = inclusionLabels({n, 0, 1});
        const auto balls = static_cast<double>(std::ranges::count(image.values, 3));
        const auto all = balls + static_cast<double>(std::ranges::count(image.values, 1));
        EXPECT_NEAR(balls / all, 0.11, 0.04) << n;
    }
}

// A list of balls and the labels say the same.
TEST(InclusionBlock, VoxelsAreBallsWhereTheListSaysSo)
{
    const InclusionSpec spec{300, 0, 2};
    const auto image = inclusionLabels(spec);
    const ObjectScene scene(inclusionsOf(spec), 100.0);
    std::size_t different = 0;
    volume::forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        const bool ball = image.values[image.offset(n)] == 3;
        const double nudge = 1e-9;  // off a surface that goes through the voxel's middle
        const auto p = image.affine.toPatient(Vec3(n)) + nudge;
        const bool listed = std::ranges::any_of(
            scene.objects(), [&](const PlacedInclusion& i) { return glm::distance(p, i.centre) < i.radius; });
        different += ball != listed ? 1 : 0;
    });
    EXPECT_LT(different, 5U);
}

TEST(InclusionBlock, RefusesMoreBallsThanVoxelsCanTellApart)
{
    EXPECT_NE(tests::errorOf([] { inclusionLabels({1000, 39, 1}); }).find("40 voxels"), std::string::npos);
    EXPECT_NE(tests::errorOf([] { inclusionLabels({0, 64, 1}); }), "");
    EXPECT_EQ(voxelsFor(1'000'000), 400);
}

// Of balls that do not overlap at most one holds the tip; the force is K d out of it, and none outside.
TEST(ObjectScene, PushesOutOfTheOneObjectThatHoldsTheTip)
{
    const double k = 500.0;
    const ObjectScene scene(inclusionsOf({200, 0, 4}), k);
    std::mt19937 random(11);
    std::uniform_real_distribution<double> side(-0.5 * inclusionBlockSide, 0.5 * inclusionBlockSide);
    int inside = 0;
    for (int i = 0; i < 2000; ++i) {
        const Vec3 tip(side(random), side(random) + 0.5 * inclusionBlockSide, side(random));
        const auto found = scene.collide(tip);
        const auto holds = std::ranges::find_if(
            scene.objects(), [&](const PlacedInclusion& o) { return glm::distance(o.centre, tip) < o.radius; });
        if (holds == scene.objects().end()) {
            EXPECT_EQ(found, ObjectScene::none);
            EXPECT_EQ(scene.feedback(found, tip), Vec3(0.0));
            continue;
        }
        ++inside;
        ASSERT_EQ(found, static_cast<std::size_t>(holds - scene.objects().begin()));
        const Vec3 force = scene.feedback(found, tip);
        EXPECT_NEAR(glm::length(force), k * (holds->radius - glm::distance(holds->centre, tip)), 1e-9);
        EXPECT_GE(glm::dot(force, tip - holds->centre), 0.0);
    }
    EXPECT_GT(inside, 50);
}

// Finds any threshold, and asks about twice the logarithm.
TEST(TasksSearch, FindsTheLargestThatHolds)
{
    for (std::uint64_t threshold = 1; threshold < 3000; threshold += 7) {
        int asked = 0;
        const auto found = largestThatHolds(1, 2048, 0.0, [&](std::uint64_t n) {
            ++asked;
            EXPECT_LE(n, 2048U);
            return n <= threshold;
        });
        EXPECT_EQ(found, std::min<std::uint64_t>(threshold, 2048));
        EXPECT_LE(asked, 24);
    }
    EXPECT_FALSE(largestThatHolds(5, 100, 0.0, [](std::uint64_t) { return false; }));
    EXPECT_FALSE(largestThatHolds(5, 4, 0.0, [](std::uint64_t) { return true; }));
    const auto near = largestThatHolds(1, 1'000'000, 0.1, [](std::uint64_t n) { return n <= 700'000; });
    ASSERT_TRUE(near);
    EXPECT_LE(*near, 700'000U);
    EXPECT_GE(*near, 630'000U);
}

// Table 3 decides what counts: everything but the monitoring where it is off.
TEST(TasksMeasure, MonitoringCountsOnlyWhereTable3HasIt)
{
    std::array<double, haptics::taskCount> task{};
    for (std::size_t i = 0; i < task.size(); ++i) {
        task[i] = std::pow(2.0, static_cast<double>(i));
    }
    const double h6 = task[static_cast<std::size_t>(haptics::Task::h6)];
    const double all = std::pow(2.0, static_cast<double>(task.size())) - 1.0 + 0.5;
    for (const auto& event : taskEvents) {
        const bool monitored = event.name == "A7" || event.name == "A8";
        EXPECT_EQ(countedWork(event, task, 0.5), monitored ? all : all - h6) << event.name;
    }
}

// In a loop over objects H3 takes the longer the more there are; in a volume with as many inclusions nothing does.
TEST(TasksMeasure, OnlyTheLoopGrowsWithTheObjects)
{
    const auto events = std::array{taskEvents[3]};  // A4: not touching
    const auto h3 = static_cast<std::size_t>(haptics::Task::h3);
    const auto loop = [&](std::size_t n) {
        return timeEvents(ObjectScene(inclusionsOf({n, 0, 1}), 500.0), {}, events, {1}).at(0).tasks[h3];
    };
    const double few = loop(100), many = loop(100'000);
    EXPECT_GT(many, 30.0 * few) << "1000 times as many objects";
    datasets::ModelSettings spring;
    spring.level = datasets::ModelLevel::spring;
    const auto volume = [&](std::size_t n) {
        auto model = haptics::buildModel(inclusionScene(spring), inclusionTissue({n, 64, 1}));
        return timeEvents(model, events, nullptr, {1}).at(0).p50;
    };
    EXPECT_LT(volume(4000), 10.0 * volume(4));
}

// Where haptics are off nothing collides and nothing deforms; where they are on and the needle is in the block, it does.
TEST(TasksMeasure, EventsRunWhatTable3Says)
{
    datasets::ModelSettings chainmail;
    chainmail.level = datasets::ModelLevel::chainmail;
    auto model = haptics::buildModel(inclusionScene(chainmail), inclusionTissue({50, 0, 1}));
    const auto times = timeEvents(model, eventsWith(taskEvents, false), nullptr, {1});
    ASSERT_EQ(times.size(), 7U);
    const auto of = [&](std::string_view event, haptics::Task task) {
        return std::ranges::find(times, event, &EventTimes::event)->tasks[static_cast<std::size_t>(task)];
    };
    for (const char* off : {"A6", "A12", "A14"}) {
        EXPECT_EQ(of(off, haptics::Task::h3), 0.0) << off;
        EXPECT_EQ(of(off, haptics::Task::deform), 0.0) << off;
    }
    EXPECT_EQ(of("A6", haptics::Task::h7), 0.0);
    EXPECT_GT(of("A12", haptics::Task::h7), 0.0);
    EXPECT_GT(of("A2", haptics::Task::deform), 5.0 * of("A4", haptics::Task::deform));
    for (const auto& t : times) {
        EXPECT_EQ(t.publish, 0.0) << t.event;
        EXPECT_GT(t.process, 0.0) << t.event;
        EXPECT_LE(t.p50, t.p99) << t.event;
    }
}

}  // namespace
}  // namespace palpate::studies
