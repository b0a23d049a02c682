#pragma once

#include <volume/geometry.h>
#include <volume/law.h>

#include <span>

namespace palpate::studies {

/// Closed forms for bodies without contact: isotropic, linear unless said otherwise, SI.

/// A ball in an infinite matrix that is stretched far away.
struct Inclusion {
    double radius = 0;      // [m]
    double poisson = 0;     // of the matrix
    double shearRatio = 1;  // ball / matrix
    double bulkRatio = 1;   // ball / matrix
    double stretch = 0;     // far away along z; across it -poisson times that
};

/// Displacement at `x` from the ball's middle [m].
/// Sources: J. N. Goodier, "Concentration of Stress Around Spherical and Cylindrical Inclusions and Flaws", J. Appl. Mech.
/// 1, 1933; J. D. Eshelby, Proc. R. Soc. A 241, 1957.
Vec3 inclusionDisplacement(const Inclusion& inclusion, Vec3 x);

/// Displacement at `x` from a point force in an infinite body [m]: smooth everywhere else, and in equilibrium without load.
/// Source: Lord Kelvin, 1848; A. E. H. Love, "A Treatise on the Mathematical Theory of Elasticity", art. 130.
Vec3 kelvinDisplacement(double shearModulus, double poisson, Vec3 force, Vec3 x);

/// Nominal stress of a bar stretched to `stretch` times its length, free across, of energy density
/// mu/2 I + what the law has beyond that + K/2 (J - 1)^2 with I = J^(-2/3) |F|^2 - 3 [Pa]. Solved to rounding.
/// @param law  of finite strain
/// Source: R. W. Ogden, "Non-Linear Elastic Deformations", 1984, ch. 4 and 7.
double uniaxialTension(const volume::Law& law, double youngsModulus, double poisson, double stiffening, double stretch);

/// Order of convergence: slope of log(error) over log(size), least squares.
double convergenceOrder(std::span<const double> sizes, std::span<const double> errors);

}  // namespace palpate::studies
