#include "models.h"

#include <tests/allocations.h>
#include <tests/channel/example.h>

#include <channel/segment.h>
#include <haptics/broadcast.h>
#include <haptics/hand.h>
#include <haptics/replay.h>
#include <haptics/servo.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <fstream>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

namespace palpate::haptics {
namespace {

// Memory that this process has locked [kB].
double lockedMemory()
{
    std::ifstream status("/proc/self/status");
    std::string word;
    while (status >> word && word != "VmLck:") {
    }
    double kilobytes = -1;
    status >> kilobytes;
    return kilobytes;
}

// A host of sessions had all its memory locked for good. Where locking is not permitted nothing is ever locked.
TEST(RealTimeClaim, MemoryIsLockedUntilTheLastClaimEnds)
{
    std::thread([] {
        const auto lockedByOne = [] {
            const RealTimeClaim claim;
            return lockedMemory() > 0;
        };
        ASSERT_EQ(lockedMemory(), 0);
        ::mlockall(MCL_CURRENT | MCL_FUTURE);
        const bool may = lockedMemory() > 0;  // nor with a sanitizer
        ::munlockall();
        EXPECT_EQ(lockedByOne(), may);
        EXPECT_EQ(lockedMemory(), 0);
        auto first = std::make_unique<RealTimeClaim>();
        auto second = std::make_unique<RealTimeClaim>();
        first.reset();
        EXPECT_EQ(lockedMemory() > 0, may);
        second.reset();
        EXPECT_EQ(lockedMemory(), 0);
        if (may) {
            // What the host locked by itself stays.
            const auto page = std::make_unique<std::array<char, 16384>>();
            ASSERT_EQ(::mlock(page->data(), page->size()), 0);
            lockedByOne();
            EXPECT_GT(lockedMemory(), 0);
            ::munlockall();
        }
    }).join();
}

std::vector<datasets::TraineeStep> waitFor(double seconds)
{
    datasets::TraineeStep wait;
    wait.kind = datasets::TraineeStep::Kind::wait;
    wait.seconds = seconds;
    return {wait};
}

struct Rig {
    explicit Rig(double seconds = 100)
        : simulation(tests::blockSphere()), hand({}, waitFor(seconds), {0, -7e-3, 0}, {0, 1, 0})
    {
    }
    Simulation simulation;
    HandDevice hand;
    std::atomic<bool> stop{false};
};

TEST(Servo, PacedLoopKeepsRealTimeOverHalfASecond)
{
    Rig rig;
    const auto start = std::chrono::steady_clock::now();
    const auto timing = runServo(
        rig.hand, rig.simulation, {true, 0.5}, [](auto&, auto&) {}, rig.stop);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    // Every period is either a tick or a miss: none is made up in a burst.
    EXPECT_EQ(timing.ticks, 500U);
    EXPECT_GE(seconds, 0.499);
    EXPECT_LE(std::abs(seconds - 1e-3 * static_cast<double>(timing.ticks)),
              0.01 + 2e-3 * static_cast<double>(timing.missed));
}

// A gap of 50 ms in the loop is counted as missed ticks, and the loop goes on from where it is.
TEST(Servo, GapIsCountedAndNotMadeUp)
{
    Rig rig;
    int stale = 0;
    const auto sink = [&](const TickRecord& r, const ServoTiming&) {
        stale += r.tick > 100 && !r.device.fresh ? 1 : 0;
        if (r.tick == 100) {
            std::this_thread::sleep_for(std::chrono::milliseconds(50));
        }
    };
    const auto start = std::chrono::steady_clock::now();
    const auto timing = runServo(rig.hand, rig.simulation, {true, 0.2}, sink, rig.stop);
    EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(200 + 49));
    EXPECT_EQ(timing.ticks, 200U);
    EXPECT_GE(timing.missed, 45U);
    // The watchdog fades the force for as many ticks.
    EXPECT_GE(stale, 45);
}

// Two gaps of 20 and 40 ms, far from each other, and three ticks that take 3 ms each. At level spring, which most machines
// compute in time; where more is missed, a gap may join the next.
TEST(Servo, GapsAndOverrunsAreCounted)
{
    struct Slow final : Device {
        DeviceSample read() noexcept override { return {}; }
        void write(Vec3) noexcept override
        {
            const bool slow = ++tick == 200 || tick == 220 || tick == 240;
            std::this_thread::sleep_for(std::chrono::milliseconds(slow ? 3 : 0));
        }
        bool finished() const noexcept override { return tick >= 300; }
        int tick = 0;
    } device;
    const SessionModel model = tests::modelOf(tests::blockScene + "[model]\nlevel = \"spring\"\n");
    Simulation simulation(model);
    const auto sink = [&](const TickRecord& r, const ServoTiming&) {
        std::this_thread::sleep_for(std::chrono::milliseconds(r.tick == 50 ? 20 : r.tick == 120 ? 40 : 0));
    };
    const std::atomic<bool> stop{false};
    const auto timing = runServo(device, simulation, {true, 0.0}, sink, stop);
    EXPECT_GE(timing.overruns, 3U);
    constexpr std::uint64_t made = 19 + 39 + 3 * 3,
                            between = 20 - 4;  // periods missed here; fewest from one gap to the next
    EXPECT_GE(timing.missed, made);
    EXPECT_GE(timing.longestGap, 39U);
    if (timing.missed < made + between) {
        EXPECT_GE(timing.gaps, 5U);
    }
    EXPECT_LE(timing.gaps, timing.missed);
    EXPECT_LE(timing.longestGap, timing.missed);
    // What a tick takes does not depend on a clock that it is due by.
    device.tick = 0;
    Simulation again(model);
    EXPECT_GE(runServo(device, again, {false, 0.0}, sink, stop).overruns, 3U);
}

// Its parts refer to one another: a moved one wrote to memory that was gone.
static_assert(!std::is_move_constructible_v<Simulation> && !std::is_copy_constructible_v<Simulation>);
static_assert(!std::is_move_assignable_v<Simulation> && !std::is_copy_assignable_v<Simulation>);
static_assert(!std::is_move_constructible_v<chainmail::SpringLevel>);
static_assert(!std::is_move_constructible_v<chainmail::ChainMailLevel>);
static_assert(!std::is_move_constructible_v<chainmail::ElasticLevel>);

TEST(Servo, ACapOrAPeriodThatIsNoPositiveNumberIsRefused)
{
    SessionModel model = tests::blockSphere();
    const double nan = std::numeric_limits<double>::quiet_NaN(), infinite = std::numeric_limits<double>::infinity();
    for (const double bad : {nan, infinite, 0.0, -1e-3}) {
        EXPECT_THROW(Simulation(model, {bad, {}}), std::runtime_error) << bad;
        model.scene.forceCap = bad;
        EXPECT_THROW(Simulation{model}, std::runtime_error) << bad;
        model.scene.forceCap = 8.5;
    }
}

// At 500 Hz as at 1 kHz, for the loop and for viewers.
TEST(Servo, SecondsAreThoseOfTheSimulation)
{
    for (const double rate : {500.0, 1000.0, 4000.0}) {
        Simulation simulation(tests::blockSphere(), {1.0 / rate, {}});
        HandDevice hand({}, waitFor(100), {0, -7e-3, 0}, {0, 1, 0});
        std::atomic<bool> stop{false};
        channel::State state;
        const auto sink = [&](const TickRecord& r, const ServoTiming& t) { showTick(r, t, state, simulation.period()); };
        EXPECT_NEAR(static_cast<double>(runServo(hand, simulation, {false, 0.1}, sink, stop).ticks), 0.1 * rate, 1.0);
        EXPECT_NEAR(state.time, 0.1, 2.0 / rate);
        // A paced loop takes no less than its time.
        const auto start = std::chrono::steady_clock::now();
        runServo(hand, simulation, {true, 0.1}, sink, stop);
        EXPECT_GE(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(), 0.099);
    }
}

// Faster than real time there is no clock to miss.
TEST(Servo, AnUnpacedLoopMissesNothing)
{
    Rig rig;
    const auto sink = [](const TickRecord& r, const ServoTiming&) {
        std::this_thread::sleep_for(std::chrono::milliseconds(r.tick == 50 ? 5 : 0));
    };
    const auto timing = runServo(rig.hand, rig.simulation, {false, 0.1}, sink, rig.stop);
    EXPECT_FALSE(timing.paced);
    EXPECT_EQ(timing.missed + timing.gaps + timing.longestGap, 0U);
}

TEST(Servo, StopsWhenAskedAndWhenTheDeviceHasFinished)
{
    Rig rig(0.1);
    EXPECT_NEAR(static_cast<double>(runServo(
                                        rig.hand, rig.simulation, {false, 0.0}, [](auto&, auto&) {}, rig.stop)
                                        .ticks),
                100.0, 2.0);
    Rig stopped;
    const auto sink = [&](const TickRecord& r, const ServoTiming&) { stopped.stop = r.tick == 41; };
    EXPECT_EQ(runServo(stopped.hand, stopped.simulation, {false, 0.0}, sink, stopped.stop).ticks, 42U);
}

// Presses the block 4 mm deep and stays; elsewhere while it is told to.
struct Press final : Device {
    DeviceSample read() noexcept override
    {
        DeviceSample sample;
        sample.position = Vec3(elsewhere ? 20e-3 : 0.0, -10e-3 + std::min(14e-3, 2e-5 * double(reads)), 0);
        sample.buttons = buttonDeadMan;
        reads += going ? 1 : 0;
        return sample;
    }
    void write(Vec3 force) noexcept override { last = force; }
    bool finished() const noexcept override { return false; }
    std::uint64_t reads = 0;
    bool going = true, elsewhere = false;
    Vec3 last{0.0};
};

// A pause of 200 ms is in no tick: the numbers of the ticks have no gap, and the poses that were recorded give the same
// forces to the bit without a pause. The force falls within the stabiliser's slew, is zero while it stands, and begins at
// zero; with the tool elsewhere it goes on standing. At level spring, which most machines compute in time: late ticks
// fade the force as well.
TEST(Servo, APauseIsInNoTickAndJumpsNowhere)
{
    const SessionModel model = tests::modelOf(tests::blockScene + "[model]\nlevel = \"spring\"\n");
    Simulation simulation(model);
    Press device;
    std::vector<TickRecord> ticks;
    ForceHash hash;
    bool asked = false;
    int stood = 0, stoodElsewhere = 0;
    double pushed = 0, afterwards = 0;  // largest force before the pause and at the end [N]
    ServoOptions options{true, 2.0};
    options.lateAllowed = 0;
    options.pause.asked = [&] { return asked; };
    options.pause.standing = [&](bool elsewhere) {
        EXPECT_EQ(glm::length(device.last), 0.0);
        stood += elsewhere ? 0 : 1;
        stoodElsewhere += elsewhere ? 1 : 0;
        asked = stood < 200;
        device.elsewhere = stood >= 200 && stoodElsewhere < 50;
    };
    const std::atomic<bool> stop{false};
    std::uint64_t gapBefore = 0;  // longest until then, which a busy machine makes
    std::optional<std::uint64_t> gapAfter;
    const auto sink = [&](const TickRecord& r, const ServoTiming& soFar) {
        ticks.push_back(r);
        hash.add(r);
        asked = asked || r.tick == 1200;
        gapBefore = stood == 0 ? soFar.longestGap : gapBefore;
        gapAfter = stood > 0 && !gapAfter ? soFar.longestGap : gapAfter;
        device.going = !asked;
        pushed = std::max(pushed, r.tick <= 1200 ? glm::length(r.total) : 0.0);
        afterwards = std::max(afterwards, r.tick >= 1800 ? glm::length(r.total) : 0.0);
    };
    const auto timing = runServo(device, simulation, options, sink, stop);
    if (timing.missed < 50) {
        EXPECT_GT(pushed, 0.3);
        EXPECT_GT(afterwards, 0.3);
    }
    EXPECT_EQ(stood, 200);
    EXPECT_GE(stoodElsewhere, 49);
    EXPECT_EQ(timing.pauses, 1U);
    EXPECT_GE(timing.paused, 0.24);
    EXPECT_LT(gapAfter.value(), std::max<std::uint64_t>(gapBefore + 1, 240)) << "a pause is no gap";
    ASSERT_EQ(ticks.size(), 2000U);
    const double cap = 50.0 * model.scene.forceCap * tickSeconds;  // the stabiliser's slew [N per tick]
    bool stands = false;
    for (std::size_t i = 1; i < ticks.size(); ++i) {
        EXPECT_EQ(ticks[i].tick, i);
        EXPECT_LE(glm::length(ticks[i].total - ticks[i - 1].total), cap + 1e-9);
        stands = stands || (i > 1200 && glm::length(ticks[i].total) == 0.0);
    }
    EXPECT_TRUE(stands);
    Simulation again(model);
    ForceHash replayed;
    for (const TickRecord& r : ticks) {
        replayed.add(again.tick(r.device));
    }
    EXPECT_EQ(replayed.value(), hash.value());
}

// The whole servo path: device, simulation, histograms, broadcast to viewers.
TEST(Servo, AllocatesNothingPerTick)
{
    Rig rig;
    Broadcast broadcast("test-servo-" + std::to_string(getpid()), tests::blockSphere());
    std::uint64_t atStart = 0, atEnd = 0;
    const auto sink = [&](const TickRecord& r, const ServoTiming& t) {
        broadcast.publish(r, t, rig.simulation);
        if (r.tick == 10) {
            atStart = tests::allocations();
        }
        atEnd = tests::allocations();
    };
    runServo(rig.hand, rig.simulation, {false, 2.5}, sink, rig.stop);
    EXPECT_EQ(atStart, atEnd);
}

// What a viewer sees is what the simulation did: state of the last tick, displaced nodes with their displacements.
TEST(Broadcast, ViewerSeesTheStateAndTheDisplacedNodes)
{
    const std::string session = "test-broadcast-" + std::to_string(getpid());
    Rig rig;
    Broadcast broadcast(session, tests::blockSphere());
    auto viewer = channel::Subscriber::attach(session);
    ASSERT_TRUE(viewer);
    TickRecord last;
    const auto sink = [&](const TickRecord& r, const ServoTiming& t) {
        broadcast.publish(r, t, rig.simulation);
        last = r;
    };
    runServo(rig.hand, rig.simulation, {false, 0.331}, sink, rig.stop);
    const auto state = viewer->state();
    ASSERT_TRUE(state);
    EXPECT_EQ(state->tick, last.tick);
    EXPECT_EQ(state->total[1], last.total.y);
    auto displaced = std::make_unique<channel::Displaced>();
    displaced->tick = 0;
    ASSERT_TRUE(viewer->displaced(*displaced));
    ASSERT_GT(displaced->count, 0U);
    const auto u = rig.simulation.shape().u();
    for (std::uint32_t i = 0; i < displaced->count; ++i) {
        EXPECT_EQ(displaced->nodes[i].u[1], u[displaced->nodes[i].node].y);
    }
    broadcast.finish();
    EXPECT_EQ(viewer->state()->status, channel::Status::finished);
}

// Without a clock no tick is late, which is not "0 missed".
TEST(Broadcast, MissedTicksAreCountedAgainstTheClockOnly)
{
    for (const bool paced : {true, false}) {
        const std::string session = "test-paced-" + std::to_string(getpid());
        Rig rig;
        Broadcast broadcast(session, tests::blockSphere());
        const auto viewer = channel::Subscriber::attach(session);
        ASSERT_TRUE(viewer.has_value());
        runServo(
            rig.hand, rig.simulation, {paced, 0.02},
            [&](const TickRecord& r, const ServoTiming& timing) { broadcast.publish(r, timing, rig.simulation); },
            rig.stop);
        ASSERT_TRUE(viewer->state().has_value());
        EXPECT_EQ(viewer->state()->missed == channel::notCounted, !paced);
    }
}

// 31 bytes are there for it; what is cut off is marked, and a letter of two bytes is there whole or not at all.
TEST(Broadcast, SaysWhoTrains)
{
    const std::string session = "test-who-" + std::to_string(getpid()), start(27, 'a');
    for (const auto& [who, seen] : {std::pair{std::string("Ada"), std::string("Ada")},
                                    {start + "aaaa", start + "aaaa"},
                                    {start + "aaaaa", start + "a\u2026"},
                                    {start + "\u00fcaaa", start + "\u2026"}}) {
        const Broadcast broadcast(session, tests::blockSphere(), channel::handElsewhere, who);
        const auto viewer = channel::Subscriber::attach(session);
        ASSERT_TRUE(viewer);
        EXPECT_EQ(std::string(viewer->scenery().who.data()), seen);
    }
}

TEST(Histogram, QuantilesAreWithinOnePercentOfTheExactOnes)
{
    Histogram h;
    for (int i = 1; i <= 100000; ++i) {
        h.add(1e-8 * i);
    }
    EXPECT_NEAR(h.quantile(0.5), 500e-6, 6e-6);
    EXPECT_NEAR(h.quantile(0.99), 990e-6, 11e-6);
    EXPECT_DOUBLE_EQ(h.percentiles().max, 1e-3);
}

// A viewer that the servo's thread stops in the middle of its writing ends no pause, and begins none.
TEST(Servo, APauseIsAskedForUntilAWholeInputSaysOtherwise)
{
    const std::string name = "inside-" + std::to_string(::getpid());
    const auto model = tests::blockSphere();
    const Broadcast broadcast(name, model, channel::handIsViewers);
    const auto asked = [&] {
        const auto input = broadcast.input();
        return input && input->paused != 0;
    };
    EXPECT_FALSE(asked());
    const auto viewer = channel::Subscriber::attach(name);
    ASSERT_TRUE(viewer);
    auto hand = channel::ViewersHand::take(*viewer);
    ASSERT_TRUE(hand);
    channel::RawSegment raw(channel::segmentName(name));
    auto& block = raw.at<channel::InputBlock>(raw.at<channel::Header>(0).inputOffset);
    channel::Input input;
    hand->set(input);
    EXPECT_FALSE(asked());
    input.paused = 1;
    hand->set(input);
    EXPECT_TRUE(asked());
    block.sequence += 1;
    EXPECT_TRUE(asked()) << "in the middle of writing";
    input.paused = 0;
    hand->set(input);
    EXPECT_FALSE(asked());
    block.sequence += 1;
    EXPECT_FALSE(asked());
}

}  // namespace
}  // namespace palpate::haptics
