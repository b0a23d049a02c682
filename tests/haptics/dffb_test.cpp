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

// Equation 4, with the fade of mode `field`: (structure + tissue) d0 / max(d, d0) times 3 t^2 - 2 t^3, t = 1 - d / range.
TEST(Dffb, FieldPushesAwayByEquationFour)
{
    const auto p = fieldOf(0.6, 0.4);
    const auto s = vitalAt(8e-3, Vec3(0, 0, 1), 1.5);
    DffbState state;
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
        DffbState state;
        EXPECT_NEAR(glm::length(additionalForce(p, 2, vitalAt(d, Vec3(1, 0, 0)), Vec3(0.0), true, dt, state)), 3.0, 1e-12);
    }
    DffbState state;
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
        DffbState state;
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
    DffbState state;
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
    DffbState state;
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
    DffbState state;
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

}  // namespace
}  // namespace palpate::haptics
