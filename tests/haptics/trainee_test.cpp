#include <haptics/simulation.h>
#include <haptics/trainee.h>

#include "models.h"

#include <tests/allocations.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

namespace palpate::haptics {
namespace {

const SessionModel& layers()
{
    static const auto model = tests::modelOf(tests::layeredScene + "[model]\nlevel = \"chainmail\"\n");
    return model;
}

struct Biopsy {
    std::vector<DeviceSample> samples;
    std::vector<CoreSample> cores;
    int entries = 0;  // from free into the body
    bool ended = false;
};

Biopsy biopsy(const Skill& skill, std::uint64_t seed, const SessionModel& model = layers())
{
    constexpr int longest = 200'000;
    Simulation simulation(model);
    Trainee trainee(model, skill, seed, 30e-3);
    Biopsy b;
    bool inside = false;
    for (int i = 0; i < longest && !trainee.finished(); ++i) {
        b.samples.push_back(trainee.read());
        const TickRecord& r = simulation.tick(b.samples.back());
        trainee.write(r.total);
        trainee.observe(r);
        if (r.fired) {
            b.cores.push_back(r.core);
        }
        b.entries += r.phase == Phase::inserted && !inside ? 1 : 0;
        inside = r.phase == Phase::inserted;
    }
    b.ended = trainee.finished();
    return b;
}

// Who makes no errors.
Skill flawless()
{
    Skill skill = skillCalled("expert");
    skill.tremor = skill.aimError = skill.entryError = skill.overshoot = 0.0;
    return skill;
}

TEST(Trainee, WithoutErrorsTakesOneCoreThatIsMostlyTarget)
{
    const Biopsy b = biopsy(flawless(), 1);
    EXPECT_TRUE(b.ended);
    ASSERT_EQ(b.cores.size(), 1U);
    EXPECT_GT(b.cores[0].targetFraction, 0.5);
    EXPECT_EQ(b.entries, 1);
}

// Who aims beside the target and does not look goes again until the core is enough or it may not.
TEST(Trainee, GoesAgainBecauseItMissed)
{
    Skill blind = flawless();
    blind.aimError = 12e-3;
    blind.vigilance = 0.0;
    blind.passes = 3;
    std::size_t most = 0;
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
        const Biopsy b = biopsy(blind, seed);
        EXPECT_TRUE(b.ended);
        for (std::size_t i = 0; i + 1 < b.cores.size(); ++i) {
            EXPECT_LT(b.cores[i].targetFraction, blind.content) << "went on after a core that was enough";
        }
        if (!b.cores.empty() && b.cores.back().targetFraction < blind.content) {
            EXPECT_EQ(b.cores.size(), 3U) << "gave up early";
        }
        most = std::max(most, b.cores.size());
    }
    EXPECT_GT(most, 1U);
}

// Who looks before firing takes another line where this one misses, and fires less often in vain.
TEST(Trainee, WhoLooksFiresLessInVain)
{
    Skill blind = flawless();
    blind.aimError = 9e-3;
    blind.vigilance = 0.0;
    Skill watchful = blind;
    watchful.vigilance = 1.0;
    std::size_t inVain = 0, inVainWatchful = 0;
    const auto poor = [](const Biopsy& b) {
        return static_cast<std::size_t>(
            std::count_if(b.cores.begin(), b.cores.end(), [](const CoreSample& c) { return c.targetFraction < 0.1; }));
    };
    for (std::uint64_t seed = 11; seed <= 13; ++seed) {
        inVain += poor(biopsy(blind, seed));
        inVainWatchful += poor(biopsy(watchful, seed));
    }
    EXPECT_GT(inVain, 0U);
    EXPECT_LT(inVainWatchful, inVain);
}

TEST(Trainee, IsAFunctionOfItsSeed)
{
    const Skill& novice = skillCalled("novice");
    const Biopsy a = biopsy(novice, 5), b = biopsy(novice, 5), other = biopsy(novice, 6);
    ASSERT_EQ(a.samples.size(), b.samples.size());
    for (std::size_t i = 0; i < a.samples.size(); ++i) {
        ASSERT_EQ(a.samples[i].position, b.samples[i].position) << i;
        ASSERT_EQ(a.samples[i].axis, b.samples[i].axis) << i;
        ASSERT_EQ(a.samples[i].buttons, b.samples[i].buttons) << i;
    }
    EXPECT_TRUE(a.samples.size() != other.samples.size() || a.samples[2000].position != other.samples[2000].position);
}

// The samples alone give the forces again: what the trainee sees is no hidden input of the simulation.
TEST(Trainee, ItsSessionReplaysFromTheSamples)
{
    const auto& model = layers();
    const Skill& resident = skillCalled("resident");
    const Biopsy b = biopsy(resident, 2);
    Simulation live(model), replay(model);
    Trainee trainee(model, resident, 2, 30e-3);
    for (const DeviceSample& sample : b.samples) {
        const TickRecord& r = live.tick(trainee.read());
        trainee.write(r.total);
        trainee.observe(r);
        ASSERT_EQ(r.total, replay.tick(sample).total);
    }
}

TEST(Trainee, AllocatesNothingInTheLoop)
{
    Simulation simulation(layers());
    Trainee trainee(layers(), skillCalled("novice"), 3, 30e-3);
    const auto before = tests::allocations();
    for (int i = 0; i < 20'000 && !trainee.finished(); ++i) {
        const TickRecord& r = simulation.tick(trainee.read());
        trainee.write(r.total);
        trainee.observe(r);
    }
    EXPECT_EQ(tests::allocations(), before);
}

TEST(Trainee, AnUnknownSkillIsNamedInTheError)
{
    try {
        skillCalled("master");
        FAIL();
    } catch (const std::runtime_error& e) {
        EXPECT_NE(std::string(e.what()).find("master"), std::string::npos);
        EXPECT_NE(std::string(e.what()).find("novice"), std::string::npos);
    }
}

// Over a long time the mean of |x|^2 is rms^2 and all power lies between 8 and 12 Hz.
TEST(Tremor, HasItsAmplitudeAndItsBand)
{
    datasets::Random random(4);
    const Tremor tremor(0.1e-3, random);
    constexpr int ticks = 32'000;
    double squares = 0, inBand = 0, outside = 0;
    for (int i = 0; i < ticks; ++i) {
        const Vec3 x = tremor.at(i * 1e-3);
        squares += glm::dot(x, x);
    }
    EXPECT_NEAR(std::sqrt(squares / ticks), 0.1e-3, 0.005e-3);
    for (double hertz = 1.0; hertz < 30.0; hertz += 0.25) {
        std::complex<double> sum = 0;
        for (int i = 0; i < ticks; ++i) {
            // A Hann window keeps the lines narrow.
            const double window = 0.5 - 0.5 * std::cos(2.0 * std::numbers::pi * i / ticks);
            sum += window * tremor.at(i * 1e-3).x * std::polar(1.0, -2.0 * std::numbers::pi * hertz * i * 1e-3);
        }
        (hertz > 7.7 && hertz < 12.3 ? inBand : outside) += std::norm(sum);
    }
    EXPECT_GT(inBand, 1000.0 * outside);
}

// Standard normal: mean 0, variance 1 within 4 standard errors.
TEST(Tremor, NormalNumbersAreStandard)
{
    datasets::Random random(9);
    double sum = 0, squares = 0;
    constexpr int n = 20'000;
    for (int i = 0; i < n; ++i) {
        const double x = normalOf(random);
        sum += x;
        squares += x * x;
    }
    EXPECT_NEAR(sum / n, 0.0, 4.0 / std::sqrt(n));
    EXPECT_NEAR(squares / n, 1.0, 4.0 * std::sqrt(2.0 / n));
}

}  // namespace
}  // namespace palpate::haptics
