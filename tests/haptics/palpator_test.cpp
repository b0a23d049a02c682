#include <haptics/palpator.h>
#include <haptics/score.h>

#include "models.h"

#include <tests/allocations.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <cmath>

namespace palpate::haptics {
namespace {

// A fingertip of 6 mm over the plane y = 0; the planned line is the y axis.
const SessionModel& plane()
{
    static const auto model = tests::modelOf(tests::sphereOnBlock("structure = \"tumour\"\naim_mm = [0, 25, 0]\n"));
    return model;
}

Skill exact()
{
    Skill skill = skillCalled("expert");
    skill.tremor = skill.touch = 0.0;
    return skill;
}

// A surface of stiffness `soft`, and more by a Gauss bell of width `sigma` around `middle`: what half way up marks is
// 2 sqrt(2 ln 2) sigma wide.
struct Surface {
    Vec3 middle;
    double sigma;
    double soft = 100, more = 200;  // [N/m]

    Vec3 force(Vec3 p, double radius) const
    {
        const double depth = p.y + radius;
        const double x = p.x - middle.x, z = p.z - middle.z;
        const double k = soft + more * std::exp(-(x * x + z * z) / (2 * sigma * sigma));
        return depth > 0 ? Vec3(0, -k * depth, 0) : Vec3(0.0);
    }
};

Score palpated(const Surface& surface, double diameter, const Skill& skill, std::uint64_t seed)
{
    SessionInfo info;
    info.extra = {{targetShapeKey, toText({surface.middle, {0, 1, 0}, diameter})}};
    Scorer scorer(info);
    Palpator finger(plane(), skill, seed, 30e-3);
    for (int i = 0; i < 400'000 && !finger.finished(); ++i) {
        TickRecord r;
        r.tick = static_cast<std::uint64_t>(i);
        r.device = finger.read();
        r.total = surface.force(r.device.position, plane().scene.tool.radius);
        finger.write(r.total);
        r.phase = glm::length(r.total) > 0 ? Phase::contact : Phase::free;
        scorer.add(r);
    }
    EXPECT_TRUE(finger.finished());
    return scorer.score();
}

TEST(Palpator, MarksHalfWayUpAroundTheStiffestPlace)
{
    constexpr double sigma = 6e-3;
    const double width = 2 * std::sqrt(2 * std::log(2.0)) * sigma;
    for (const Vec3 middle : {Vec3(9e-3, 13e-3, -6e-3), Vec3(-12e-3, 13e-3, 4e-3), Vec3(0, 13e-3, 0)}) {
        const Score s = palpated({middle, sigma}, width, exact(), 1);
        EXPECT_EQ(s.marks, 4U);
        EXPECT_LT(s.markError, 1.5e-3);
        EXPECT_LT(s.markSizeError, 2e-3);
    }
}

// Nothing tells it where the lump is but the force: on a surface that is stiffer elsewhere it marks elsewhere.
TEST(Palpator, FollowsTheForceAlone)
{
    const Vec3 there(-10e-3, 13e-3, 8e-3);
    const Score s = palpated({there, 6e-3}, 14e-3, exact(), 1);
    EXPECT_LT(s.markError, 2e-3);
    EXPECT_GT(glm::distance(there, plane().approach.aim), 10e-3);
}

TEST(Palpator, AllocatesNothingInTheLoop)
{
    Palpator finger(plane(), skillCalled("novice"), 1, 30e-3);
    const Surface surface{{5e-3, 13e-3, 5e-3}, 6e-3};
    const auto before = tests::allocations();
    for (int i = 0; i < 400'000 && !finger.finished(); ++i) {
        finger.write(surface.force(finger.read().position, plane().scene.tool.radius));
    }
    EXPECT_EQ(tests::allocations(), before);
}

}  // namespace
}  // namespace palpate::haptics
