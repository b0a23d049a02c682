#include <studies/tick/bench_tick.h>

#include <haptics/hand.h>
#include <occupancy/query.h>
#include <session/session.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <iterator>
#include <memory>
#include <random>

namespace palpate::studies {

using namespace occupancy;

namespace {

constexpr double cubeSpacing = 2e-3;  // the default of a scene's lattice [m]
constexpr double dent = 4e-3;         // how deep [m]
constexpr double dentRadius = 6e-3;   // standard deviation of the bell [m]
constexpr double jitter = 1e-3;       // of the poses [m]
constexpr int poses = 2000;
constexpr int warmUp = 50;

// A cube with its surface at z = 0, tissue below. The surface lies half a spacing above the topmost elements.
class QueryCube {
public:
    explicit QueryCube(int side)
        : grid_{Index3(side), -cubeSpacing * Vec3(0.5 * (side - 1), 0.5 * (side - 1), side - 0.5), cubeSpacing},
          solid_(grid_.count(), 1),
          u_(grid_.count(), Vec3f(0.0F)),
          map_(grid_, solid_)
    {
        constexpr int margin = 4;
        surface_.grid = {grid_.size + Index3(2 * margin), grid_.origin - margin * cubeSpacing, cubeSpacing};
        surface_.values.reserve(surface_.grid.count());
        const Box whole{grid_.origin - 0.5 * cubeSpacing, grid_.position(grid_.size - 1) + 0.5 * cubeSpacing};
        volume::forEachIndex(Index3(0), surface_.grid.size - 1, [&](Index3 n) {
            surface_.values.push_back(static_cast<float>(distanceTo(whole, surface_.grid.position(n))));
        });
    }

    // Elements further than five standard deviations from the dent stay at rest.
    void press() noexcept
    {
        const auto reach = static_cast<int>(5.0 * dentRadius / cubeSpacing);
        const Index3 middle(grid_.size.x / 2, grid_.size.y / 2, grid_.size.z - 1);
        const Index3 low = glm::max(middle - reach, Index3(0));
        volume::forEachIndex(low, glm::min(middle + reach, grid_.size - 1), [&](Index3 n) {
            const Vec3 rest = grid_.position(n);
            const auto e = static_cast<Element>(grid_.offset(n));
            const double bell = std::exp(-0.5 * glm::dot(rest, rest) / (dentRadius * dentRadius));
            u_[e] = Vec3f(Vec3(0, 0, -dent * bell));
            map_.displace(e, u_[e]);
        });
    }

    Body body() const noexcept { return {grid_, solid_, u_, map_, surface_}; }

private:
    using Box = volume::Box;

    static double distanceTo(const Box& box, Vec3 p) noexcept
    {
        const Vec3 out = glm::max(box.low - p, p - box.high);
        return glm::length(glm::max(out, Vec3(0.0))) + std::min(std::max({out.x, out.y, out.z}), 0.0);
    }

    volume::NodeGrid grid_;
    std::vector<std::uint8_t> solid_;
    std::vector<Vec3f> u_;
    OccupancyMap map_;
    volume::DistanceField surface_;
};

struct Tool {
    const char* name;
    double length;
    double radius;
};
constexpr std::array<Tool, 3> tools{{{"sphere_3_elements", 0.0, 1.5 * cubeSpacing},
                                     {"needle", 6e-3, 1.05e-3},  // the shaft that a tick looks at, 14 G
                                     {"sphere_10mm", 0.0, 10e-3}}};

// The tool with its lowest point `height` above the surface at rest, its axis at 30 degrees.
Capsule standing(const Tool& tool, Vec3 shift, double height) noexcept
{
    const Vec3 tip = shift + Vec3(0, 0, height + tool.radius);
    return {tip + tool.length * Vec3(0.5, 0, 0.5 * std::sqrt(3.0)), tip, tool.radius};
}

template <typename Work>
double secondsOf(Work&& work)
{
    using Clock = std::chrono::steady_clock;
    const auto start = Clock::now();
    work();
    return std::chrono::duration<double>(Clock::now() - start).count();
}

QueryCase timeCase(const Body& body, const Tool& tool, bool deformed)
{
    QueryCase result;
    result.tool = tool.name;
    result.elementsPerSide = body.grid.size.x;
    result.deformed = deformed;
    const double floor = deformed ? -dent : 0.0;
    std::mt19937 random(1);
    std::uniform_real_distribution<double> shift(-jitter, jitter);
    auto contacts = std::make_unique<ContactSet>();
    for (int i = -warmUp; i < poses; ++i) {
        const Vec3 at(shift(random), shift(random), shift(random));
        const Capsule pressed = standing(tool, at, floor - jitter);
        const double touching = secondsOf([&] { touch(body, pressed, *contacts); });
        const Capsule far = standing(tool, at, 4e-3), near = standing(tool, at, 3e-3);
        const double sweeping = secondsOf([&] { sweep(body, far, near); });
        if (i >= 0) {
            result.touch.add(touching);
            result.sweep.add(sweeping);
            result.meanTouched += static_cast<double>(contacts->count) / poses;
        }
    }
    return result;
}

}  // namespace

std::vector<QueryCase> benchQuery(int elementsPerSide)
{
    QueryCube cube(elementsPerSide);
    std::vector<QueryCase> cases;
    for (const bool deformed : {false, true}) {
        if (deformed) {
            cube.press();
        }
        std::ranges::transform(tools, std::back_inserter(cases),
                               [&](auto& tool) { return timeCase(cube.body(), tool, deformed); });
    }
    return cases;
}

using namespace haptics;

TickCase benchTick(const SessionModel& model, const ServoOptions& options)
{
    constexpr double startDistance = 10e-3;
    HandDevice hand = handBefore(model, startDistance);
    session::Session session(model, infoOf(model));

    TickCase result;
    double moved = 0.0;
    const auto sink = [&](const TickRecord& record, const ServoTiming&) {
        if (record.phase == Phase::free) {
            return;
        }
        moved += record.moved;
        double tick = 0.0;
        for (std::size_t i = 0; i < taskCount; ++i) {
            const auto seconds = static_cast<double>(record.seconds[i]);
            result.contactTasks[i].add(seconds);
            tick += seconds;
        }
        result.contact.add(tick);
    };
    result.all = session.run(hand, {.servo = options}, sink);
    result.meanMoved = moved / static_cast<double>(std::max<std::uint64_t>(result.contact.count(), 1));
    return result;
}

}  // namespace palpate::studies
