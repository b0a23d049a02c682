#pragma once

#include <volume/geometry.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::occupancy {

/// A tool: all points within `radius` of the segment from `a` to `b` [m]. A sphere has a == b.
struct Capsule {
    Vec3 a{0.0};
    Vec3 b{0.0};
    double radius = 0;
};

/// A tapered tool: the spheres about all points of the segment from `a` to `b` [m], whose radius goes linearly from
/// `radiusA` to `radiusB` [m]. Where one end's sphere holds the other's, that sphere is the tool.
struct RoundCone {
    Vec3 a{0.0};
    Vec3 b{0.0};
    double radiusA = 0;
    double radiusB = 0;

    double widest() const noexcept { return std::max(radiusA, radiusB); }
};

/// A round cone made ready to be asked for many points. With the point s along the axis and q away from it, the sphere that
/// comes nearest is at
///
///     clamp(s + q k / sqrt(1 - k^2), 0, length)   along the axis,   k = (radiusB - radiusA) / length,
///
/// since |p - c(x)| - r(x) is convex in x. The formula has no case for the ends, the cone and the sphere.
/// Source: I. Quilez, "Distance functions", round cone, https://iquilezles.org/articles/distfunctions/ (the same distance,
/// by regions).
class ShapeDistance {
public:
    explicit ShapeDistance(const RoundCone& tool) noexcept : start_(tool.a), radius_(tool.radiusA)
    {
        const Vec3 way = tool.b - tool.a;
        const double length = glm::length(way);
        const double taper = tool.radiusB - tool.radiusA;
        if (std::abs(taper) < length) {
            ahead_ = way / length;
            length_ = length;
            sine_ = taper / length;
            cosine_ = std::sqrt(1.0 - sine_ * sine_);
        } else if (taper > 0.0) {
            start_ = tool.b;
            radius_ = tool.radiusB;
        }
    }

    /// Signed distance from `p` to the tool's surface, negative inside [m].
    double distance(Vec3 p) const noexcept
    {
        const Nearest n = nearest(p);
        return glm::length(n.away) - n.radius;
    }

    /// Unit vector along which distance() grows by 1 per metre. Where many do, on the axis, it is one of them.
    Vec3 gradient(Vec3 p) const noexcept { return sample(p).gradient; }

    /// Both at once.
    struct Sample {
        double distance = 0;  // [m]
        Vec3 gradient{0.0};
    };
    Sample sample(Vec3 p) const noexcept
    {
        const Nearest n = nearest(p);
        const double length = glm::length(n.away);
        return {length - n.radius, length > onAxis ? n.away / length : fromAxis()};
    }

private:
    static constexpr double onAxis = 1e-12;  // nearer, rounding gives the direction [m]

    // The sphere that comes nearest, and the way from its middle to the point.
    struct Nearest {
        Vec3 away;
        double radius;
    };

    Nearest nearest(Vec3 p) const noexcept
    {
        const Vec3 r = p - start_;
        if (length_ <= 0.0) {
            return {r, radius_};
        }
        const double s = glm::dot(r, ahead_);
        const double q = glm::length(r - s * ahead_);
        const double x = std::clamp(s + q * sine_ / cosine_, 0.0, length_);
        return {r - x * ahead_, radius_ + sine_ * x};
    }

    Vec3 fromAxis() const noexcept
    {
        if (length_ <= 0.0) {
            return {0, 0, 1};
        }
        const Vec3 other = std::abs(ahead_.x) < 0.5 ? Vec3(1, 0, 0) : Vec3(0, 1, 0);
        return cosine_ * glm::normalize(glm::cross(ahead_, other)) - sine_ * ahead_;
    }

    Vec3 start_;
    Vec3 ahead_{0.0};  // unit vector; zero for a sphere
    double length_ = 0;
    double radius_;
    double sine_ = 0;  // of half the opening angle: radius gained per metre
    double cosine_ = 1;
};

}  // namespace palpate::occupancy
