// Tissue that relaxes, in the tick.
#include "models.h"

#include <tests/allocations.h>

#include <haptics/simulation.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

namespace palpate::haptics {
namespace {

constexpr double relaxedBall = 10e-3;
constexpr double depth = 4e-3;
constexpr int relaxedRamp = 500;  // ticks of the stabiliser's ramp, and more

const SessionModel& block(bool relaxes)
{
    const auto scene = [](bool on) {
        const std::string model = on ? "[model]\nrelaxation = true\n" : "";
        return tests::modelOf(
            tests::sphereOnBlock("structure = \"base\"\naim_mm = [0, 55, 0]\n[volume.parameters]\ntumours = 0\n" + model));
    };
    static const SessionModel with = scene(true), without = scene(false);
    return relaxes ? with : without;
}

DeviceSample sampleAt(double deep)
{
    DeviceSample s;
    s.position = {0, deep - relaxedBall, 0};
    s.axis = {0, 1, 0};
    s.buttons = buttonDeadMan;
    return s;
}

// Waits, presses in a twentieth of a second, holds for `seconds`.
std::vector<DeviceSample> pressed(double seconds)
{
    std::vector<DeviceSample> samples(relaxedRamp, sampleAt(-1e-3));
    for (int i = 0; i < 50; ++i) {
        samples.push_back(sampleAt(depth * i / 50.0));
    }
    samples.insert(samples.end(), static_cast<std::size_t>(seconds / tickSeconds), sampleAt(depth));
    return samples;
}

std::vector<double> forces(const SessionModel& model, const std::vector<DeviceSample>& samples)
{
    Simulation simulation(model);
    std::vector<double> out;
    for (const DeviceSample& s : samples) {
        out.push_back(-simulation.tick(s).tissueForce.y);
    }
    return out;
}

// A ball that is pressed in and held: its force falls by the table's series, and about a second later it is that of tissue
// that does not relax.
TEST(RelaxingTissue, HeldForceFallsByTheTablesSeries)
{
    const auto samples = pressed(3.0);
    const auto relaxing = forces(block(true), samples), elastic = forces(block(false), samples);
    const auto& table = block(true).tissue->table();
    const volume::Relaxation fat = table.rows[*table.find("fat")].relaxation();
    ASSERT_TRUE(fat.any());
    const double held = elastic.back();
    for (const double seconds : {0.2, 0.5, 1.0, 3.0}) {
        const double now = relaxing[static_cast<std::size_t>(relaxedRamp + 50 + seconds / tickSeconds) - 1];
        EXPECT_NEAR(now, held * fat.instantaneous() * fat.remaining(seconds), 0.04 * held) << seconds;
    }
}

TEST(RelaxingTissue, SameSamplesGiveTheSameBitsAndNoHeapIsUsed)
{
    const auto samples = pressed(0.5);
    const auto first = forces(block(true), samples);
    Simulation simulation(block(true));
    std::vector<double> second(samples.size());
    const auto calls = tests::heapCallsIn([&] {
        for (std::size_t i = 0; i < samples.size(); ++i) {
            second[i] = -simulation.tick(samples[i]).tissueForce.y;
        }
    });
    EXPECT_EQ(first, second);
    EXPECT_EQ(calls, 0U);
}

// Small windows that take over have not forgotten: the force stays within a tenth, where tissue as it is right after a step
// would give two fifths more.
TEST(RelaxingTissue, AStepDownTakesTheHistoryAlong)
{
    auto samples = pressed(3.0);
    const std::size_t asked = samples.size() - 200;
    samples[asked].buttons |= modelTooSlow;
    const auto force = forces(block(true), samples);
    for (std::size_t i = asked + 30; i < samples.size(); ++i) {
        ASSERT_NEAR(force[i], force[asked - 1], 0.1 * force[asked - 1]) << i - asked;
    }
}

// A step down after the tool has left: whenever the next touch comes, it is that of tissue at rest.
TEST(RelaxingTissue, AStepDownWithoutATouchLeavesNothingToTheNextOne)
{
    const auto again = [](bool isPressedBefore) {
        Simulation simulation(block(true));
        DeviceSample sample;
        sample.axis = {0, 1, 0};
        const auto goTo = [&](double depth, double speed) {
            while (std::abs(sample.position.y - depth) > 1e-9) {
                const double way = depth - sample.position.y;
                sample.position.y += std::clamp(way, -speed * tickSeconds, speed * tickSeconds);
                simulation.tick(sample);
            }
        };
        sample.position = {0, -30e-3, 0};
        goTo(isPressedBefore ? -4e-3 : -20e-3, 0.05);
        for (int i = 0; i < 1500; ++i) {
            simulation.tick(sample);
        }
        goTo(-30e-3, 0.05);
        sample.buttons |= modelTooSlow;
        simulation.tick(sample);
        sample.buttons &= ~modelTooSlow;
        for (int i = 0; i < 500; ++i) {
            simulation.tick(sample);
        }
        std::vector<double> force;
        goTo(-10e-3, 0.05);
        while (sample.position.y < -6e-3) {
            sample.position.y += 0.05 * tickSeconds;
            force.push_back(-simulation.tick(sample).tissueForce.y);
        }
        return force;
    };
    const auto pressed = again(true), fresh = again(false);
    ASSERT_EQ(pressed.size(), fresh.size());
    EXPECT_GT(fresh.back(), 0.05);
    for (std::size_t i = 0; i < fresh.size(); ++i) {
        EXPECT_NEAR(pressed[i], fresh[i], 0.02 * fresh[i] + 1e-4) << i;
    }
}

// Level `spring` is rigid tissue: it has nothing to relax.
TEST(RelaxingTissue, LevelSpringHoldsItsForce)
{
    auto model = tests::modelOf(tests::sphereOnBlock(
        "structure = \"base\"\naim_mm = [0, 55, 0]\n[model]\nrelaxation = true\nlevel = \"spring\"\n"));
    const auto samples = pressed(1.0);
    const auto force = forces(model, samples);
    EXPECT_EQ(force.back(), force[relaxedRamp + 60]);
}

}  // namespace
}  // namespace palpate::haptics
