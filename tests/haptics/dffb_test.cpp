#include <haptics/dffb.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <cmath>
#include <numbers>

namespace palpate::haptics {
namespace {

constexpr double dt = 1e-3;
using Structures = std::array<Proximity, maxStructures>;
using datasets::DffbMode;
using datasets::DffbParameters;

// A target far away and one vital structure.
Structures vitalAt(double distance, Vec3 away, double gain = 1.0)
{
    Structures s{};
    s[0] = {1.0, away, 1.0, false, false};
    s[1] = {distance, away, gain, true, false};
    return s;
}

DffbParameters fieldOf(double structure, double tissue)
{
    DffbParameters p;
    p.mode = DffbMode::field;
    p.structure.force = structure;
    p.tissue.force = tissue;
    p.floorDistance = 2e-3;
    p.range = 20e-3;
    p.budget = 100.0;
    return p;
}

// A contact that has lasted long enough for the whole force, with the tip at rest in one place.
DffbState inContact(Vec3 tip = Vec3(0.0))
{
    DffbState s;
    s.presence = 1.0;
    s.last = s.mass = tip;
    s.started = true;
    return s;
}

// Equation 4, with the fade of mode `field`: (structure + tissue) d0 / max(d, d0) times 3 t^2 - 2 t^3, t = 1 - d / range.
TEST(Dffb, FieldPushesAwayByEquationFour)
{
    const auto p = fieldOf(0.6, 0.4);
    const auto s = vitalAt(8e-3, Vec3(0, 0, 1), 1.5);
    DffbState state = inContact();
    const Vec3 f = additionalForce(p, 2, s, Vec3(0.0), true, dt, state);
    const double t = 1.0 - 8.0 / 20.0;
    EXPECT_NEAR(f.z, 1.5 * 1.0 * (2.0 / 8.0) * t * t * (3 - 2 * t), 1e-12);
    EXPECT_EQ(f.x, 0.0);
}

TEST(Dffb, ForceStaysFiniteAndBoundedAtTheStructureAndIsZeroBeyondTheRange)
{
    auto p = fieldOf(5.0, 5.0);
    p.budget = 3.0;
    for (const double d : {-1.0, 0.0, 1e-12}) {
        DffbState state = inContact();
        EXPECT_NEAR(glm::length(additionalForce(p, 2, vitalAt(d, Vec3(1, 0, 0)), Vec3(0.0), true, dt, state)), 3.0, 1e-12);
    }
    DffbState state = inContact();
    EXPECT_EQ(additionalForce(p, 2, vitalAt(20e-3, Vec3(1, 0, 0)), Vec3(0.0), true, dt, state), Vec3(0.0));
}

// Smooth in distance: between neighbouring distances the force changes by no more than the steepest slope of equation 4
// with its fade allows, 1 / d0 + 1.5 / range per newton, also at the floor, at the range and at contact.
TEST(Dffb, FieldHasNoStepInDistance)
{
    const auto p = fieldOf(0.6, 0.4);
    const double step = 1e-6;
    const double slope = 1.0 / p.floorDistance + 1.5 / p.range;
    double before = 0.0;
    for (double d = -2e-3; d < 25e-3; d += step) {
        DffbState state = inContact();
        const double f = additionalForce(p, 2, vitalAt(d, Vec3(0, 0, 1)), Vec3(0.0), true, dt, state).z;
        if (d > -2e-3) {
            ASSERT_LE(std::abs(f - before), slope * step * (1 + 1e-6)) << d;
        }
        before = f;
    }
}

TEST(Dffb, NoContactNoForce)
{
    const auto p = fieldOf(1.0, 1.0);
    DffbState state;
    EXPECT_EQ(additionalForce(p, 2, vitalAt(1e-3, Vec3(0, 0, 1)), Vec3(0.0), false, dt, state), Vec3(0.0));
}

// Equations 5-8: a mass M on spring K and damper C, driven at the tip by x(t) = A sin(w t). In the steady state the force
// on the tip is M times the mass's acceleration, amplitude M w^2 |H| A with H = (K + i w C) / (K - M w^2 + i w C).
TEST(Dffb, ThesisIsTheInertiaEffectOfTheSummedParameters)
{
    DffbParameters p;
    p.mode = DffbMode::thesis;
    p.surgery = {10.0, 0.05, 0.4, 20.0};
    p.task = {10.0, 0.05, 0.6, 30.0};
    const double m = 0.1, c = 1.0, k = 50.0, amplitude = 2e-3, w = 2 * std::numbers::pi * 3.0;
    DffbState state = inContact();
    double peak = 0.0;
    for (int i = 0; i < 6000; ++i) {
        const Vec3 tip(amplitude * std::sin(w * dt * i), 0, 0);
        const Vec3 f = additionalForce(p, 1, {}, tip, true, dt, state);
        peak = i > 4000 ? std::max(peak, std::abs(f.x)) : 0.0;
    }
    const double above = std::hypot(k, w * c), below = std::hypot(k - m * w * w, w * c);
    EXPECT_NEAR(peak, m * w * w * amplitude * above / below, 0.05 * peak);
}

// The lookup table in order: the second vital structure counts only after the first was touched.
TEST(Dffb, ThesisTakesTheNextVitalStructureOnContact)
{
    DffbParameters p;
    p.mode = DffbMode::thesis;
    p.structure = {1.0, 0.1, 1.0, 50.0};
    auto s = vitalAt(10e-3, Vec3(0, 0, 1));
    s[2] = {5e-3, Vec3(0, 0, 1), 1.0, true, false};
    DffbState state = inContact();
    additionalForce(p, 3, s, Vec3(0.0), true, dt, state);
    EXPECT_EQ(state.cursor, 1);
    s[1].touching = true;
    additionalForce(p, 3, s, Vec3(0.0), true, dt, state);
    EXPECT_EQ(state.cursor, 2);
    additionalForce(p, 3, s, Vec3(0.0), true, dt, state);
    EXPECT_EQ(state.cursor, 2);
}

// A closed path through the field without damping does no net work: the force depends on the place alone.
TEST(Dffb, FieldWithoutDampingDoesNoWorkOverAClosedPath)
{
    const auto p = fieldOf(0.6, 0.4);
    DffbState state = inContact();
    const Vec3 structure(0.0);
    double work = 0.0, absolute = 0.0;
    const int steps = 20000;
    const auto place = [&](int i) {
        const double a = 2 * std::numbers::pi * i / steps;
        return Vec3(7e-3 + 4e-3 * std::cos(a), 5e-3 * std::sin(a), 2e-3 * std::sin(2 * a));
    };
    for (int i = 0; i < steps; ++i) {
        const Vec3 x = 0.5 * (place(i) + place(i + 1));
        const auto s = vitalAt(glm::distance(x, structure), glm::normalize(x - structure));
        const double w = glm::dot(additionalForce(p, 2, s, x, true, dt, state), place(i + 1) - place(i));
        work += w;
        absolute += std::abs(w);
    }
    EXPECT_LT(std::abs(work), 1e-5 * absolute);
}

// On contact the force comes in within 50 ms, on release it goes within 50 ms, both in a straight line.
TEST(Dffb, ContactFadesTheForceInAndOut)
{
    const auto p = fieldOf(0.6, 0.4);
    const auto s = vitalAt(8e-3, Vec3(0, 0, 1));
    DffbState whole = inContact(), state;
    const double full = additionalForce(p, 2, s, Vec3(0.0), true, dt, whole).z;
    for (int i = 1; i <= 100; ++i) {
        const double f = additionalForce(p, 2, s, Vec3(0.0), i <= 50, dt, state).z;
        EXPECT_NEAR(f, full * (i <= 50 ? i : 100 - i) / 50.0, 1e-12) << i;
    }
}

// A study's gain scales the whole force; faded, it falls in a straight line to nothing over the session, and stays there.
TEST(Dffb, GainScalesAndFades)
{
    auto p = fieldOf(0.6, 0.4);
    const auto s = vitalAt(8e-3, Vec3(0, 0, 1));
    DffbState whole = inContact(), half = inContact(), fading = inContact();
    const double full = additionalForce(p, 2, s, Vec3(0.0), true, dt, whole).z;
    p.gain = 0.5;
    EXPECT_NEAR(additionalForce(p, 2, s, Vec3(0.0), true, dt, half).z, 0.5 * full, 1e-12);
    p.gain = 1.0;
    p.fade = 2.0;
    for (int i = 1; i <= 2500; ++i) {
        const double f = additionalForce(p, 2, s, Vec3(0.0), true, dt, fading).z;
        EXPECT_NEAR(f, full * std::max(0.0, 1.0 - i * dt / 2.0), 1e-9);
    }
}

// Constant terms make the inertia effect: a passive mass on spring and damper. Over closed paths that begin and end at rest
// the hand gets no work from it and puts in no less than the damper takes, C |x' - m'|^2 integrated; how much more the
// low-pass of the velocity (30 Hz) makes of it, an integration of equation 5 with it in steps of 20 us (leapfrog, not the
// implicit rule of the simulation) gives.
TEST(Dffb, ConstantTermDoesNoNetWorkOverAClosedPathBeyondItsDamping)
{
    DffbParameters p;
    p.mode = DffbMode::thesis;
    p.surgery = {50.0, 0.1, 1.5, 60.0};
    const auto place = [](double t) {
        const double a = 2 * std::numbers::pi * std::min(t, 2.0) / 2.0;
        const double begin = 0.5 - 0.5 * std::cos(a);  // at rest at both ends
        return Vec3(8e-3 * begin * std::cos(3 * a), 6e-3 * begin * std::sin(2 * a), 4e-3 * begin);
    };
    const auto workAt = [&](double period) {
        DffbState state = inContact(place(0.0));
        double work = 0.0;  // by the force on the hand
        Vec3 before(0.0);
        for (int i = 1; i * period < 6.0; ++i) {
            const Vec3 f = additionalForce(p, 1, {}, place(i * period), true, period, state);
            work += 0.5 * glm::dot(f + before, place(i * period) - place((i - 1) * period));
            before = f;
        }
        return work;
    };
    double damped = 0.0, expected = 0.0;
    const double h = 2e-5, band = 2 * std::numbers::pi * 30.0;
    for (const bool filtered : {false, true}) {
        Vec3 m = place(0.0), v(0.0), felt(0.0);
        for (int i = 0; i < 300000; ++i) {
            const double t = i * h;
            const Vec3 x = place(t), xv = (place(t + h) - place(std::max(t - h, 0.0))) / (t - h > 0 ? 2 * h : h);
            felt = filtered ? felt + h * band * (xv - felt) : xv;
            const Vec3 onMass = 60.0 * (x - m) + 1.5 * (felt - v);
            v += h / 0.1 * onMass;
            m += h * v;
            damped += filtered ? 0.0 : h * 1.5 * glm::dot(xv - v, xv - v);
            expected += filtered ? h * glm::dot(onMass, xv) : 0.0;
        }
    }
    EXPECT_GT(-workAt(dt), damped);
    EXPECT_NEAR(-workAt(dt), expected, 0.25 * expected);
    EXPECT_NEAR(-workAt(0.1 * dt), expected, 0.025 * expected);
}

// The bound on the force acts on mass and hand alike: however tight, no closed path gives energy.
TEST(Dffb, BoundedInertiaEffectStaysPassive)
{
    for (const double bound : {0.02, 0.1, 0.5}) {
        DffbParameters p;
        p.mode = DffbMode::thesis;
        p.surgery = {bound, 0.2, 0.3, 150.0};
        DffbState state = inContact();
        double work = 0.0, most = 0.0;
        Vec3 before(0.0), last(0.0);
        for (int i = 1; i <= 20000; ++i) {
            const double t = i * dt;
            const Vec3 x(5e-3 * std::sin(2 * t) * std::sin(9 * t), 5e-3 * std::sin(5 * t) * std::sin(0.3 * t), 0);
            const Vec3 f = additionalForce(p, 1, {}, x, true, dt, state);
            EXPECT_LE(glm::length(f), bound * (1 + 1e-12));
            work += 0.5 * glm::dot(f + before, x - last);
            before = f;
            last = x;
            most = std::max(most, work);
        }
        EXPECT_LT(work, 0.0) << bound;
        EXPECT_LT(most, 0.05 * -work) << bound;
    }
}

}  // namespace
}  // namespace palpate::haptics
