#pragma once

#include <volume/geometry.h>
#include <volume/law.h>

#include <span>

namespace palpate::studies {

/// Closed forms for rigid tools on linear elastic bodies, without friction. E: Young's modulus [Pa], nu: Poisson's ratio.
/// Lengths [m], forces [N].

/// Sphere on a half-space: F = 4/3 E / (1 - nu^2) sqrt(R) d^1.5.
/// Source: H. Hertz, "Ueber die Beruehrung fester elastischer Koerper", 1882.
double hertzForce(double youngsModulus, double poisson, double radius, double depth) noexcept;

/// Sphere on a layer of thickness h that is bonded to a rigid base, as a multiple of Hertz's force. chi = sqrt(R d) / h; it
/// holds up to about 0.25 of it and for nu of 0.3 and more; its term of first order alone is that of a deep body.
/// Source: E. K. Dimitriadis et al., "Determination of elastic moduli of thin layers of soft material using the atomic
/// force microscope", Biophysical Journal 82, 2002.
double bondedLayerFactor(double poisson, double chi) noexcept;

/// The same for nu of 0.5 alone, to chi of about 0.3; at 0.25 it is 2 % above the factor before, which leaves terms out.
/// Source: P. D. Garcia, R. Garcia, "Determination of the elastic moduli of a single cell cultured on a rigid support by
/// force microscopy", Biophysical Journal 114, 2018.
double incompressibleLayerFactor(double chi) noexcept;

/// Flat punch of radius a on a half-space: F = 2 E a d / (1 - nu^2).
/// Source: J. Boussinesq, 1885; I. N. Sneddon, Int. J. Engng Sci. 3, 1965.
double flatPunchForce(double youngsModulus, double poisson, double radius, double depth) noexcept;

/// Flat punch on a layer that is bonded to a rigid base, as a multiple of that force: 1 - 2 a0 / pi (a / h), its error of
/// the order of (a / h)^2.
double deepPunchFactor(double poisson, double fraction) noexcept;

/// The same from the table of the exact solution, for a / h of 0.2, 0.4, .. 1 and nu of 0.3 or 0.45; 0 for others.
/// Source: W. C. Hayes, L. M. Keer, G. Herrmann, L. F. Mockros, "A mathematical analysis for indentation tests of articular
/// cartilage", J. Biomechanics 5, 1972.
double thinLayerPunchFactor(double poisson, double fraction) noexcept;

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
