#include "elastic_bodies.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace palpate::chainmail {
namespace {

constexpr double blockSpacing = 1e-3;
constexpr double bigRadius = 10e-3;
constexpr double depth = 0.8e-3;
const Vec3 blockTop(15e-3, 0.0, 13e-3);

const ElasticBody& block()
{
    static const ElasticBody body = tests::bodyOf(tests::heldBlock({30, 18, 26}, blockSpacing, 1e4, 0.45));
    return body;
}

Vec3 alongTop(double degrees)
{
    const double angle = degrees * std::acos(-1.0) / 180.0;
    return {std::cos(angle), 0.0, std::sin(angle)};
}

// A ball on the block that presses, and is led along a path at equilibrium.
class Drag {
public:
    explicit Drag(double friction) : elastic_(block(), {}, tests::focusUnder(blockTop)), friction_(friction) {}

    // To `deep` under the top and `aside` of its middle, in steps of 0.1 mm.
    void go(double deep, Vec3 aside)
    {
        const Vec3 to = blockTop + Vec3(0.0, deep - bigRadius, 0.0) + aside;
        const int steps = std::max(1, static_cast<int>(std::ceil(glm::distance(at_, to) / 0.1e-3)));
        const Vec3 from = at_;
        for (int i = 1; i <= steps; ++i) {
            const Vec3 before = force_;
            at_ = glm::mix(from, to, static_cast<double>(i) / steps);
            std::array tools{tests::ball(at_, bigRadius)};
            tools[0].friction = friction_;
            energy_ = tests::settle(elastic_, tests::loadOf(tools, {}, blockTop), 1e-4, 100).energy;
            force_ = elastic_.toolForce(0);
            work_ -= 0.5 * glm::dot(force_ + before, to - from) / steps;
        }
    }
    double normal() const { return -force_.y; }
    double along(Vec3 way) const { return -glm::dot(force_, way); }
    double across() const { return std::hypot(force_.x, force_.z); }
    // Largest force along the surface over push, of any point.
    double maxFriction() const
    {
        double most = 0.0;
        for (const ContactSite& s : elastic_.sites()) {
            const double push = glm::dot(s.force, s.normal);
            most = std::max(most, push > 0.0 ? glm::length(s.force - push * s.normal) / push : 0.0);
        }
        return most;
    }
    double energy() const { return energy_; }
    // That the hand has done so far, by the trapezoidal rule [J].
    double work() const { return work_; }

private:
    Elastic elastic_;
    double friction_;
    Vec3 at_ = blockTop - Vec3(0.0, bigRadius, 0.0);
    Vec3 force_{0.0};
    double energy_ = 0.0;
    double work_ = 0.0;
};

// Without friction a flat homogeneous block has nothing to hold a ball with: what the grid adds is under 3 %.
TEST(ElasticFriction, NoneHasNoForceAlongAFlatSurface)
{
    for (const double degrees : {0.0, 30.0, 90.0}) {
        Drag drag(0.0);
        drag.go(depth, Vec3(0.0));
        for (int i = 1; i <= 12; ++i) {
            drag.go(depth, 0.25e-3 * i * alongTop(degrees));
            ASSERT_LT(drag.across(), 0.03 * drag.normal()) << degrees << " degrees, " << 0.25 * i << " mm";
        }
    }
}

// Coulomb, point by point: along its surface a ball never holds a point of tissue with more than mu times what it pushes it
// with. So a ball that slips feels mu times its normal force against the way it goes, 15 % more at most for the slope of
// the dent that it is in; and steadily: a step of 0.25 mm on never changes that by over 12 %.
TEST(ElasticFriction, BallThatIsDraggedFeelsCoulombsForce)
{
    for (const double mu : {0.15, 0.4}) {
        const Vec3 way = alongTop(20.0);
        Drag drag(mu);
        drag.go(depth, Vec3(0.0));
        double before = 0.0;
        for (int i = 1; i <= 14; ++i) {
            drag.go(depth, 0.25e-3 * i * way);
            const double along = drag.along(way);
            ASSERT_LT(drag.maxFriction(), mu * (1.0 + 1e-9)) << "mu " << mu << ", " << 0.25 * i << " mm";
            ASSERT_LT(along, 1.15 * mu * drag.normal()) << "mu " << mu << ", " << 0.25 * i << " mm";
            if (i > 8) {
                EXPECT_NEAR(along, before, 0.12 * before) << "mu " << mu << ", " << 0.25 * i << " mm";
            }
            before = along;
        }
        EXPECT_GT(before, 0.9 * mu * drag.normal()) << "mu " << mu;
        EXPECT_LT(drag.across(), 1.02 * before) << "mu " << mu;
    }
}

// A ball on the block that is led from tick to tick, in a few cycles each.
class TickedDrag {
public:
    explicit TickedDrag(double friction)
        : elastic_(block(), {.law = volume::NeoHookean{}}, tests::focusUnder(blockTop)), friction_(friction)
    {
    }

    void go(Vec3 perTick, int ticks)
    {
        for (int left = ticks; left > 0; --left) {
            way_ += perTick;
            std::array tools{tests::ball(blockTop - Vec3(0.0, bigRadius, 0.0) + way_, bigRadius)};
            tools[0].friction = friction_;
            tools[0].pushed = Vec3(0.0, way_.y, 0.0);
            elastic_.relax(tests::loadOf(tools, {}, blockTop));
            const Vec3 before = std::exchange(force_, elastic_.toolForce(0));
            step = std::max(step, glm::distance(force_, before) / glm::length(force_));
            const double share = std::hypot(force_.x, force_.z) / -force_.y;
            most = std::max(most, share);
            least = std::min(least, share);
        }
    }

    Vec3 way() const { return way_; }
    Vec3 force() const { return force_; }

    double step = 0.0;                                  // largest change of the force in a tick, in the force
    double most = 0.0;                                  // largest force along the surface, in that across,
    double least = std::numeric_limits<double>::max();  // and least

private:
    Elastic elastic_;
    double friction_;
    Vec3 way_{0.0}, force_{0.0};
};

// To and fro at 20 mm/s the force never jumps, and where the ball turns back it neither sticks to its limit nor slips at
// once. With friction as stiff as the push it jumped by up to half of the normal force, and was 2.7 times mu N.
TEST(ElasticFriction, BallThatIsDraggedInTicksFeelsItEvenly)
{
    for (const double mu : {0.15, 0.4}) {
        TickedDrag drag(mu);
        drag.go(Vec3(0, 20e-6, 0), 40);
        drag.most = drag.step = 0.0;
        for (const double side : {1.0, -1.0, 1.0}) {
            drag.go(side * 20e-6 * alongTop(20.0), 150);
        }
        EXPECT_LT(drag.step, 0.5 * mu) << mu;
        EXPECT_LT(drag.most, 1.2 * mu) << mu;
        EXPECT_GT(drag.most, 0.9 * mu) << mu;
    }
}

// Points of a patch smaller than the cells are divided. What friction holds each piece by is kept when points are looked
// for again, every quarter of a cell: pieces had all that of the last one, and the force fell by up to a fifth there.
TEST(ElasticFriction, BallThatIsDraggedOverASmallPatchFeelsItEvenlyToo)
{
    for (const int deep : {2, 4, 8, 12, 20}) {  // contact radii of 0.6, 0.9, 1.3, 1.5 and 2 cells
        TickedDrag drag(0.3);
        drag.go(Vec3(0, 20e-6, 0), deep);
        drag.go(4e-6 * alongTop(20.0), 250);
        drag.step = 0.0;
        drag.least = 1.0;
        drag.go(4e-6 * alongTop(20.0), 250);
        EXPECT_LT(drag.step, 0.01) << deep;
        EXPECT_GT(drag.least, 0.95 * 0.3) << deep;
    }
}

// A ball that goes back by more per tick than the surface is sunk into it, as one held by a device with coarse encoders
// does: friction holds until the tissue has followed, and does not let go in each tick. It did, with steps of a quarter to
// a half.
TEST(ElasticFriction, BallThatIsDrawnBackInTicksKeepsItsGrip)
{
    for (const double mu : {0.3, 0.6}) {
        TickedDrag drag(mu);
        drag.go(Vec3(0, 20e-6, 0), 200);
        drag.go(20e-6 * alongTop(20.0), 100);
        drag.step = 0.0;
        for (int i = 0; i < 15; ++i) {
            drag.go(Vec3(0, -90e-6, 0), 1);
            drag.go(Vec3(0, -60e-6, 0) - 30e-6 * alongTop(20.0), 1);
        }
        EXPECT_LT(drag.step, 0.11) << mu;
    }
}

// What a ball dragged before it jumped off the block is forgotten: it touches as if for the first time.
TEST(ElasticFriction, BallThatComesBackHasNoGripOfBefore)
{
    TickedDrag first(0.6), again(0.6);
    again.go(Vec3(0, 20e-6, 0), 100);
    again.go(20e-6 * alongTop(20.0), 60);
    again.go(-again.way() - Vec3(0.0, 10e-3, 0.0), 1);
    again.go(Vec3(0.0, 10e-3, 0.0), 1);
    for (int i = 1; i <= 20; ++i) {
        first.go(Vec3(0, 20e-6, 0), 1);
        again.go(Vec3(0, 20e-6, 0), 1);
        EXPECT_LT(glm::distance(again.force(), first.force()), 0.02 * glm::length(first.force())) << i;
    }
}

// Pressed straight down in the middle of a block that is the same on both sides, the ball goes on feeling straight forces,
// however much the tissue slips under it.
TEST(ElasticFriction, StraightPressHasAStraightForce)
{
    for (const double mu : {0.15, 0.4, 3.0}) {
        Drag drag(mu);
        for (int i = 1; i <= 12; ++i) {
            drag.go(0.2e-3 * i, Vec3(0.0));
            ASSERT_LT(drag.across(), 0.01 * drag.normal()) << "mu " << mu << ", " << 0.2 * i << " mm";
        }
    }
}

// Under Coulomb's limit the ball sticks: the force along is a stiffness times the way, a spring's energy
// E(s) = E(0) + k s^2 / 2 comes with it, and it turns with the way. With mu = 3 all of the contact but its rim holds.
TEST(ElasticFriction, BallThatSticksIsASpring)
{
    const Vec3 way = alongTop(35.0);
    Drag drag(3.0);
    drag.go(depth, Vec3(0.0));
    const double atRest = drag.energy();
    drag.go(depth, 0.1e-3 * way);
    const double stiffness = drag.along(way) / 0.1e-3;
    // A flat punch of the contact's radius that sticks is about as stiff along the surface as 8 G a / (2 - nu); in series
    // with it is the contact's own spring, 2 E / h per area.
    const double contact = std::sqrt(bigRadius * depth);
    const double punch = 8.0 * 1e4 / 2.9 * contact / 1.55, own = 2e4 / blockSpacing * std::acos(-1.0) * contact * contact;
    EXPECT_NEAR(stiffness, 1.0 / (1.0 / punch + 1.0 / own), 0.25 * stiffness);
    for (const double s : {0.2e-3, 0.3e-3, 0.4e-3}) {
        drag.go(depth, s * way);
        EXPECT_NEAR(drag.along(way), stiffness * s, 0.05 * stiffness * s) << s;
        EXPECT_NEAR(drag.energy() - atRest, 0.5 * stiffness * s * s, 0.06 * 0.5 * stiffness * s * s) << s;
        EXPECT_LT(drag.across(), 1.02 * drag.along(way)) << s;
    }
    drag.go(depth, -0.3e-3 * way);
    EXPECT_NEAR(drag.along(way), -stiffness * 0.3e-3, 0.1 * stiffness * 0.3e-3);
}

// A rod that lies on the block, sticks to it and turns about its middle: by symmetry its force is straight, and both ends
// drag tissue along. Turned about its end it has the force along the surface of its middle's way.
TEST(ElasticFriction, RodThatTurnsDragsTissueAlongAtBothEnds)
{
    const double radius = 4e-3, half = 4e-3;
    const auto place = [&](Elastic& elastic, double angle, Vec3 aside) {
        const Vec3 along(std::cos(angle), 0.0, std::sin(angle)), middle = blockTop + Vec3(0.0, depth - radius, 0.0) + aside;
        std::array tools{tests::ball(middle, radius)};
        tools[0].shape.a = middle - half * along;
        tools[0].shape.b = middle + half * along;
        tools[0].friction = 3.0;
        return tests::settle(elastic, tests::loadOf(tools, {}, blockTop), 3e-6).energy;
    };
    const Focus focus = tests::focusUnder(blockTop);
    Elastic aboutMiddle(block(), {}, focus), aboutEnd(block(), {}, focus), straight(block(), {}, focus);
    double before = place(aboutMiddle, 0.0, Vec3(0.0));
    place(aboutEnd, 0.0, Vec3(0.0));
    place(straight, 0.0, Vec3(0.0));
    for (int i = 1; i <= 4; ++i) {
        const double angle = 0.02 * i;
        const double energy = place(aboutMiddle, angle, Vec3(0.0));
        EXPECT_GT(energy, before) << i;
        before = energy;
        const Vec3 force = aboutMiddle.toolForce(0);
        EXPECT_LT(std::hypot(force.x, force.z), 0.002 * -force.y) << i;
        const Vec3 way = half * Vec3(1.0 - std::cos(angle), 0.0, -std::sin(angle));
        place(aboutEnd, angle, way);
        place(straight, 0.0, way);
        EXPECT_GT(straight.toolForce(0).z, 0.0) << i;
        EXPECT_NEAR(aboutEnd.toolForce(0).z, straight.toolForce(0).z, 0.05 * straight.toolForce(0).z) << i;
    }
}

// Press, drag, back, off: the hand never gets work out of friction. A drag that slips costs mu N times its way there and
// back; one without friction gives everything back.
TEST(ElasticFriction, ClosedPathsTakeEnergyOut)
{
    const auto loop = [](double mu, double way) {
        Drag drag(mu);
        drag.go(depth, Vec3(0.0));
        const double stored = drag.energy();
        drag.go(depth, way * alongTop(0.0));
        const double normal = drag.normal();
        drag.go(depth, Vec3(0.0));
        drag.go(0.0, Vec3(0.0));
        return std::array{drag.work() / stored, 2.0 * mu * normal * way / stored};
    };
    // What the contacts' stiffness takes that goes with the area under the tool: never a gain.
    const double without = loop(0.0, 2e-3)[0];
    EXPECT_GT(without, -0.005);
    EXPECT_LT(without, 0.05);
    double before = 0.0;
    for (const double way : {0.2e-3, 1e-3, 3e-3}) {
        const auto [work, most] = loop(0.3, way);
        EXPECT_GT(work, before) << way;
        EXPECT_LT(work, most) << way;
        before = work;
    }
    EXPECT_GT(before, 0.5);
}

}  // namespace
}  // namespace palpate::chainmail
