#pragma once

#include <cstddef>
#include <span>

namespace palpate::studies {

/// A straight line y = intercept + slope x by least squares, with standard errors, as Table 4 of the thesis has them.
struct LineFit {
    std::size_t points = 0;
    double slope = 0, slopeError = 0;
    double intercept = 0, interceptError = 0;
    double rSquared = 0;  // fraction of the variance of y that the line explains; 1 where y does not vary
    double residual = 0;  // standard deviation of the points about the line

    double at(double x) const noexcept { return intercept + slope * x; }
    /// Zero lies in the slope's 95 % interval: the points show no dependence on x.
    bool flat() const noexcept;
};

/// Throws std::runtime_error for fewer than three points and where x does not vary.
LineFit fitLine(std::span<const double> x, std::span<const double> y);

/// The 97.5 % quantile of Student's t: so many standard errors to both sides hold 95 %.
/// @param freedom  points less parameters, 1 or more
double studentQuantile(std::size_t freedom) noexcept;

}  // namespace palpate::studies
