#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace palpate::volume {

/// Terms of a tissue's Prony series.
inline constexpr std::size_t relaxationTerms = 2;
/// Their times, the same for all tissue [s]: what is gone in the first moment of a hold, and in the first minute.
inline constexpr std::array<double, relaxationTerms> relaxationTimes{0.5, 20.0};
/// How long after a step tissue has the Young's modulus of its table [s]: a palpating finger rests about as long, and
/// between this and a tenth of it lie most quasi-static tests.
inline constexpr double modulusTime = 1.0;

/// How the stress of a tissue falls while its strain is held, a Prony series (a generalised Maxwell solid):
///
///     G(t) / G(0) = 1 - sum of w_i (1 - exp(-t / t_i))
///
/// Source: J. D. Ferry, "Viscoelastic Properties of Polymers", 3rd ed., 1980, chapter 3.
struct Relaxation {
    std::array<double, relaxationTerms> weights{};  // w_i: shares of the stress right after a step; under 1 together [-]

    /// Whether the tissue relaxes at all.
    bool any() const noexcept
    {
        return std::ranges::any_of(weights, [](double w) { return w > 0.0; });
    }
    /// G(t) / G(0), at the time `seconds` after a step.
    double remaining(double seconds) const noexcept
    {
        double fraction = 1.0;
        for (std::size_t i = 0; i < weights.size(); ++i) {
            fraction -= weights[i] * (1.0 - std::exp(-seconds / relaxationTimes[i]));
        }
        return fraction;
    }
    /// The modulus right after a step, in that of the table.
    double instantaneous() const noexcept { return any() ? 1.0 / remaining(modulusTime) : 1.0; }
};

}  // namespace palpate::volume
