#include <base/folds.h>
#include <studies/stability/matrix.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <span>

namespace palpate::studies {

namespace {

constexpr double minPush = 0.005;  // force below this fraction of the cap pushes nothing back

struct Window {
    std::size_t first, last;  // ticks, `last` not in it
};

Window windowOf(const Trace& t, const StabilityScene& scene)
{
    const auto tick = [&](double time) { return static_cast<std::size_t>(std::lround(std::max(time, 0.0) / t.period)); };
    const std::size_t last = std::min(tick(scene.to), t.force.size());
    return {std::min(tick(scene.from), last), last};
}

// Plates lie across y, with their near face towards -y. A tool on its way out may go unheld.
double popThrough(const Trace& t, const StabilityScene& scene, Window w)
{
    double most = 0.0;
    for (std::size_t i = std::max<std::size_t>(w.first, 1); i < w.last; ++i) {
        const bool leaves = t.position[i].y < t.position[i - 1].y;
        if (!leaves && -t.force[i].y <= minPush * t.cap) {
            most = std::max(most, t.position[i].y - scene.farFace);
        }
    }
    return 1e3 * most;
}

double ripple(const Trace& t, Window w)
{
    const auto n = static_cast<double>(w.last - w.first);
    double sum = 0.0, squares = 0.0;
    for (std::size_t i = w.first; i < w.last; ++i) {
        const double f = glm::length(t.force[i]);
        sum += f;
        squares += f * f;
    }
    // A wave of amplitude A has the mean square A^2 / 2.
    const double mean = sum / n;
    const double amplitude = std::sqrt(2.0 * std::max(squares / n - mean * mean, 0.0));
    return mean > 0.0 ? 100.0 * amplitude / mean : std::numeric_limits<double>::infinity();
}

// What the stiffest wall that the device holds would answer the motion with is no step.
double forceStep(const Trace& t, Window w)
{
    double most = 0.0;
    for (std::size_t i = std::max<std::size_t>(w.first, 1); i < w.last; ++i) {
        const double moved = glm::distance(t.position[i], t.position[i - 1]);
        most = std::max(most, glm::distance(t.force[i], t.force[i - 1]) - t.stiffest * moved);
    }
    return 100.0 * most / t.cap * (1e-3 / t.period);
}

double restCycle(const Trace& t, Window w)
{
    Vec3 low(std::numeric_limits<double>::infinity()), high(-low);
    for (std::size_t i = w.first; i < w.last; ++i) {
        low = glm::min(low, t.position[i]);
        high = glm::max(high, t.position[i]);
    }
    const Vec3 way = high - low;
    return std::max({way.x, way.y, way.z}) / t.encoder;
}

// The part of a list by ticks that lies in the window.
template <typename Value>
std::span<const Value> in(Window w, const std::vector<Value>& ticks)
{
    return std::span(ticks).subspan(w.first, w.last - w.first);
}

double peakForce(const Trace& t, Window w)
{
    return base::largestOf(in(w, t.force), [](Vec3 f) { return glm::length(f); });
}

// Bodies lie behind their face across y. What a controller adds against the motion on the way out is no pull.
double pull(const Trace& t, Window w)
{
    return 100.0 * base::largestOf(in(w, t.tissue), &Vec3::y) / t.cap;
}

// A force F that gives way sets a mass on a spring going at F / sqrt(K m), beside the speed of the hand.
double kick(const Trace& t, const StabilityScene& scene, Window w)
{
    const double hand = base::largestOf(scene.hand.legs, &HandLeg::speed);
    return 100.0 * base::largestOf(in(w, t.speed), std::identity()) / (hand + peakForce(t, w) / t.handSpring);
}

// Over the whole session: what was put in before the window counts.
double energyMade(const Trace& t)
{
    return std::max(0.0, *std::max_element(t.work.begin(), t.work.end()));
}

}  // namespace

double figureOf(Figure figure, const Trace& t, const StabilityScene& scene)
{
    for (const Vec3& f : t.force) {
        if (!std::isfinite(f.x + f.y + f.z)) {
            return std::numeric_limits<double>::quiet_NaN();
        }
    }
    const Window w = windowOf(t, scene);
    switch (figure) {
        case Figure::popThrough:
            return popThrough(t, scene, w);
        case Figure::ripple:
            return ripple(t, w);
        case Figure::forceStep:
            return forceStep(t, w);
        case Figure::restCycle:
            return restCycle(t, w);
        case Figure::kick:
            return kick(t, scene, w);
        case Figure::energyMade:
            return energyMade(t);
        case Figure::residue:
            return t.residue / sceneVoxel;
        case Figure::peakForce:
            return 100.0 * peakForce(t, w) / t.cap;
        case Figure::pull:
            return pull(t, w);
    }
    return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace palpate::studies
