#include <studies/stability/fuzz.h>
#include <studies/stability/matrix.h>

#include <tests/allocations.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <bit>
#include <cmath>
#include <numbers>

namespace palpate::studies {
namespace {

// One second at 1 kHz; force(t) [N] and position(t) [m] at time t [s].
template <typename Force, typename Position>
Trace traceOf(Force force, Position position)
{
    Trace t;
    t.cap = 8.0;
    t.encoder = 30e-6;
    t.handSpring = 8.0;
    for (std::size_t i = 0; i < 1000; ++i) {
        const double time = t.time(i);
        t.force.push_back(force(time));
        t.tissue.push_back(t.force.back());
        t.position.push_back(position(time));
        t.speed.push_back(0.0);
        t.work.push_back(0.0);
    }
    return t;
}

StabilityScene second()
{
    StabilityScene scene;
    scene.from = 0.0;
    scene.to = 1.0;
    return scene;
}

Vec3 still(double)
{
    return Vec3(0.0);
}

// A wave of amplitude A on a mean of F has a ripple of 100 A / F percent, whatever its direction.
TEST(StabilityFigures, RippleIsTheAmplitudeOfAWave)
{
    for (const double amplitude : {0.0, 0.02, 0.2}) {
        const auto trace = traceOf(
            [&](double t) {
                return (2.0 + amplitude * std::sin(2 * std::numbers::pi * 40 * t)) * glm::normalize(Vec3(1, -2, 2));
            },
            still);
        EXPECT_NEAR(figureOf(Figure::ripple, trace, second()), 100.0 * amplitude / 2.0, 1e-6);
    }
}

// A ramp of s N/s changes by s / cap * 100 % per s, at any rate, less what the stiffest wall answers the motion with.
TEST(StabilityFigures, ForceStepOfARampIsItsSlope)
{
    for (const double period : {2e-3, 1e-3, 0.25e-3}) {
        Trace trace;
        trace.cap = 8.0;
        trace.period = period;
        for (double t = 0.0; t < 1.0; t += period) {
            trace.force.push_back({3.0 * t, 4.0 * t, 0.0});
            trace.position.push_back({1e-3 * t, 0.0, 0.0});
        }
        for (const double stiffest : {0.0, 2000.0, 1e4}) {
            trace.stiffest = stiffest;
            const double unexplained = std::max(0.0, 5.0 - 1e-3 * stiffest);
            EXPECT_NEAR(figureOf(Figure::forceStep, trace, second()), 100.0 * unexplained / 8.0 * 1e-3, 1e-9);
        }
    }
}

// A tool goes 4 mm behind the far face; what pushes it back has not let it through.
TEST(StabilityFigures, PopThroughIsHowDeepTheToolIsWhereNothingPushesBack)
{
    auto scene = second();
    scene.farFace = 1e-3;
    const auto way = [](double t) { return Vec3(0.0, 5e-3 * t, 0.0); };
    const auto held = traceOf([](double) { return Vec3(0.0, -1.0, 0.0); }, way);
    const auto popped = traceOf([](double t) { return Vec3(0.0, t < 0.5 ? -1.0 : 1.0, 0.0); }, way);
    EXPECT_EQ(figureOf(Figure::popThrough, held, scene), 0.0);
    EXPECT_NEAR(figureOf(Figure::popThrough, popped, scene), 4.0, 0.01);
}

TEST(StabilityFigures, RestCycleIsPeakToPeakInEncoderSteps)
{
    const auto trace =
        traceOf(still, [](double t) { return Vec3(0.0, 45e-6 * std::sin(50 * t), 1e-5 * std::cos(50 * t)); });
    EXPECT_NEAR(figureOf(Figure::restCycle, trace, second()), 3.0, 0.02);
}

// Tissue that pushes out with up to 2 N and draws in with 0.4 N pulls 5 % of a cap of 8 N, whatever a controller makes of
// it.
TEST(StabilityFigures, PullIsTheLargestForceOfTissueIntoTheBody)
{
    auto trace = traceOf([](double t) { return Vec3(3.0, t < 0.5 ? -2.0 : 0.4, 0.0); }, still);
    EXPECT_NEAR(figureOf(Figure::pull, trace, second()), 5.0, 1e-12);
    trace.force.assign(trace.force.size(), Vec3(0.0, 8.0, 0.0));
    EXPECT_NEAR(figureOf(Figure::pull, trace, second()), 5.0, 1e-12);
    trace.tissue.assign(trace.tissue.size(), Vec3(1.0, -1.0, 0.0));
    EXPECT_EQ(figureOf(Figure::pull, trace, second()), 0.0);
}

TEST(StabilityFigures, AForceThatIsNoNumberFailsEveryBound)
{
    auto trace = traceOf(still, still);
    trace.force[17].x = std::numeric_limits<double>::quiet_NaN();
    const CellResult result{{}, {Figure::energyMade, 1e9}, figureOf(Figure::energyMade, trace, second())};
    EXPECT_FALSE(result.pass());
}

// With ease e a leg of length d at speed v takes d / v + e; half of the way is done in half of the time, and while it eases
// in it goes v t^2 / (2 e).
TEST(HandPath, EasesInAndOut)
{
    const HandPath path{{0, 0, 0}, 0.0, {{{10e-3, 0, 0}, 20e-3, 0.0}}, 0.1};
    EXPECT_DOUBLE_EQ(path.seconds(), 0.6);
    EXPECT_NEAR(path.at(0.3).x, 5e-3, 1e-12);
    EXPECT_NEAR(path.at(0.05).x, 20e-3 * 0.05 * 0.05 / 0.2, 1e-12);
    EXPECT_NEAR(path.at(0.55).x, 10e-3 - 20e-3 * 0.05 * 0.05 / 0.2, 1e-12);
    EXPECT_NEAR(path.at(0.6).x, 10e-3, 1e-12);
}

// Two legs at 10 mm/s and 20 mm/s with a rest between.
TEST(HandPath, GoesFromPlaceToPlaceInStraightLines)
{
    const HandPath path{{0, 0, 0}, 0.5, {{{10e-3, 0, 0}, 10e-3, 1.0}, {{10e-3, 20e-3, 0}, 20e-3, 0.0}}};
    EXPECT_DOUBLE_EQ(path.seconds(), 0.5 + 1.0 + 1.0 + 1.0);
    EXPECT_NEAR(glm::distance(path.at(0.3), Vec3(0.0)), 0.0, 1e-12);
    EXPECT_NEAR(glm::distance(path.at(1.0), Vec3(5e-3, 0, 0)), 0.0, 1e-12);
    EXPECT_NEAR(glm::distance(path.at(2.0), Vec3(10e-3, 0, 0)), 0.0, 1e-12);
    EXPECT_NEAR(glm::distance(path.at(3.0), Vec3(10e-3, 10e-3, 0)), 0.0, 1e-12);
    EXPECT_NEAR(glm::distance(path.at(9.0), Vec3(10e-3, 20e-3, 0)), 0.0, 1e-12);
}

// Models of a few cells, made once.
StabilityModels& models()
{
    static StabilityModels all;
    return all;
}

Vec3 forceAlong(const std::string& sceneName, const std::string& methodName, Vec3 from, Vec3 to)
{
    const Cell cell{sceneName, methodName, "premium", true, 1000};
    models().prepare({cell});
    const auto& scene = models().scene(sceneName);
    const auto& method = models().method(methodName);
    const auto running = method.start({models().model(scene, method.level), haptics::deviceParameters("premium"), 1e-3});
    haptics::DeviceSample sample;
    sample.buttons = haptics::buttonDeadMan;
    Vec3 force(0.0);
    for (int i = 0; i <= 200; ++i) {
        sample.position = glm::mix(from, to, i / 200.0);
        force = running.tick(sample);
    }
    return force;
}

// Behind a plate, what looks for the nearest surface pushes on through; what remembers the side pushes back.
TEST(StabilityMethods, OnlyWhatRemembersTheSideHoldsBehindAThinPlate)
{
    const Vec3 front(0, -6e-3, 0), behind(0, 5e-3, 0);  // a ball of 3 mm, 3 mm of skin
    EXPECT_LT(forceAlong("plate-3mm", "god_object", front, behind).y, -0.1);
    EXPECT_GT(forceAlong("plate-3mm", "superposed_normals", front, behind).y, 0.1);
    EXPECT_GT(forceAlong("plate-3mm", "penalty", front, behind).y, 0.1);
}

// On a flat face all three are one spring, K d: of the same d but for half a voxel.
TEST(StabilityMethods, SurfaceMethodsAgreeOnAFlatFace)
{
    const Vec3 front(0, -6e-3, 0), deep(0, 0.5e-3, 0);  // a ball of 3 mm, 3.5 mm deep
    const double expected = forceAlong("wall-rest", "penalty", front, deep).y;
    EXPECT_NEAR(expected, -3.5, 0.05);
    EXPECT_NEAR(forceAlong("wall-rest", "god_object", front, deep).y, expected, 0.51);
    EXPECT_NEAR(forceAlong("wall-rest", "superposed_normals", front, deep).y, expected, 0.51);
}

TEST(StabilityMethods, TicksAllocateNothing)
{
    for (const auto& method : models().methods()) {
        const Cell cell{"plate-1mm", method.name, "premium", true, 1000};
        models().prepare({cell});
        const auto& scene = models().scene(cell.scene);
        const auto running =
            method.start({models().model(scene, method.level), haptics::deviceParameters("premium"), 1e-3});
        haptics::DeviceSample sample;
        sample.buttons = haptics::buttonDeadMan;
        const auto count = tests::allocationsIn([&] {
            for (int i = 0; i < 300; ++i) {
                sample.position = Vec3(0.0, -6e-3 + 4e-5 * i, 0.0);
                running.tick(sample);
            }
        });
        EXPECT_EQ(count, 0U) << method.name;
    }
}

// Pressed to 2.5 radii (a ball's middle to 9 mm), by 9 mm (a finger's to 3 mm) or onto bone and drawn back, tissue that
// pushed with over 0.3 N never pulls.
TEST(StabilityMatrix, TissueNeverPullsADeepToolIn)
{
    for (const auto& [sceneName, least] :
         {std::pair<std::string, double>{"deep-retreat", 9e-3}, {"capsule-retreat", 3e-3}, {"thin-retreat", 2.5e-3}}) {
        const Cell cell{sceneName, "elastic", "premium", true, 500};
        models().prepare({cell});
        const auto& scene = models().scene(sceneName);
        const auto& method = models().method("elastic");
        const Trace trace = runSession(cell, scene, method, models().model(scene, method.level));
        double deepest = -1.0, push = 0.0;
        for (std::size_t i = 0; i < trace.position.size(); ++i) {
            deepest = std::max(deepest, trace.position[i].y);
            push = std::max(push, -trace.tissue[i].y);
        }
        EXPECT_GT(deepest, least) << sceneName;
        EXPECT_GT(push, 0.3) << sceneName;
        EXPECT_EQ(figureOf(Figure::pull, trace, scene), 0.0) << sceneName;
    }
}

// The axis of a scene's tool reaches the method: a finger at 30 degrees has its back end above the fat.
TEST(StabilityMatrix, AFingerLiesAtItsAngle)
{
    const Cell cell{"capsule-retreat", "spring", "premium", true, 500};
    models().prepare({cell});
    const auto& scene = models().scene(cell.scene);
    const auto& method = models().method(cell.method);
    std::size_t ticks = 0;
    runSession(cell, scene, method, models().model(scene, method.level),
               [&](const haptics::DeviceSample& sample, Vec3, const RunningMethod&) {
                   EXPECT_NEAR(sample.axis.y, 0.5, 1e-12);
                   ++ticks;
               });
    EXPECT_GT(ticks, 500U);
}

TEST(StabilityMatrix, FiguresDoNotDependOnThreads)
{
    const auto cells = matrixCells(
        models(), {{"plate-1mm", "wall-rest"}, {"spring", "chainmail", "god_object"}, {"touch"}, {1000}, false});
    ASSERT_EQ(cells.size(), 12U);
    models().prepare(cells);
    std::vector<double> one(cells.size()), three(cells.size());
    const auto nothing = [](std::size_t) {};
    onThreads(
        cells.size(), 1, [&](std::size_t i) { one[i] = runCell(cells[i], models()).figure; }, nothing);
    onThreads(
        cells.size(), 3, [&](std::size_t i) { three[i] = runCell(cells[i], models()).figure; }, nothing);
    for (std::size_t i = 0; i < cells.size(); ++i) {
        EXPECT_EQ(std::bit_cast<std::uint64_t>(one[i]), std::bit_cast<std::uint64_t>(three[i])) << cells[i].id();
    }
}

TEST(StabilityMatrix, AnIdNamesItsCell)
{
    for (const Cell& cell : matrixCells(models(), {{"late", "let-go"}, {"elastic", "layers"}, {}, {500}, false})) {
        EXPECT_EQ(cellOf(models(), cell.id()).id(), cell.id());
    }
    EXPECT_THROW(cellOf(models(), "plate-1mm/elastic/premium/1000"), std::runtime_error);
    EXPECT_THROW(cellOf(models(), "nowhere/elastic/premium/grip/1000"), std::runtime_error);
}

TEST(StabilityMatrix, AnErrorOnAThreadComesBack)
{
    const auto fails = [](std::size_t i) {
        if (i == 3) {
            throw std::runtime_error("three");
        }
    };
    EXPECT_THROW(onThreads(8, 2, fails, [](std::size_t) {}), std::runtime_error);
}

// The same seeds come to the same sessions on any number of threads, and none of them hurts a hand.
TEST(StabilityFuzz, HostileSessionsNeverHurtAHand)
{
    const auto nothing = [](std::size_t) {};
    const FuzzResult one = fuzz(models(), 7, 24, 1, nothing);
    const FuzzResult two = fuzz(models(), 7, 24, 2, nothing);
    EXPECT_EQ(one.runs, 24U);
    EXPECT_GT(one.ticks, 24U * 100U);
    EXPECT_EQ(one.ticks, two.ticks);
    EXPECT_EQ(one.crashes + one.overCap + one.overSlew + one.nonFinite + one.pulled, 0U);
}

}  // namespace
}  // namespace palpate::studies
