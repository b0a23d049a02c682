#include <chainmail/move_blend.h>

#include <glm/geometric.hpp>

#include <algorithm>

namespace palpate::chainmail {

constexpr double wayOfTick = 20e-6;  // of a tool at 20 mm/s: a faster one passes in a tick what this does in several [m]
// In such ticks:
constexpr double follows = 8.0;     // from a move on, in which the solution follows it,
constexpr double settles = 200.0;   // and in which it settles
constexpr double felt = 0.002;      // of the force: while it settles, smaller changes are taken as they are
constexpr double fades = 32.0;      // until e^-1 of the offset is left
constexpr double learns = 0.25;     // of the mean way and change, in a tick
constexpr double mostOffset = 0.1;  // in the force
constexpr double mostWays = 2.0;    // way of a tick, in the mean one, up to which the force is foretold

void MoveBlend::count(Vec3 force, Vec3 at, bool moved) noexcept
{
    if (force == Vec3(0.0) || !isKnown_) {
        forget();
        force_ = force;
        at_ = at;
        isKnown_ = force != Vec3(0.0);
        return;
    }
    const Vec3 way = at - at_, change = force - force_;
    const double ticks = std::max(glm::length(way) / wayOfTick, 1.0), size = glm::length(force);
    force_ = force;
    at_ = at;
    sinceMove_ = moved ? 0.0 : std::min(sinceMove_ + ticks, settles);
    offset_ *= std::max(1.0 - ticks / fades, 0.0);
    if (sinceMove_ < settles) {
        const double mean = glm::dot(meanWay_, meanWay_);
        const double ways = mean > 0.0 ? std::clamp(glm::dot(way, meanWay_) / mean, -mostWays, mostWays) : 0.0;
        const Vec3 off = ways * meanChange_ - change;
        const double borne = sinceMove_ < follows ? 0.0 : ticks * felt * size;
        const double length = glm::length(off);
        offset_ += length > borne ? (length - borne) / length * off : Vec3(0.0);
    }
    if (sinceMove_ >= follows) {
        meanWay_ += learns * (way - meanWay_);
        meanChange_ += learns * (change - meanChange_);
    }
    const double length = glm::length(offset_);
    offset_ *= length > mostOffset * size ? mostOffset * size / length : 1.0;
}

}  // namespace palpate::chainmail
