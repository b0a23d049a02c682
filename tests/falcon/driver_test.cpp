#include <haptics/falcon/device.h>
#include <haptics/falcon/driver.h>
#include <tests/allocations.h>
#include <tests/falcon/paced_wire.h>
#include <tests/falcon/rig.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <functional>

namespace palpate::falcon {
namespace {

constexpr double longest = 20.0;  // that a busy machine may take for what takes a moment [s]

bool within(double seconds, const std::function<bool()>& holds)
{
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (!holds()) {
        if (std::chrono::steady_clock::now() > end) {
            return false;
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return true;
}

// A driver of a Falcon that is loaded and homed, in real time.
struct Ready {
    explicit Ready(OnUnplug onUnplug = OnUnplug::exit) : falcon(syntheticFirmware().image)
    {
        falcon.with([](Emulator& d) {
            d.makeReady();
            d.hand.goal = {0.005, -0.003, 0.15};
        });
        DriverOptions options;
        options.onUnplug = onUnplug;
        options.guardian = false;
        driver = std::make_shared<Driver>(
            std::make_unique<PacedWire>(falcon), options,
            [this](const std::string& what) {
                const std::lock_guard lock(guard);
                said += what + "\n";
            },
            stop);
    }

    bool heard(const std::string& words)
    {
        const std::lock_guard lock(guard);
        return said.find(words) != std::string::npos;
    }
    Triple motor()
    {
        return falcon.with([](Emulator& d) { return d.command().motor; });
    }
    /// As the servo loop does it, until something holds.
    bool push(Vec3 force, const std::function<bool()>& holds)
    {
        return within(longest, [&] {
            driver->write(force, true);
            return holds();
        });
    }
    bool pushTo(double newton)
    {
        return push({0, 0, 3}, [&] { return falcon.with([](Emulator& d) { return d.motorForce().z; }) > newton; });
    }

    std::atomic<bool> stop{false};
    std::mutex guard;
    std::string said;
    PacedFalcon falcon;
    std::shared_ptr<Driver> driver;
};

TEST(FalconDriver, ForceReachesTheHandAndThePoseTheServo)
{
    Ready ready;
    EXPECT_TRUE(ready.pushTo(2.5));
    GripPose pose;
    ready.driver->read(pose);
    const Vec3 truth = ready.falcon.with([](Emulator& d) { return d.position(); });
    EXPECT_LT(glm::distance(pose.position, truth), 5e-3);
}

TEST(FalconDriver, ServoSideAllocatesNothing)
{
    Ready ready;
    FalconDevice device(ready.driver, Vec3(0.0), Vec3(0, 1, 0));
    EXPECT_EQ(tests::heapCallsIn([&] {
                  for (int i = 0; i < 1000; ++i) {
                      device.read();
                      device.write({0, 0, 1});
                      device.finished();
                  }
              }),
              0U);
}

TEST(FalconDriver, NoTorqueIsLeftWhenItEnds)
{
    Ready ready;
    ASSERT_TRUE(ready.pushTo(2.0));
    ready.driver.reset();
    EXPECT_TRUE(within(longest, [&] { return ready.motor() == Triple{}; }));
}

TEST(FalconDriver, ServoThatStandsStillLosesTheForce)
{
    Ready ready;
    ASSERT_TRUE(ready.pushTo(2.0));
    EXPECT_TRUE(within(longest, [&] { return ready.motor() == Triple{}; }));
}

TEST(FalconDriver, UnpluggedItEndsWithAMessage)
{
    Ready ready;
    FalconDevice device(ready.driver, Vec3(0.0), Vec3(0, 1, 0));
    ASSERT_TRUE(ready.pushTo(2.0));
    ready.falcon.plugged = false;
    ASSERT_TRUE(within(longest, [&] { return device.finished(); }));
    EXPECT_NE(device.problem().find("the Falcon was unplugged"), std::string::npos) << device.problem();
}

TEST(FalconDriver, UnpluggedItWaitsWhereThatWasChosen)
{
    Ready ready(OnUnplug::wait);
    FalconDevice device(ready.driver, Vec3(0.0), Vec3(0, 1, 0));
    ASSERT_TRUE(ready.pushTo(2.0));
    ready.falcon.plugged = false;
    ASSERT_TRUE(within(longest, [&] { return ready.heard("plug it in again"); }));
    EXPECT_TRUE(within(longest, [&] { return !device.read().fresh; }));
    ready.falcon.plugged = true;
    // Its hand moves it, as it is asked to.
    ASSERT_TRUE(within(longest, [&] { return ready.motor() == Triple{}; }));
    ASSERT_TRUE(within(longest, [&] {
        ready.falcon.with([](Emulator& d) { d.hand.goal.x = d.hand.goal.x > d.position().x ? -0.02 : 0.02; });
        return ready.heard("the Falcon is back");
    }));
    EXPECT_FALSE(device.finished());
    EXPECT_TRUE(ready.pushTo(2.0));
}

TEST(FalconDevice, FacesAlongTheToolAndStandsUpright)
{
    for (const Vec3 axis : {Vec3(0, 1, 0), glm::normalize(Vec3(1, 2, -0.5)), Vec3(0, 0, -1), Vec3(0, 0, 1)}) {
        const Mat3 turn = facing(axis);
        EXPECT_LT(glm::distance(turn * Vec3(0, 0, -1), axis), 1e-12) << "pushed away, the tool goes in";
        EXPECT_NEAR(glm::determinant(turn), 1.0, 1e-12) << "a rotation";
        EXPECT_LT(glm::distance(glm::transpose(turn) * (turn * Vec3(1, 2, 3)), Vec3(1, 2, 3)), 1e-12);
    }
    EXPECT_LT(glm::distance(facing({0, 1, 0}) * Vec3(0, 1, 0), Vec3(0, 0, 1)), 1e-12) << "up is the head";
    EXPECT_LT(glm::distance(facing({0, 1, 0}) * Vec3(1, 0, 0), Vec3(1, 0, 0)), 1e-12)
        << "the user stands in front of the patient: right is the patient's left";
}

TEST(FalconDevice, BeginsAtTheStartAndMovesAsFarAsTheGrip)
{
    Ready ready;
    const Vec3 start(0.1, 0.2, 0.3), axis(0, 1, 0);
    GripPose before, after;
    ASSERT_TRUE(within(longest, [&] {
        ready.driver->read(before);
        return before.position.z > 0.147;
    }));
    FalconDevice device(ready.driver, start, axis);
    EXPECT_LT(glm::distance(device.read().position, start), 1e-12);
    ready.falcon.with([](Emulator& d) { d.hand.goal = {-0.01, 0.01, 0.13}; });
    ASSERT_TRUE(within(longest, [&] {
        ready.driver->read(after);
        return after.position.z < 0.1305;
    }));
    const auto sample = device.read();
    EXPECT_NEAR(glm::distance(sample.position, start), glm::distance(before.position, after.position), 3e-3);
    EXPECT_GT(glm::dot(sample.position - start, axis), 0.014);
}

TEST(FalconDevice, ButtonsAreSwitchTriggerMarkAndEnd)
{
    Ready ready;
    FalconDevice device(ready.driver, Vec3(0.0), Vec3(0, 1, 0));
    const auto hold = [&](std::uint8_t button) { ready.falcon.with([&](Emulator& d) { d.hand.buttons = button; }); };
    const auto shows = [&](std::uint32_t buttons) {
        return within(longest, [&] { return device.read().buttons == buttons; });
    };
    EXPECT_TRUE(shows(0));
    hold(buttonCentre);
    EXPECT_TRUE(shows(haptics::buttonDeadMan));
    hold(buttonCentre | buttonForward);
    EXPECT_TRUE(shows(haptics::buttonDeadMan | haptics::buttonFire));
    hold(buttonRight);
    EXPECT_TRUE(shows(haptics::buttonMark));
    hold(0);
    EXPECT_TRUE(shows(0));
    EXPECT_FALSE(device.finished());
    hold(buttonLeft);
    EXPECT_TRUE(within(longest, [&] {
        device.read();
        return device.finished();
    }));
    EXPECT_EQ(device.problem(), "");
}

// A value of many words is never read half written.
TEST(Newest, ReaderNeverSeesHalfAValue)
{
    struct Value {
        std::array<std::uint64_t, 6> words{};
    };
    Newest<Value> newest;
    std::atomic<bool> over{false};
    std::thread writer([&] {
        for (std::uint64_t n = 1; !over; ++n) {
            newest.write({{n, n, n, n, n, n}});
        }
    });
    Value seen;
    for (int i = 0; i < 200000; ++i) {
        const std::uint64_t before = seen.words[0];
        newest.read(seen);
        ASSERT_GE(seen.words[0], before);
        for (const std::uint64_t word : seen.words) {
            ASSERT_EQ(word, seen.words[0]);
        }
    }
    over = true;
    writer.join();
}

}  // namespace
}  // namespace palpate::falcon
