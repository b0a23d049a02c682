#include <datasets/phantom_random.h>
#include <haptics/inner_walls.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::haptics {

namespace {

constexpr double meanChord = 0.690;  // of a Voronoi cell, sides of a cube; by counting (InnerWalls.StandAsFarApartAsAsked)
constexpr std::uint64_t places = 0x1A7E5, strengths = 0x5EB7A;  // seeds
constexpr int reach = 2;  // cubes: the nearest point is never further away than a cube's diagonal

// The point of a cube, in sides of a cube from the cube's corner.
Vec3 pointIn(std::uint64_t bits) noexcept
{
    constexpr std::uint64_t mask = (1U << 21U) - 1U;
    const Vec3 whole(static_cast<double>(bits & mask), static_cast<double>((bits >> 21U) & mask),
                     static_cast<double>((bits >> 42U) & mask));
    return 0x1p-21 * whole;
}

}  // namespace

std::uint64_t lobeAt(Vec3 rest, double spacing) noexcept
{
    const Vec3 p = meanChord / spacing * rest, base = glm::floor(p);
    double nearest2 = std::numeric_limits<double>::max();
    std::uint64_t lobe = 0;
    volume::forEachIndex(Index3(-reach), Index3(reach), [&](Index3 cube) {
        const Vec3 corner = base + Vec3(cube);
        const Vec3 away = glm::max(glm::max(corner - p, p - corner - 1.0), 0.0);
        if (glm::dot(away, away) >= nearest2) {
            return;
        }
        const std::uint64_t bits =
            datasets::cellBits(places, static_cast<std::int64_t>(corner.x), static_cast<std::int64_t>(corner.y),
                               static_cast<std::int64_t>(corner.z));
        const Vec3 d = corner + pointIn(bits) - p;
        if (glm::dot(d, d) < nearest2) {
            nearest2 = glm::dot(d, d);
            lobe = bits;
        }
    });
    return lobe;
}

double wallForce(std::uint64_t one, std::uint64_t other, double mean) noexcept
{
    const auto [low, high] = std::minmax(one, other);
    const double u = datasets::unitOf(datasets::mixBits(datasets::mixBits(low ^ strengths) + high));
    return -mean * std::log1p(-u);
}

bool hasWalls(const SessionModel& model, const volume::TissueRow& row) noexcept
{
    return model.scene.model.walls && row.wallSpacing > 0.0;
}

}  // namespace palpate::haptics
