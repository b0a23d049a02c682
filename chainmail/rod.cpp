#include <chainmail/rod.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::chainmail {

constexpr double pieceLength = 4e-3;  // [m]
constexpr double narrowest = 0.75;    // radius of a ring, in cells: closer to the axis its place between nodes would count
constexpr double gives = 1.25;        // the ring's rod over that asked for: so the springs are about as stiff as the cells
constexpr double shortest = 1.0;      // length over diameter that G is taken for
constexpr double leastLack = 0.1;     // of differences of G
constexpr double acrossToAlong = 4.0 * (1.0 - 0.45) / (3.0 - 4.0 * 0.45);  // of the factors before ln(R / r), at nu = 0.45
constexpr double fewest = 4.0, standard = 8.0;                             // points

double piecesOfRod(double length) noexcept
{
    return std::max(1.0, std::round(length / pieceLength));
}

RodRing ringOf(const RodPiece& piece, double mu, double spacing) noexcept
{
    const double half = 0.5 * spacing, wanted = gives * piece.radius;
    const double circle = std::max(narrowest * spacing, std::sqrt(std::max(wanted * wanted - half * half, 0.0)));
    const auto lacks = [&](double once, double twice) {
        const auto g = [&](double radius) {
            const double p = std::max(0.5 * piece.rod / radius, shortest);
            return std::log(p) + once / p + twice / (p * p);
        };
        return std::max(g(piece.radius) - g(std::hypot(circle, half)), leastLack);
    };
    const double line = 2.0 * std::numbers::pi * mu * piece.length;
    // No more than a cell apart; fewer where there are several rings to a cell.
    const double whole = std::max(standard, std::ceil(2.0 * std::numbers::pi * circle / spacing));
    const double points = piece.length < narrowest * spacing ? 0.5 * whole : whole;
    return {circle, line / lacks(0.980, -0.133), acrossToAlong * line / lacks(0.185, 0.233),
            std::clamp(std::ceil(points), fewest, maxRingPoints)};
}

}  // namespace palpate::chainmail
