#pragma once

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

}  // namespace palpate::studies
