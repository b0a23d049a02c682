#pragma once

// A ball or a rod that is led into a block of fat, for the tests of deep contact.
#include "elastic_bodies.h"

#include <algorithm>
#include <cmath>

namespace palpate::chainmail {

// Leads a ball or a rod in, and remembers its force.
class Way {
public:
    Way(const ElasticBody& body, Vec3 entry, double radius, double length, const ElasticOptions& options)
        : entry_(entry), radius_(radius), length_(length), elastic_(body, options, tests::focusUnder(entry))
    {
    }

    // To a depth, straight.
    void to(double depth)
    {
        const double way = depth > depth_ ? speed : -speed;
        for (int left = static_cast<int>(std::lround((depth - depth_) / way)); left > 0; --left) {
            tick(depth_ + way, along_);
        }
    }
    void dragTo(double along)
    {
        while (along_ < along) {
            tick(depth_, along_ + speed);
        }
    }
    void tick(double depth, double along)
    {
        const Vec3 at = entry_ + Vec3(along, depth - radius_, 0.0);
        ElasticTool tool = tests::ball(at, radius_, stiffest);
        tool.shape.b -= Vec3(0.0, length_, 0.0);
        tool.pushed = Vec3(0.0, std::max(depth, 0.0), 0.0);
        tool.friction = friction;
        const Vec3 before = elastic_.toolForce(0);
        ElasticLoad load = tests::loadOf({&tool, 1}, {}, entry_ + Vec3(along, 0.0, 0.0));
        load.led = 0;
        last = elastic_.relax(load);
        const Vec3 force = elastic_.toolForce(0);
        pull = std::max(pull, force.y);
        sideways = std::max(sideways, std::hypot(force.x, force.z));
        step = std::max(step, glm::length(before) > 0.0 ? glm::distance(force, before) : 0.0);
        const double work = 0.5 * ((before.y + force.y) * (depth - depth_) + (before.x + force.x) * (along - along_));
        made += work;
        moved += std::abs(work);
        depth_ = depth;
        along_ = along;
    }
    double force() const { return -elastic_.toolForce(0).y; }
    // Solved to convergence where the tool is: the force, less that of the contacts.
    Vec3 offConverged()
    {
        ElasticTool tool = tests::ball(entry_ + Vec3(along_, depth_ - radius_, 0.0), radius_, stiffest);
        tool.pushed = Vec3(0.0, depth_, 0.0);
        elastic_.relax(tests::loadOf({&tool, 1}, {}, entry_ + Vec3(along_, 0.0, 0.0)), 300, 1e-4);
        Vec3 off = elastic_.toolForce(0);
        for (const ContactSite& s : elastic_.sites()) {
            off += s.force;
        }
        return off;
    }

    ElasticResult last;
    double speed = 20e-6;   // way per call [m]
    double stiffest = 1e6;  // of the contact [N/m]
    double friction = 0;    // Coulomb [-]
    double pull = 0;        // largest force into the body [N]
    double sideways = 0;    // largest force across the way in [N]
    double step = 0;        // largest change of the force in a tick [N]
    double made = 0;        // work that the tissue did on the tool [J]
    double moved = 0;       // and its size along the way [J]

private:
    Vec3 entry_;
    double radius_, length_;
    Elastic elastic_;
    double depth_ = -0.5e-3;
    double along_ = 0;
};

inline const Vec3 middle(40e-3, 0.0, 40e-3);

inline ElasticBody softBlock(double poissonRatio = 0.47)
{
    auto block = tests::heldBlock({40, 21, 40}, 2e-3, 3250.0, poissonRatio);
    block.air = 2;
    return tests::bodyOf(block);
}

inline constexpr ElasticOptions asInASession{.window = 13, .law = volume::NeoHookean{}};

}  // namespace palpate::chainmail
