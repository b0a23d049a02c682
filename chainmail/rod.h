#pragma once

namespace palpate::chainmail {

/// A piece of a rigid rod that tissue sticks to.
struct RodPiece {
    double radius = 0;                                    // [m]
    double length = 0;                                    // of the piece [m]
    double rod = 0;                                       // of the whole rod [m]
    bool isRod() const noexcept { return length > 0.0; }  // 0: it stands for no piece
    bool operator==(const RodPiece&) const = default;
};

/// In how many pieces a rod is held, of some 4 mm each: a whole number, at least 1.
/// @param length  of the rod [m]
double piecesOfRod(double length) noexcept;

/// Points evenly on a circle around a rod's axis, each on its spring, which stand for a piece of the rod.
inline constexpr double maxRingPoints = 32.0;

struct RodRing {
    double radius = 0;  // of the circle [m]
    double along = 0;   // stiffness of all springs together along the axis [N/m]
    double across = 0;  // and across it [N/m]
    double points = 0;  // how many, a whole number
};

/// The ring on cells of side h that acts on the tissue as the rod does.
///
/// A force f per length along a line in an elastic body moves a rod of radius r around it by f ln(R / r) / (2 pi mu), and
/// across it by f ln(R / r) (3 - 4 nu) / (8 pi mu (1 - nu)), R that of the body (Kelvin's solution, integrated along the
/// line). Points on a circle of radius c, a cell apart along the line, give way as a rod of radius r,
///
///     r^2 = c^2 + h^2 / 4
///
/// whichever way it goes through the grid, within 6 % of the radius for c over 0.75 h. The ring is as wide that this is
/// over the rod's radius a, and the springs give the rest: G(L / 2 a) - G(L / 2 r) in place of ln(R / r), with the ends of
/// a rod of length L (Tirado and Garcia de la Torre, J. Chem. Phys. 71, 1979: cylinders in a viscous fluid, which moves as
/// a body does that cannot be compressed),
///
///     G(p) = ln p + 0.980 / p - 0.133 / p^2 along,    ln p + 0.185 / p + 0.233 / p^2 across
///
/// So the force does not depend on the cells, as that of points does, which give way as a ball of 0.2 to 0.3 h.
/// @param piece    all lengths over 0
/// @param mu       shear modulus of the tissue [Pa]
/// @param spacing  h [m]
RodRing ringOf(const RodPiece& piece, double mu, double spacing) noexcept;

}  // namespace palpate::chainmail
