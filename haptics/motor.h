#pragma once

#include <datasets/phantom_random.h>
#include <volume/geometry.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace palpate::haptics {

inline constexpr double furthestLead = 40e-3;  // how far a hand's goal runs ahead when tissue resists [m]
inline constexpr double braking = 30e-3;  // inside the body a hand stops so long before the mark at its speed; assumed [s]

/// A normally distributed number, by the sum of twelve uniform ones: mean 0, standard deviation 1, never beyond 6.
inline double normalOf(datasets::Random& random) noexcept
{
    double sum = -6.0;
    for (int i = 0; i < 12; ++i) {
        sum += random.between(0.0, 1.0);
    }
    return sum;
}

/// Minimum jerk: the fraction of the way at a fraction of the time, with speed and acceleration 0 at both ends. Source:
/// Flash and Hogan, "The coordination of arm movements", J. Neuroscience 5, 1985.
inline double minimumJerk(double t) noexcept
{
    const double s = std::clamp(t, 0.0, 1.0);
    return s * s * s * (10.0 + s * (6.0 * s - 15.0));
}

/// Physiological tremor of a hand: a sum of sines of random phase at random frequencies from 8 to 12 Hz, so that amplitude
/// swells and fades. 50 to 200 um root mean square at 8-12 Hz is what instruments measured in surgeons' hands (see
/// docs/score.md).
class Tremor {
public:
    static constexpr double lowest = 8.0, highest = 12.0;  // [Hz]

    /// @param rms  of the vector [m]    @param random  phases and frequencies are drawn from it
    Tremor(double rms, datasets::Random& random) noexcept : amplitude_(rms * std::sqrt(2.0 / (3.0 * waves)))
    {
        for (Wave& w : waves_) {
            w.frequency = random.between(lowest, highest);
            w.phase = random.between(0.0, 2.0 * std::numbers::pi);
        }
    }

    /// Where it has taken the hand at a time [s].
    Vec3 at(double seconds) const noexcept
    {
        Vec3 sum(0.0);
        for (int i = 0; i < 3 * waves; ++i) {
            const Wave& w = waves_[static_cast<std::size_t>(i)];
            sum[i % 3] += amplitude_ * std::sin(2.0 * std::numbers::pi * w.frequency * seconds + w.phase);
        }
        return sum;
    }

private:
    struct Wave {
        double frequency = 0;  // [Hz]
        double phase = 0;      // [rad]
    };
    static constexpr int waves = 5;  // per axis
    double amplitude_;               // [m]
    std::array<Wave, 3 * waves> waves_;
};

}  // namespace palpate::haptics
