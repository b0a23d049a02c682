#include <datasets/phantom_random.h>

#include <limits>

namespace palpate::datasets {

double cellWallDistance(std::uint64_t seed, Vec3 p) noexcept
{
    double nearest2 = std::numeric_limits<double>::max(), second2 = nearest2;
    Vec3 nearest(0.0), second(0.0);  // from p
    const Vec3 base(std::floor(p.x), std::floor(p.y), std::floor(p.z));
    for (int cell = 0; cell < 27; ++cell) {
        const Vec3 corner = base + Vec3(cell % 3 - 1, cell / 3 % 3 - 1, cell / 9 - 1);
        const std::uint64_t bits = cellBits(seed, static_cast<std::int64_t>(corner.x), static_cast<std::int64_t>(corner.y),
                                            static_cast<std::int64_t>(corner.z));
        constexpr std::uint64_t mask = (1U << 21U) - 1U;
        constexpr double scale = 1.0 / (1U << 21U);
        const Vec3 inCell(static_cast<double>(bits & mask), static_cast<double>((bits >> 21U) & mask),
                          static_cast<double>((bits >> 42U) & mask));
        const Vec3 d = corner + scale * inCell - p;
        const double distance2 = d.x * d.x + d.y * d.y + d.z * d.z;
        if (distance2 < nearest2) {
            second2 = nearest2;
            second = nearest;
            nearest2 = distance2;
            nearest = d;
        } else if (distance2 < second2) {
            second2 = distance2;
            second = d;
        }
    }
    // The wall is the plane half-way between the two.
    const Vec3 apart = second - nearest;
    return (second2 - nearest2) / (2.0 * std::sqrt(apart.x * apart.x + apart.y * apart.y + apart.z * apart.z));
}

}  // namespace palpate::datasets
