#include "stabilised.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace palpate::haptics {
namespace {

using namespace stabilised;

// Tissue that pushes out harder than it was pressed in gives energy in every stroke. The guard stops it near 1 mJ.
TEST(Passivity, GuardStopsTissueThatGivesEnergy)
{
    StabiliserState state;
    sendFor(0.6, Vec3(0.0), heldAt(Vec3(0.0)), premium, state);
    double most = 0.0;
    for (int i = 0; i < 20000; ++i) {
        const double phase = 2 * 3.14159265358979 * 1e-3 * i;
        const double x = 5e-3 * (1 - std::cos(phase));
        const double force = -(std::sin(phase) > 0.0 ? 100.0 : 200.0) * x;
        stabilise({force, 0, 0}, Vec3(0.0), heldAt({x, 0, 0}), premium, state);
        most = std::max(most, state.ledger.given);
    }
    // Unguarded it would be 20 strokes of 5 mJ.
    EXPECT_LT(most, 3e-3);
}

// The most that tissue gave beyond what it got [J] while a hand in it jumps out by `way` and comes back, every 2 n periods.
double madeByReversals(const StabiliserOptions& o, int n, double way, double stiffness, bool slowlyIn)
{
    StabiliserState state;
    double most = 0.0;
    const auto send = [&](double x) {
        stabilise(Vec3(-stiffness * x, 0, 0), Vec3(0.0), heldAt({x, 0, 0}), o, state);
        most = std::max(most, state.ledger.tissue);
    };
    sendFor(0.6, Vec3(0.0), heldAt(Vec3(0.0)), o, state);
    for (double x = 0.0; x < 5e-3; x += 2e-5) {
        send(x);
    }
    for (int i = 0; i < 5000; ++i) {
        const int phase = i % (2 * n);
        const double in = slowlyIn ? static_cast<double>(phase + 1) / n : 1.0;
        send(5e-3 - way * (phase < n ? 1.0 - in : 1.0));
    }
    return most;
}

// A faulty encoder that jumps to and fro: the guard alone, which takes the last direction for the next, let 4.2 J out in
// 20 s at 1 mm and 2 ms. Whatever the period, no more comes out than in the guard's time.
TEST(Passivity, PosesThatReverseGiveLittleEnergy)
{
    for (const char* name : {"premium", "touch", "falcon", "ideal"}) {
        const StabiliserOptions o{deviceParameters(name), tickSeconds, 8.5};
        for (const int n : {1, 2, 3, 5, 10, 30, 100}) {
            for (const double stiffness : {300.0, 800.0}) {
                for (const bool slowlyIn : {false, true}) {
                    const auto what = std::string(name) + " " + std::to_string(n) + " " + std::to_string(stiffness);
                    EXPECT_LT(madeByReversals(o, n, 1e-3, stiffness, slowlyIn), 8e-3) << what;
                    EXPECT_LT(madeByReversals(o, n, 3e-3, stiffness, slowlyIn), 25e-3) << what;
                }
            }
        }
    }
}

// A force that ended for such poses is back, whole, when the dead-man switch was let go, and without it when friction has
// taken what was given.
TEST(Passivity, ForceComesBackAfterPosesThatReversed)
{
    for (const bool released : {false, true}) {
        StabiliserState state;
        const auto send = [&](double x) {
            return -stabilise(Vec3(-300 * x, 0, 0), Vec3(0.0), heldAt({x, 0, 0}), premium, state).total().x;
        };
        sendFor(0.6, Vec3(0.0), heldAt(Vec3(0.0)), premium, state);
        for (int i = 0; i < 200; ++i) {
            send(5e-3 - (i % 2) * 1e-3);
        }
        EXPECT_LT(send(5e-3), 1e-9);
        if (released) {
            stabilise(Vec3(-1.5, 0, 0), Vec3(0.0), DeviceSample{}, premium, state);
            sendFor(0.6, Vec3(0.0), heldAt(Vec3(0.0)), premium, state);
        }
        for (int i = 0; !released && i < 30000; ++i) {
            send(-20e-3 * std::sin(2e-3 * i) - 21e-3);  // in the air
        }
        double sent = 0.0;
        for (double x = 0.0; x < 5e-3; x += 2e-5) {
            sent = send(x);
        }
        EXPECT_GT(sent, 0.9 * 300 * 5e-3) << released;
    }
}

// A hand that comes out as fast as it went in, while poses have stopped: it gets back what it put in, and 1 mJ at most.
TEST(Passivity, HandThatGoesOnUnseenGetsLittle)
{
    for (const double speed : {0.02, 0.08, 0.15}) {
        for (const double stiffness : {200.0, 800.0}) {
            StabiliserState state;
            sendFor(0.6, Vec3(0.0), heldAt(Vec3(0.0)), premium, state);
            DeviceSample sample = heldAt(Vec3(0.0));
            const double deep = 3e-3, step = speed * tickSeconds;
            double energy = 0.0, most = 0.0, force = 0.0;
            for (double way = step; way < 2 * deep; way += step) {
                energy += force * (way <= deep ? step : -step);
                sample.fresh = way <= deep;
                sample.position.x = sample.fresh ? way : sample.position.x;
                force = stabilise({-stiffness * sample.position.x, 0, 0}, Vec3(0.0), sample, premium, state).total().x;
                most = std::max(most, energy);
            }
            EXPECT_LT(most, 1e-3) << speed << " " << stiffness;
        }
    }
}

}  // namespace
}  // namespace palpate::haptics
