#include <haptics/motion.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <random>

namespace palpate::haptics {
namespace {

Vec3 rounded(Vec3 v, double step)
{
    return {std::round(v.x / step) * step, std::round(v.y / step) * step, std::round(v.z / step) * step};
}

// Whatever is read: within half a step of it, on every axis, and so within a step of the truth.
TEST(BetweenSteps, NeverContradictsTheReading)
{
    constexpr double encoder = 0.05e-3;
    std::mt19937 random(3);
    std::normal_distribution<double> normal(0.0, 1.0);
    EncoderState state;
    Vec3 truth(0.0), velocity(0.0);
    for (int i = 0; i < 20000; ++i) {
        velocity = 0.99 * velocity + 0.02 * Vec3(normal(random), normal(random), normal(random));
        truth += i % 4000 == 3999 ? Vec3(0.1, 0, -0.05) : 1e-3 * velocity;
        const Vec3 read = rounded(truth, encoder);
        const Vec3 off = glm::abs(betweenSteps(read, encoder, 1e-3, state) - read);
        ASSERT_LE(std::max({off.x, off.y, off.z}), 0.5 * encoder * (1 + 1e-9));
    }
}

// A steady motion, slow and fast, at every rate: its steps from tick to tick are even, where those that are read are of 0
// and of whole encoder steps, and it is nearer to the truth.
TEST(BetweenSteps, SteadyMotionIsEven)
{
    constexpr double encoder = 0.05e-3;
    for (const double rate : {1000.0, 4000.0}) {
        for (const double speed : {0.031, 0.083, 0.21}) {
            EncoderState state;
            double uneven = 0.0, unevenRead = 0.0, off = 0.0, offRead = 0.0;
            Vec3 before(0.0), readBefore(0.0);
            for (int i = 0; i < 2000; ++i) {
                const double x = speed * i / rate;
                const Vec3 read = rounded({x, 0, 0}, encoder);
                const Vec3 now = betweenSteps(read, encoder, 1 / rate, state);
                if (i > 100) {
                    uneven += std::pow(now.x - before.x - speed / rate, 2);
                    unevenRead += std::pow(read.x - readBefore.x - speed / rate, 2);
                    off += std::pow(now.x - x, 2);
                    offRead += std::pow(read.x - x, 2);
                }
                before = now;
                readBefore = read;
            }
            EXPECT_LT(uneven, 0.5 * unevenRead) << rate << " " << speed;
            EXPECT_LT(off, 1.1 * offRead) << rate << " " << speed;
        }
    }
}

// A tip that stands still is where it was; and without an encoder it is where it is read.
TEST(BetweenSteps, RestsAndPassesUnchanged)
{
    EncoderState state, ideal;
    for (int i = 0; i < 100; ++i) {
        betweenSteps({0.04 * i * 1e-3, 0, 0}, 0.05e-3, 1e-3, state);
        const Vec3 read(1e-3 * std::sin(0.1 * i), 0, 1e-6 * i);
        EXPECT_EQ(betweenSteps(read, 0.0, 1e-3, ideal), read);
    }
    for (int i = 0; i < 50; ++i) {
        betweenSteps({0.004, 0, 0}, 0.05e-3, 1e-3, state);
    }
    const Vec3 resting = state.position;
    for (int i = 0; i < 50; ++i) {
        EXPECT_EQ(betweenSteps({0.004, 0, 0}, 0.05e-3, 1e-3, state), resting);
    }
}

}  // namespace
}  // namespace palpate::haptics
