#pragma once

#include <volume/relaxation.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace palpate::haptics {

/// A force law's part of tissue that relaxes: what each term of the Prony series has taken of a held force [N]. The force
/// is what the law says, less lost().
class RelaxingForce {
public:
    double lost() const noexcept { return std::accumulate(lost_.begin(), lost_.end(), 0.0); }
    /// What the law's force is after `seconds` at `force`, exactly while that does not change.
    void hold(double force, const volume::Relaxation& relaxation, double seconds) noexcept
    {
        for (std::size_t i = 0; i < lost_.size(); ++i) {
            const double fraction = -std::expm1(-seconds / volume::relaxationTimes[i]);
            lost_[i] += fraction * (relaxation.weights[i] * force - lost_[i]);
        }
    }
    /// Tissue that gave way took its part along: at most `most` is left of it [N].
    void renew(double most) noexcept
    {
        const double now = lost();
        if (now > 0.0 && now > most) {
            scale(std::max(most, 0.0) / now);
        }
    }
    void scale(double fraction) noexcept
    {
        for (double& lost : lost_) {
            lost *= fraction;
        }
    }

private:
    std::array<double, volume::relaxationTerms> lost_{};
};

}  // namespace palpate::haptics
