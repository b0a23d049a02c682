#include <session/faults.h>

#include <tests/error_of.h>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace palpate::session {
namespace {

// Moves 1 mm in every tick along its axis, and keeps the force that it was given.
struct Moving final : haptics::Device {
    haptics::DeviceSample read() noexcept override
    {
        haptics::DeviceSample sample;
        sample.position = {0, 1e-3 * ++reads, 0};
        return sample;
    }
    void write(Vec3 force) noexcept override { felt = force; }
    bool finished() const noexcept override { return false; }

    int reads = 0;
    Vec3 felt{0.0};
};

struct Rig {
    explicit Rig(const std::string& text)
    {
        auto device = std::make_unique<Moving>();
        behind = device.get();
        faulty = std::make_unique<FaultyDevice>(std::move(device), parseFaults(text));
    }
    haptics::DeviceSample tick()
    {
        const auto sample = faulty->read();
        faulty->write({0, 1, 0});
        return sample;
    }
    // The sample of this tick, of which 0 is the first.
    haptics::DeviceSample at(int tick)
    {
        for (; ticks < tick; ++ticks) {
            this->tick();
        }
        ++ticks;
        return this->tick();
    }

    Moving* behind = nullptr;
    std::unique_ptr<FaultyDevice> faulty;
    int ticks = 0;
};

TEST(Faults, AreReadWithTheirUnits)
{
    const auto faults = parseFaults(
        "gap=50ms@2s,late=5ms/0.25s@3s,nan@500ms,jump=10cm/20ms@2s,unplug=200ms@1s,"
        "stall-viewer=2s@1s,disk-full@7s,gap@4s");
    ASSERT_EQ(faults.size(), 8U);
    EXPECT_EQ(faults[0].kind, FaultKind::gap);
    EXPECT_DOUBLE_EQ(faults[0].length, 50e-3);
    EXPECT_DOUBLE_EQ(faults[0].start, 2.0);
    EXPECT_EQ(faults[1].kind, FaultKind::late);
    EXPECT_DOUBLE_EQ(faults[1].amount, 5e-3);
    EXPECT_DOUBLE_EQ(faults[1].length, 0.25);
    EXPECT_EQ(faults[2].kind, FaultKind::nan);
    EXPECT_DOUBLE_EQ(faults[2].start, 0.5);
    EXPECT_DOUBLE_EQ(faults[3].amount, 0.1);
    EXPECT_DOUBLE_EQ(faults[4].length, 0.2);
    EXPECT_EQ(faults[5].kind, FaultKind::stallViewer);
    EXPECT_TRUE(std::isinf(faults[6].length));
    EXPECT_TRUE(has(faults, FaultKind::jump));
    EXPECT_FALSE(has(parseFaults("nan@1s"), FaultKind::jump));
}

TEST(Faults, WhatIsMalformedIsRefusedOnOneLineThatNamesIt)
{
    for (const std::string text :
         {"",           "gap",         "gap=50ms",        "gap=50@2s",      "gap=50ms@2",  "gap=@2s",    "gap=50ms@2s,",
          "gap=0ms@2s", "gap=-5ms@2s", "gap=11s@2s",      "gap=nans@2s",    "jump=5s@2s",  "jump=2m@1s", "late=5mm@1s",
          "nan@0s",     "nan@90000s",  "disk-full=1s@2s", "gap=5ms/5ms@1s", "gasp=5ms@1s", "@2s"}) {
        const std::string error = tests::errorOf([&] { parseFaults(text); });
        EXPECT_TRUE(error.starts_with("--inject: ")) << text << ": " << error;
        EXPECT_EQ(error.find('\n'), std::string::npos) << text;
    }
    EXPECT_NE(tests::errorOf([] { parseFaults("nan@1s,gasp=5ms@1s"); }).find("gasp=5ms@1s"), std::string::npos);
}

// 20 ms ahead, from tick 100 on: the pose is 100 mm further along the axis, and then where it would have been.
TEST(Faults, AJumpComesBack)
{
    Rig rig("jump=100mm/20ms@100ms");
    EXPECT_DOUBLE_EQ(rig.at(99).position.y, 0.100);
    EXPECT_DOUBLE_EQ(rig.at(100).position.y, 0.201);
    EXPECT_DOUBLE_EQ(rig.at(119).position.y, 0.220);
    EXPECT_DOUBLE_EQ(rig.at(120).position.y, 0.121);
}

TEST(Faults, OnePoseIsNotANumber)
{
    Rig rig("nan@100ms");
    EXPECT_TRUE(std::isfinite(rig.at(99).position.y));
    EXPECT_TRUE(std::isnan(rig.at(100).position.y));
    EXPECT_TRUE(std::isfinite(rig.at(101).position.y));
}

// Unplugged, the last pose stays and is not fresh; the hand moves on and feels nothing.
TEST(Faults, AnUnpluggedDeviceSaysNothingAndFeelsNothing)
{
    Rig rig("unplug=20ms@100ms");
    EXPECT_TRUE(rig.at(99).fresh);
    EXPECT_DOUBLE_EQ(rig.behind->felt.y, 1.0);
    const auto cut = rig.at(110);
    EXPECT_FALSE(cut.fresh);
    EXPECT_DOUBLE_EQ(cut.position.y, 0.100);
    EXPECT_DOUBLE_EQ(rig.behind->felt.y, 0.0);
    const auto back = rig.at(120);
    EXPECT_TRUE(back.fresh);
    EXPECT_DOUBLE_EQ(back.position.y, 0.121);
    EXPECT_DOUBLE_EQ(rig.behind->felt.y, 1.0);
}

// 50 ms during which nobody looks: the hand is 50 mm further.
TEST(Faults, TheHandGoesOnThroughAGapAndADelay)
{
    Rig gap("gap=50ms@100ms");
    EXPECT_DOUBLE_EQ(gapAfter(parseFaults("gap=50ms@100ms"), 100), 50e-3);
    EXPECT_DOUBLE_EQ(gapAfter(parseFaults("gap=50ms@100ms"), 101), 0.0);
    EXPECT_DOUBLE_EQ(gap.at(100).position.y, 0.101);
    EXPECT_DOUBLE_EQ(gap.at(101).position.y, 0.152);
    Rig late("late=2ms/3ms@100ms");
    EXPECT_DOUBLE_EQ(late.at(100).position.y, 0.101);
    EXPECT_DOUBLE_EQ(late.at(101).position.y, 0.104);
    EXPECT_DOUBLE_EQ(late.at(104).position.y, 0.111);
}

// A record that a gap takes beyond its end.
TEST(Faults, AGapBeyondTheEndOfARecordIsTheEnd)
{
    struct Short final : haptics::Device {
        haptics::DeviceSample read() noexcept override
        {
            haptics::DeviceSample sample;
            sample.position.y = 1e-3 * ++reads;
            return sample;
        }
        void write(Vec3) noexcept override {}
        bool finished() const noexcept override { return reads >= 20; }
        int reads = 0;
    };
    FaultyDevice faulty(std::make_unique<Short>(), parseFaults("gap=50ms@5ms"));
    for (int i = 0; i < 10; ++i) {
        EXPECT_LE(faulty.read().position.y, 20.5e-3);
    }
    EXPECT_TRUE(faulty.finished());
    EXPECT_FALSE(faulty.read().fresh);
}

}  // namespace
}  // namespace palpate::session
