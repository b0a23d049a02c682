// Level `elastic` in the tick: its force, its way down the ladder, and what replays and hands may rely on.
#include "models.h"
#include "synthetic_session.h"

#include <tests/allocations.h>

#include <haptics/replay.h>
#include <haptics/servo.h>
#include <haptics/simulation.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <thread>
#include <vector>

namespace palpate::haptics {
namespace {

constexpr double ballRadius = 10e-3;
constexpr double thickness = 60e-3;  // of the block
constexpr int rampUp = 500;          // ticks of the stabiliser's ramp, and more

const std::string homogeneousScene =
    tests::sphereOnBlock("structure = \"base\"\naim_mm = [0, 55, 0]\n[volume.parameters]\ntumours = 0\n");

const SessionModel& homogeneous()
{
    static const auto model = tests::modelOf(homogeneousScene);
    return model;
}

// The tip so deep in the block's front, `aside` along x [m]; of a ball its foremost point.
DeviceSample at(double depth, double aside = 0.0, double radius = ballRadius)
{
    DeviceSample s;
    s.position = {aside, depth - radius, 0};
    s.axis = {0, 1, 0};
    s.buttons = buttonDeadMan;
    return s;
}

// Ticks one after the other through a session: waits in the air, presses, drags aside, lets go.
std::vector<DeviceSample> pressAndDrag(double depth, double radius = ballRadius)
{
    std::vector<DeviceSample> samples(rampUp, at(-2e-3, 0.0, radius));
    for (int i = 0; i < 400; ++i) {
        samples.push_back(at(depth * std::min(1.0, i / 300.0), 0.0, radius));
    }
    for (int i = 0; i < 600; ++i) {
        samples.push_back(at(depth, 50e-6 * i, radius));
    }
    for (int i = 0; i < 300; ++i) {
        samples.push_back(at(depth - 60e-6 * i, 30e-3, radius));
    }
    return samples;
}

// A ball that is lifted while the tissue is not at rest, and goes on beyond the body on each side: where the lattice ends,
// and the windows that follow it go on.
TEST(ElasticTick, AToolBesideTheBodyIsBesideTheLatticeToo)
{
    const auto model =
        tests::modelOf(tests::sphereOnBlock("structure = \"base\"\naim_mm = [0, 55, 0]\n[model]\nrelaxation = "
                                            "true\n[volume.parameters]\ntumours = 0\nwidth_mm = 250\n"));
    for (const Vec3 way : {Vec3(1, 0, 0), Vec3(0, 1, 0)}) {
        Simulation simulation(model);
        for (int i = 0; i < 300; ++i) {
            simulation.tick(at(4e-3 * std::min(1.0, i / 100.0)));
        }
        DeviceSample sample = at(-40e-3);
        for (int i = 0; i < 300; ++i) {
            sample.position += 1e-3 * way;
            sample.position.y = way.y > 0.0 && i > 100 ? sample.position.y : std::min(sample.position.y, -40e-3);
            sample.position.x = way.y > 0.0 ? 150e-3 : sample.position.x;
            ASSERT_TRUE(std::isfinite(glm::length(simulation.tick(sample).total))) << i;
        }
    }
}

// Hertz, and the first term of what a base at depth H adds: F = 4/3 E / (1 - nu^2) sqrt(R) d^1.5 (1 - 2 a0 chi / pi) with
// chi = sqrt(R d) / H. Within 10 %: the ball is 2 to 4 % of its depth inside the tissue.
// Source: E. K. Dimitriadis and others, "Determination of elastic moduli of thin layers of soft material using the atomic
// force microscope", Biophys. J. 82, 2002.
TEST(ElasticTick, SphereOnAHomogeneousBlockFeelsHertz)
{
    const auto& model = homogeneous();
    ASSERT_EQ(model.scene.model.level, datasets::ModelLevel::elastic);
    const auto& fat = model.tissue->table().rows[*model.tissue->table().find("fat")];
    const double nu = std::min(fat.poissonRatio, model.scene.model.elastic.poissonCap);
    for (const double depth : {1e-3, 2e-3}) {
        Simulation simulation(model);
        for (int i = 0; i < rampUp; ++i) {
            simulation.tick(at(-2e-3));
        }
        for (int i = 0; i < 400; ++i) {
            simulation.tick(at(std::min(depth, 20e-6 * i)));
        }
        const Vec3 force = simulation.tick(at(depth)).total;
        const double a0 = -(1.2876 - 1.4678 * nu + 1.3442 * nu * nu) / (1.0 - nu);
        const double base = 1.0 - 2.0 * a0 * std::sqrt(ballRadius * depth) / thickness / std::numbers::pi;
        const double hertz = 4.0 / 3.0 * fat.youngsModulus / (1.0 - nu * nu) * std::sqrt(ballRadius) * std::pow(depth, 1.5);
        EXPECT_NEAR(-force.y, hertz * base, 0.1 * hertz * base) << depth;
        EXPECT_LT(std::hypot(force.x, force.z), 0.03 * hertz) << depth;
    }
}

// A tool at a steady depth moves on with its windows, 30 mm over windows of 28 mm: of that little is felt. The force never
// steps by over 11 % of what it is, a thirtieth of the slew limit, and stays what it was in the middle of the block to 10
// %.
TEST(ElasticTick, MovingWindowsAreNotFelt)
{
    Simulation simulation(homogeneous());
    const auto samples = pressAndDrag(4e-3);
    Vec3 before(0.0);
    double start = 0.0;
    double most = 0.0;
    for (std::size_t i = 0; i < rampUp + 1000; ++i) {
        const Vec3 now = simulation.tick(samples[i]).total;
        if (i == rampUp + 400) {
            start = glm::length(now);
        }
        if (i > rampUp + 400) {
            EXPECT_LT(glm::distance(now, before), 0.11 * start) << "tick " << i;
            EXPECT_NEAR(glm::length(now), start, 0.1 * start) << "tick " << i;
            most = std::max(most, glm::distance(now, before));
        }
        before = now;
    }
    EXPECT_GT(start, 0.05);
    EXPECT_GT(most, 0.0);
}

// The needle takes the skin in with it before that gives way, and the tissue along when it goes on: at the tip, and less
// the further away.
TEST(ElasticTick, NeedleTakesTheTissueAlong)
{
    const auto& model = tests::layeredNeedle();
    ASSERT_EQ(model.scene.model.level, datasets::ModelLevel::elastic);
    Simulation simulation(model);
    const auto& grid = model.lattice.grid;
    const auto shiftAt = [&](Vec3 rest) {
        const Index3 node(glm::round((rest - grid.origin) / grid.spacing));
        return static_cast<double>(simulation.shape().u()[grid.offset(node)].y);
    };
    double dent = 0.0;
    double dentBeside = 0.0;
    bool pierced = false;
    double carried = 0.0;
    for (int i = 0; i < 1500; ++i) {
        const TickRecord& r = simulation.tick(at(-10e-3 + 20e-6 * i, 0.0, 0.0));
        pierced = pierced || r.phase == Phase::inserted;
        if (!pierced && r.phase == Phase::contact) {
            dent = shiftAt({0.0, 1e-3, 0.0});
            dentBeside = shiftAt({12e-3, 1e-3, 0.0});
        }
        if (pierced && r.inserted > 5e-3) {
            carried = std::max(carried, shiftAt(r.proxy));
        }
    }
    EXPECT_TRUE(pierced);
    EXPECT_GT(dent, 0.3e-3);
    EXPECT_LT(dentBeside, 0.5 * dent);
    EXPECT_GT(carried, 0.1e-3);
}

// The deeper a ball is pressed, the harder the tissue pushes it out, straight along the way: down to its own radius, where
// the tissue closes over its middle, and beyond, to twice that.
void expectForceToRiseDownTo(double deepest)
{
    for (const double speed : {20e-3, 200e-3}) {
        Simulation simulation(homogeneous());
        for (int i = 0; i < rampUp; ++i) {
            simulation.tick(at(-2e-3));
        }
        double most = 0.0;
        for (double depth = 0.0; depth < deepest; depth += speed * tickSeconds) {
            const Vec3 force = simulation.tick(at(depth)).total;
            ASSERT_GE(-force.y, 0.95 * most) << depth << " m at " << speed << " m/s";
            ASSERT_LE(std::hypot(force.x, force.z), 0.05 * most + 1e-3) << depth << " m at " << speed << " m/s";
            most = std::max(most, -force.y);
        }
        const double held = -simulation.tick(at(deepest)).total.y;
        for (int i = 0; i < 200; ++i) {
            ASSERT_GE(-simulation.tick(at(deepest)).total.y, 0.85 * held) << "held " << i << " ticks";
        }
    }
}

TEST(ElasticTick, ForceRisesAsTheBallGoesDeeper)
{
    expectForceToRiseDownTo(9e-3);
}

TEST(ElasticTick, TissueNeverClosesOverTheBall)
{
    expectForceToRiseDownTo(20e-3);
}

// Not a number in the middle of a press: the force is off for good, and the tissue stays a number.
TEST(ElasticTick, ImpossiblePoseLeavesFiniteTissue)
{
    Simulation simulation(homogeneous());
    auto samples = pressAndDrag(6e-3);
    samples[rampUp + 500].position.x = std::numeric_limits<double>::quiet_NaN();
    for (std::size_t i = 0; i < samples.size(); ++i) {
        const TickRecord& r = simulation.tick(samples[i]);
        ASSERT_EQ(r.faulted, i >= rampUp + 500) << i;
        ASSERT_TRUE(i < rampUp + 500 || r.total == Vec3(0.0)) << i;
        ASSERT_TRUE(std::isfinite(r.penetration)) << i;
    }
    for (const Vec3f u : simulation.shape().u()) {
        ASSERT_TRUE(std::isfinite(u.x + u.y + u.z));
    }
}

TEST(ElasticTick, DeepPressAndDragTouchNoHeap)
{
    using Kind = datasets::ToolKind;
    for (const Kind kind : {Kind::sphere, Kind::capsule, Kind::needle}) {
        auto model = tests::modelOf(homogeneousScene);
        const double radius = kind == Kind::needle ? 0.0 : ballRadius;
        model.scene.tool.kind = kind;
        model.scene.tool.radius = kind == Kind::needle ? 1e-3 : ballRadius;
        model.scene.tool.length = 40e-3;
        model.scene.model.elastic.friction = 0.3;
        Simulation simulation(model);
        const auto samples = pressAndDrag(20e-3, radius);
        std::uint32_t moved = 0;
        const auto calls = tests::heapCallsIn([&] {
            for (const DeviceSample& s : samples) {
                moved = std::max(moved, simulation.tick(s).moved);
            }
        });
        EXPECT_EQ(calls, 0U) << static_cast<int>(kind);
        EXPECT_GT(moved, 100U) << static_cast<int>(kind);
    }
}

// Requests to step down at these ticks of pressAndDrag().
constexpr std::array<std::size_t, 5> requests{rampUp + 350, rampUp + 500, rampUp + 650, rampUp + 800, rampUp + 900};

std::vector<DeviceSample> tooSlow()
{
    auto samples = pressAndDrag(3e-3);
    for (const std::size_t tick : requests) {
        samples[tick].buttons |= modelTooSlow;
    }
    return samples;
}

int steps(const TickRecord& record)
{
    int count = 0;
    for (std::uint32_t i = 0; i < record.eventCount; ++i) {
        count += record.events[i].kind == EventKind::stepDown ? 1 : 0;
    }
    return count;
}

// Every request goes one step down and is an event with the number of the step; at the bottom requests change nothing.
TEST(StepDown, EachRequestGoesOneStepDownTheLadder)
{
    using Level = datasets::ModelLevel;
    constexpr std::array<Level, 6> after{Level::elastic, Level::elastic, Level::chainmail,
                                         Level::spring,  Level::spring,  Level::spring};
    Simulation simulation(homogeneous());
    const auto samples = tooSlow();
    std::size_t asked = 0;
    for (std::size_t i = 0; i < samples.size(); ++i) {
        const TickRecord& r = simulation.tick(samples[i]);
        const bool request = (samples[i].buttons & modelTooSlow) != 0;
        asked += request ? 1 : 0;
        ASSERT_EQ(simulation.level(), after[asked]) << i;
        ASSERT_EQ(simulation.stepsDown(), static_cast<int>(std::min<std::size_t>(asked, 3))) << i;
        ASSERT_EQ(steps(r), request && asked <= 3 ? 1 : 0) << i;
        if (steps(r) > 0) {
            EXPECT_EQ(r.events[0].kind, EventKind::stepDown);
            EXPECT_EQ(r.events[0].value, static_cast<double>(asked));
        }
    }
    EXPECT_EQ(asked, requests.size());
}

// A scene that starts further down has fewer steps to go.
TEST(StepDown, StartsFromTheScenesLevel)
{
    using Level = datasets::ModelLevel;
    for (const Level level : {Level::chainmail, Level::spring}) {
        auto model = tests::modelOf(homogeneousScene);
        model.scene.model.level = level;
        Simulation simulation(model);
        auto sample = at(1e-3);
        sample.buttons |= modelTooSlow;
        const int events = steps(simulation.tick(sample)) + steps(simulation.tick(sample));
        EXPECT_EQ(simulation.level(), Level::spring);
        EXPECT_EQ(events, level == Level::chainmail ? 1 : 0);
    }
}

// Where the scene's own windows are as small as those of the step down, that step would change nothing: it is ChainMail.
TEST(StepDown, LeavesOutWindowsThatAreNoSmaller)
{
    using Level = datasets::ModelLevel;
    const auto model = tests::modelOf(homogeneousScene + "[model]\nsetting = \"fast\"\n");
    Simulation simulation(model);
    auto sample = at(1e-3);
    sample.buttons |= modelTooSlow;
    EXPECT_EQ(steps(simulation.tick(sample)), 1);
    EXPECT_EQ(simulation.level(), Level::chainmail);
    EXPECT_EQ(steps(simulation.tick(sample)), 1);
    EXPECT_EQ(simulation.level(), Level::spring);
}

// While the model changes under it the hand feels no step beyond the stabiliser's slew, which is 5 % of the cap per tick,
// and the heap is left alone. On small windows it feels nearly the same force: 20 %.
TEST(StepDown, IsSmoothAndTouchesNoHeap)
{
    auto model = tests::modelOf(homogeneousScene);
    model.scene.forceCap = 0.5;  // so that the slew is less than the force
    const auto samples = tooSlow();
    Simulation plain(model), simulation(model);
    std::vector<Vec3> expected;
    for (DeviceSample s : samples) {
        s.buttons &= ~modelTooSlow;
        expected.push_back(plain.tick(s).total);
    }
    std::vector<Vec3> forces(samples.size());
    const auto calls = tests::heapCallsIn([&] {
        for (std::size_t i = 0; i < samples.size(); ++i) {
            forces[i] = simulation.tick(samples[i]).total;
        }
    });
    EXPECT_EQ(calls, 0U);
    for (std::size_t i = 1; i < forces.size(); ++i) {
        ASSERT_LE(glm::distance(forces[i], forces[i - 1]), 0.05 * model.scene.forceCap * (1.0 + 1e-9)) << i;
    }
    for (std::size_t i = requests[0] + 20; i < requests[1]; ++i) {
        ASSERT_NEAR(glm::length(forces[i]), glm::length(expected[i]), 0.2 * glm::length(expected[i])) << i;
    }
    EXPECT_EQ(forces[requests[0] - 1], expected[requests[0] - 1]);
    EXPECT_NE(forces[requests[1] - 1], expected[requests[1] - 1]);
}

// A level that took over knows nothing of the one before; what that moved goes back to rest all the same.
TEST(StepDown, NothingIsLeftOfTheLevelAbove)
{
    for (std::size_t requested = 0; requested <= 3; ++requested) {
        Simulation simulation(homogeneous());
        for (int i = 0; i < 400; ++i) {
            simulation.tick(at(15e-6 * i));
        }
        EXPECT_GT(simulation.shape().moved().size(), 100U);
        for (std::size_t i = 0; i < requested; ++i) {
            auto sample = at(6e-3);
            sample.buttons |= modelTooSlow;
            simulation.tick(sample);
        }
        for (int i = 0; i < 500; ++i) {
            simulation.tick(at(-20e-3));
        }
        EXPECT_TRUE(simulation.shape().moved().empty())
            << requested << " steps down: " << simulation.shape().moved().size() << " nodes are not at rest";
    }
}

// A record of a session that stepped down gives the same forces and the same steps again, bit for bit; without its
// requests it is another session.
TEST(StepDown, ReplaysBitForBit)
{
    const synthetic::Folder folder;
    const auto& model = homogeneous();
    const auto samples = tooSlow();
    Simulation simulation(model), steady(model);
    std::vector<TickRecord> ticks;
    ForceHash hash, hashOfSteady;
    for (DeviceSample s : samples) {
        ticks.push_back(simulation.tick(s));
        hash.add(ticks.back());
        s.buttons &= ~modelTooSlow;
        hashOfSteady.add(steady.tick(s));
    }
    synthetic::record(folder / "a.palpate", synthetic::info(), ticks);
    const Record record(folder / "a.palpate");
    const auto result = replay(record, model);
    EXPECT_TRUE(result.identical) << "tick " << result.firstDifference.value_or(0);
    EXPECT_EQ(result.ticks, samples.size());
    EXPECT_EQ(result.forceHash, hash.value());
    EXPECT_NE(result.forceHash, hashOfSteady.value());
    Simulation again(model);
    int seen = 0;
    record.each([&](const TickRecord& then) {
        const int recorded = steps(then);
        EXPECT_EQ(steps(again.tick(then.device)), recorded) << then.tick;
        seen += recorded;
    });
    EXPECT_EQ(seen, 3);
}

// A device whose read() takes longer than a tick, `sleep`: `slow` of them, then it answers at once.
class SlowDevice final : public Device {
public:
    SlowDevice(int ticks, int slow, std::chrono::microseconds sleep) : ticks_(ticks), slow_(slow), sleep_(sleep) {}
    DeviceSample read() noexcept override
    {
        if (read_++ < slow_) {
            std::this_thread::sleep_for(sleep_);
        }
        return at(-20e-3);
    }
    void write(Vec3) noexcept override {}
    bool finished() const noexcept override { return read_ >= ticks_; }

private:
    int ticks_;
    int slow_;
    std::chrono::microseconds sleep_;
    int read_ = 0;
};

struct Served {
    ServoTiming timing;
    std::vector<std::uint64_t> steps;  // ticks in which the model stepped down
};

Served serve(int ticks, int slow, const ServoOptions& options,
             std::chrono::microseconds sleep = std::chrono::microseconds(1200))
{
    Served served;
    SlowDevice device(ticks, slow, sleep);
    Simulation simulation(homogeneous());
    const std::atomic<bool> stop{false};
    const auto sink = [&](const TickRecord& r, const ServoTiming&) {
        if (steps(r) > 0) {
            served.steps.push_back(r.tick);
        }
    };
    served.timing = runServo(device, simulation, options, sink, stop);
    return served;
}

// A paced loop in which every tick is late asks for one step per `lateAllowed` of them, until there is none left; with
// late ticks allowed it asks for none, whoever else is busy on the machine.
TEST(StepDown, ServoAsksWhenMoreTicksAreLateThanAllowed)
{
    const auto late = serve(200, 200, {true, 0.0, 20});
    EXPECT_GE(late.timing.missed, 200U);
    EXPECT_EQ(late.steps, (std::vector<std::uint64_t>{21, 42, 63}));
    const auto never = serve(100, 100, {true, 0.0, 0});
    EXPECT_GE(never.timing.missed, 100U);
    EXPECT_TRUE(never.steps.empty());
    const auto some = serve(300, 30, {true, 0.0, 200});
    EXPECT_GE(some.timing.missed, 30U);
    EXPECT_TRUE(some.steps.empty() || some.timing.missed > 200);
}

// Whoever stops the program for a while, or whose computer slept, gets the same tissue as before: no model is too slow.
TEST(StepDown, AGapIsOneLateTick)
{
    const auto served = serve(60, 3, {true, 0.0, 50}, std::chrono::milliseconds(100));
    EXPECT_GE(served.timing.missed, 290U);
    EXPECT_TRUE(served.steps.empty());
}

// Without pace no tick is late, however long it takes.
TEST(StepDown, ServoNeverAsksWhenUnpaced)
{
    const auto served = serve(100, 100, {false, 0.0, 20});
    EXPECT_EQ(served.timing.ticks, 100U);
    EXPECT_TRUE(served.steps.empty());
}

}  // namespace
}  // namespace palpate::haptics
