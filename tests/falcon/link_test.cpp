#include <haptics/falcon/link.h>
#include <tests/falcon/rig.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <set>

namespace palpate::falcon {
namespace {

// What the motors can be told within one packet's time, from rest.
constexpr int slewPerPacket = static_cast<int>(Link::commandPerSecond * 5e-3) + 1;

struct Refusal {
    Cause cause{};
    std::string what;
};

Refusal refusalOf(Rig& rig)
{
    try {
        rig.link.connect(rig.stop);
    } catch (const Trouble& trouble) {
        return {trouble.cause(), trouble.what()};
    }
    ADD_FAILURE() << "it became ready";
    return {};
}

TEST(FalconLink, LoadsTheFirmwareHomesAndIsReady)
{
    Rig rig;
    rig.link.connect(rig.stop);
    EXPECT_TRUE(rig.device.running());
    EXPECT_EQ(rig.device.homed(), allHomed);
    EXPECT_TRUE(rig.link.loaded());
    EXPECT_TRUE(rig.heard("pull the Falcon's grip"));
    EXPECT_EQ(rig.wire.opened(), 1);
    EXPECT_LT(glm::distance(rig.link.pose().position, rig.device.position()), 2e-4) << "three counts of 56 um at most";
}

TEST(FalconLink, RunningFirmwareIsNotLoadedAgain)
{
    Rig rig(LinkOptions{});
    rig.device.makeReady();
    rig.link.connect(rig.stop);
    EXPECT_FALSE(rig.link.loaded());
    EXPECT_EQ(rig.device.homed(), allHomed);
}

TEST(FalconLink, LoadersLeadingZeroIsHarmless)
{
    Rig rig;
    rig.device.mishaps.leadingZero = true;
    rig.link.connect(rig.stop);
    EXPECT_TRUE(rig.device.running());
}

struct Setback {
    std::string name;
    Cause cause;
    std::string hint;
    std::function<void(Rig&)> strike;
    int opened;  // how often it was tried
};

// Each has its own words, its own remedy, and is tried again only where that can help.
TEST(FalconLink, EveryFaultAtTheStartHasItsOwnMessage)
{
    const std::vector<Setback> setbacks{
        {"absent", Cause::absent, "plugged in", [](Rig& r) { r.wire.plugged = false; }, 0},
        {"permission", Cause::permission, "may not be opened", [](Rig& r) { r.wire.allowed = false; }, 0},
        {"busy", Cause::busy, "another program", [](Rig& r) { r.wire.busy = true; }, 0},
        {"mute", Cause::silent, "power supply", [](Rig& r) { r.device.mishaps.mute = true; }, 3},
        {"greeting", Cause::garbled, "answers with something else", [](Rig& r) { r.device.mishaps.wrongGreeting = true; },
         3},
        {"echo", Cause::garbled, "firmware byte 1235 of 3000", [](Rig& r) { r.device.mishaps.wrongEcho = 1234; }, 3},
        {"never runs", Cause::firmware, "firmware.bin: the Falcon took every byte",
         [](Rig& r) { r.device.mishaps.neverRuns = true; }, 3},
        {"homeless", Cause::homing, "not homed within 60 s", [](Rig& r) { r.device.mishaps.homeless = true; }, 1},
        {"frozen", Cause::frozen, "encoders 0 of 3 moved", [](Rig& r) { r.device.mishaps.frozen = true; }, 3}};
    std::set<std::string> messages;
    for (const Setback& setback : setbacks) {
        Rig rig;
        setback.strike(rig);
        const Refusal refusal = refusalOf(rig);
        EXPECT_EQ(refusal.cause, setback.cause) << setback.name;
        EXPECT_NE(refusal.what.find(setback.hint), std::string::npos) << setback.name << ": " << refusal.what;
        EXPECT_EQ(refusal.what.find('\n'), std::string::npos);
        EXPECT_EQ(rig.wire.opened(), setback.opened) << setback.name;
        EXPECT_TRUE(messages.insert(refusal.what).second) << setback.name;
        EXPECT_EQ(rig.device.command().motor, Triple{}) << setback.name;
    }
}

TEST(FalconLink, WithoutFirmwareItAsksForTheFile)
{
    Rig rig(LinkOptions{});
    const Refusal refusal = refusalOf(rig);
    EXPECT_EQ(refusal.cause, Cause::firmwareFile);
    EXPECT_NE(refusal.what.find("--falcon-firmware"), std::string::npos);
}

// A Falcon that was homed before and that nobody moves cannot be told from one whose encoders are dead: its user is asked.
TEST(FalconLink, EncodersHaveToMoveBeforeThereIsAForce)
{
    Rig rig(LinkOptions{});
    rig.device.hand.goal = {0.0, 0.0, 0.13};
    rig.device.makeReady();
    EXPECT_EQ(refusalOf(rig).cause, Cause::frozen);
    EXPECT_TRUE(rig.heard("move the Falcon's grip"));
    rig.device.hand.goal = {0.0, 0.0, 0.15};
    rig.link.connect(rig.stop);
}

// Loaded badly: it answers, its encoders stand still. The next attempt loads it again although it answers.
TEST(FalconLink, FrozenEncodersAreLoadedAnew)
{
    Rig rig;
    rig.device.mishaps.frozen = true;
    rig.onSay = [&](const std::string& what) {
        rig.device.mishaps.frozen = rig.device.mishaps.frozen && what.find("trying again") == std::string::npos;
    };
    rig.link.connect(rig.stop);
    EXPECT_EQ(rig.wire.opened(), 2);
    EXPECT_EQ(std::ranges::count(rig.said, "loading the Falcon's firmware"), 2);
}

TEST(FalconLink, AFaultThatPassesIsOvercomeByReopening)
{
    for (const auto strike : {&Mishaps::mute, &Mishaps::wrongGreeting, &Mishaps::neverRuns}) {
        Rig rig;
        rig.device.mishaps.*strike = true;
        rig.onSay = [&](const std::string& what) {
            if (what.find("trying again") != std::string::npos) {
                rig.device.mishaps = {};
            }
        };
        rig.link.connect(rig.stop);
        EXPECT_EQ(rig.wire.opened(), 2);
    }
}

// While it says that its legs are not at home nobody knows where the grip is: no force, and none at once when it is back.
TEST(FalconLink, AFalconThatIsNotHomedAnyMoreHasNoForce)
{
    Rig rig(LinkOptions{});
    rig.device.makeReady();
    rig.link.connect(rig.stop);
    const auto exchange = [&](double seconds) {
        for (const double until = rig.wire.now() + seconds; rig.wire.now() < until;) {
            rig.link.exchange({{0, 0, 3}, rig.wire.now(), 1});
        }
        return glm::length(rig.device.motorForce());
    };
    EXPECT_GT(exchange(1.0), 2.5);
    rig.device.mishaps.homeless = true;
    EXPECT_LT(exchange(0.02), 0.05);
    rig.device.mishaps.homeless = false;
    EXPECT_LT(exchange(0.02), 1.0);
    EXPECT_GT(exchange(1.0), 2.5);
}

TEST(FalconLink, UserCanInterruptTheWait)
{
    Rig rig;
    rig.device.mishaps.homeless = true;
    rig.onSay = [&](const std::string& what) { rig.stop = what.find("pull") != std::string::npos; };
    EXPECT_EQ(refusalOf(rig).cause, Cause::interrupted);
}

// What is sent is what is felt: F and the weight of the grip, by the emulator's own J^-T, to half a step of the motors.
TEST(FalconLink, SentForceIsTheFeltForce)
{
    Rig rig;
    rig.link.connect(rig.stop);
    std::mt19937 random(4);
    std::uniform_real_distribution<double> newton(-3.0, 3.0);
    rig.push(Vec3(0.0), 0.6);
    for (int i = 0; i < 15; ++i) {
        const Vec3 force(newton(random), newton(random), newton(random));
        rig.push(force, 0.15);
        const Vec3 expected = force + Vec3(0.0, rig.device.weight(), 0.0);
        EXPECT_LT(glm::distance(rig.device.motorForce(), expected), 0.02) << "grip at " << rig.device.position().z;
    }
    EXPECT_LE(rig.jump, slewPerPacket);
}

TEST(FalconLink, ForcesBeginWithARamp)
{
    Rig rig;
    rig.link.connect(rig.stop);
    const Vec3 force(0.0, 0.0, 3.0);
    for (const double fraction : {0.25, 0.5, 0.75}) {
        rig.push(force, 0.25 * Link::ramp);
        const Vec3 expected = fraction * (force + Vec3(0.0, rig.device.weight(), 0.0));
        EXPECT_LT(glm::distance(rig.device.motorForce(), expected), 0.1);
    }
}

// The servo thread is stuck: its last order holds for 10 ms and is gone after 50.
TEST(FalconLink, WatchdogTakesAnOldForceOff)
{
    Rig rig;
    rig.link.connect(rig.stop);
    const Vec3 force(0.0, 0.0, 4.0);
    rig.push(force, 1.0);
    EXPECT_GT(largestOf(rig.device.command().motor), 500);
    const ForceOrder last{force, rig.wire.now(), 1};
    const int before = largestOf(rig.device.command().motor);
    while (rig.wire.now() < last.time + Link::faded + 5e-3) {
        rig.link.exchange(last);
        EXPECT_LE(largestOf(rig.link.command().motor), before + 20);
    }
    EXPECT_EQ(rig.device.command().motor, Triple{});
    rig.push(force, 0.02);
    EXPECT_LT(largestOf(rig.device.command().motor), before / 10) << "and begins again with a ramp";
}

TEST(FalconLink, ForceThatIsNotFiniteIsNone)
{
    Rig rig;
    rig.link.connect(rig.stop);
    rig.push({0, 0, 3}, 0.8);
    rig.push({0, std::numeric_limits<double>::quiet_NaN(), 3}, 0.01);
    EXPECT_EQ(rig.device.command().motor, Triple{});
}

TEST(FalconLink, RestTakesTheTorqueOff)
{
    Rig rig;
    rig.link.connect(rig.stop);
    rig.push({1, 1, 3}, 0.8);
    ASSERT_NE(rig.device.command().motor, Triple{});
    rig.link.rest();
    EXPECT_EQ(rig.device.command().motor, Triple{});
}

TEST(FalconLink, EncodersThatFreezeUnderAForceTakeItOff)
{
    Rig rig;
    rig.link.connect(rig.stop);
    rig.push({0, 0, 2}, 1.0);
    rig.device.mishaps.frozen = true;
    rig.push({0, 0, 2}, 2.5);
    EXPECT_TRUE(rig.link.frozen());
    EXPECT_EQ(rig.device.command().motor, Triple{});
    rig.device.mishaps.frozen = false;
    rig.push({0, 0, 2}, 1.0);
    EXPECT_FALSE(rig.link.frozen());
    EXPECT_GT(rig.device.motorForce().z, 1.8);
}

// A packet has no checksum. With every hundredth byte wrong, the force stays what it is to be within what a count or two of
// each nibble can do, and nothing jumps.
TEST(FalconLink, GarbledBytesMakeNoSpike)
{
    Rig rig;
    rig.link.connect(rig.stop);
    const Vec3 force(0.0, 0.0, 4.0);
    rig.push(force, 1.0);
    rig.device.mishaps.garbled = 0.01;
    rig.largest = rig.jump = 0;
    const int usual = largestOf(rig.link.command().motor);
    double worst = 0.0;
    for (int i = 0; i < 200; ++i) {
        rig.push(force, 0.01);
        worst = std::max(worst, glm::length(rig.device.motorForce()));
    }
    EXPECT_GT(rig.link.counts().implausible + rig.link.counts().lostBytes, 20U) << "the fault did strike";
    EXPECT_LT(worst, 1.3 * glm::length(force + Vec3(0.0, rig.device.weight(), 0.0)));
    EXPECT_LT(rig.largest, 1.3 * usual);
}

TEST(FalconLink, SilenceTakesTheForceOffAndIsNoticed)
{
    for (const auto strike : {&Mishaps::mute, &Mishaps::stalled}) {
        Rig rig;
        rig.link.connect(rig.stop);
        rig.push({0, 0, 4}, 1.0);
        const int usual = largestOf(rig.link.command().motor);
        rig.device.mishaps.*strike = true;
        rig.largest = 0;
        rig.push({0, 0, 4}, 0.1);
        EXPECT_EQ(rig.link.command().motor, Triple{}) << "what is sent while nothing comes back";
        EXPECT_LE(rig.largest, usual + 20);
        EXPECT_FALSE(rig.link.lost());
        rig.push({0, 0, 4}, 0.5);
        EXPECT_TRUE(rig.link.lost());
    }
}

TEST(FalconLink, UnpluggingIsNoticedAtOnce)
{
    Rig rig;
    rig.link.connect(rig.stop);
    rig.push({0, 0, 4}, 0.6);
    rig.wire.plugged = false;
    rig.push({0, 0, 4}, 0.01);
    EXPECT_TRUE(rig.wire.gone());
    EXPECT_TRUE(rig.link.lost());
}

Mishaps anyMishaps(std::mt19937& random)
{
    const auto often = [&](unsigned n) { return random() % n == 0; };
    Mishaps m;
    m.mute = often(6);
    m.stalled = often(6);
    m.frozen = often(6);
    m.homeless = often(10);
    m.garbled = often(3) ? 0.02 : 0.0;
    m.dropped = often(3) ? 0.02 : 0.0;
    m.latency = often(3) ? 1e-3 * static_cast<double>(random() % 12U) : 0.0;
    return m;
}

// A thousand Falcons, each with ten faults one after the other, some unplugged or switched off meanwhile, under forces that
// change without a rule: the torque is within its limits and never grows faster than its slew, and what is lost comes back
// once nothing is wrong any more.
TEST(FalconLink, RandomFaultsNeitherCrashNorHangNorSpike)
{
    std::mt19937 random(11);
    std::uniform_real_distribution<double> newton(-9.0, 9.0), side(-0.02, 0.02);
    int lost = 0;
    std::uint64_t exchanges = 0, unanswered = 0, implausible = 0;
    for (int run = 0; run < 1000; ++run) {
        Rig rig;
        rig.device.makeReady();
        rig.link.connect(rig.stop);
        for (int fault = 0; fault < 10; ++fault) {
            rig.device.mishaps = anyMishaps(random);
            rig.wire.plugged = random() % 20 != 0;
            if (random() % 100 == 0) {
                rig.device.powerCycle();
            }
            rig.device.hand.goal = {side(random), side(random), 0.14 + side(random)};
            rig.push({newton(random), newton(random), newton(random)}, 0.02);
            if (rig.link.lost()) {
                ++lost;
                rig.device.mishaps = {};
                rig.wire.plugged = true;
                rig.link.close();
                rig.link.connect(rig.stop);
                rig.before = {};
            }
        }
        ASSERT_LE(rig.largest, largestCommand);
        ASSERT_LE(rig.jump, slewPerPacket) << "run " << run;
        exchanges += rig.link.counts().exchanges;
        unanswered += rig.link.counts().unanswered;
        implausible += rig.link.counts().implausible;
    }
    EXPECT_GT(lost, 300);
    EXPECT_GT(exchanges, 50000U);
    EXPECT_GT(unanswered, 1000U);
    EXPECT_GT(implausible, 100U);
}

}  // namespace
}  // namespace palpate::falcon
