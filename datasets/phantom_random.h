#pragma once

#include <volume/geometry.h>

#include <cmath>
#include <cstdint>

namespace palpate::datasets {

// Everything here is integer arithmetic, + - * / and square roots, so that a seed gives the same bits on every machine:
// std::uniform_real_distribution and the transcendental functions of libm do not.

/// splitmix64. Source: Steele, Lea, Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014.
constexpr std::uint64_t mixBits(std::uint64_t x) noexcept
{
    x += 0x9E3779B97F4A7C15U;
    x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9U;
    x = (x ^ (x >> 27U)) * 0x94D049BB133111EBU;
    return x ^ (x >> 31U);
}

/// The top 53 bits as a number in [0, 1).
constexpr double unitOf(std::uint64_t bits) noexcept
{
    return static_cast<double>(bits >> 11U) * 0x1p-53;
}

class Random {
public:
    explicit Random(std::uint64_t seed) noexcept : state_(mixBits(seed)) {}

    std::uint64_t bits() noexcept { return mixBits(state_++); }
    double between(double low, double high) noexcept { return low + (high - low) * unitOf(bits()); }
    /// A unit vector, all directions alike.
    Vec3 direction() noexcept
    {
        for (;;) {
            const double x = between(-1, 1), y = between(-1, 1), z = between(-1, 1);
            const double length2 = x * x + y * y + z * z;
            if (length2 > 0.01 && length2 <= 1.0) {
                return Vec3(x, y, z) / std::sqrt(length2);
            }
        }
    }

private:
    std::uint64_t state_;
};

constexpr std::uint64_t cellBits(std::uint64_t seed, std::int64_t x, std::int64_t y, std::int64_t z) noexcept
{
    return mixBits(seed ^ (static_cast<std::uint64_t>(x) * 0x8DA6B343U + static_cast<std::uint64_t>(y) * 0xD8163841U +
                           static_cast<std::uint64_t>(z) * 0xCB1AB31FU));
}

/// Smooth noise in [-1, 1]: a random value at every integer point, blended between them.
inline double smoothNoise(std::uint64_t seed, Vec3 p) noexcept
{
    const Vec3 base(std::floor(p.x), std::floor(p.y), std::floor(p.z));
    const Vec3 f = p - base;
    const Vec3 w = f * f * (Vec3(3.0) - 2.0 * f);
    const auto x = static_cast<std::int64_t>(base.x);
    const auto y = static_cast<std::int64_t>(base.y);
    const auto z = static_cast<std::int64_t>(base.z);
    const auto along = [&](std::int64_t j, std::int64_t k) {
        const double a = unitOf(cellBits(seed, x, j, k)), b = unitOf(cellBits(seed, x + 1, j, k));
        return a + w.x * (b - a);
    };
    const double near = along(y, z) + w.y * (along(y + 1, z) - along(y, z));
    const double far = along(y, z + 1) + w.y * (along(y + 1, z + 1) - along(y, z + 1));
    return 2.0 * (near + w.z * (far - near)) - 1.0;
}

/// Distance from `p` to the nearest wall between the Voronoi cells of random points, one in each unit cube.
/// Pattern: Worley, "A cellular texture basis function", SIGGRAPH 1996.
double cellWallDistance(std::uint64_t seed, Vec3 p) noexcept;

}  // namespace palpate::datasets
