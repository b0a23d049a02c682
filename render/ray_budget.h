#pragma once

#include <algorithm>
#include <cmath>

namespace palpate::render {

/// How far apart rays are cast while things move, so that nine of ten pictures are finished in time on a renderer that pays
/// for each ray.
class RayBudget {
public:
    static constexpr double seconds = 0.029;  // of a picture; of the 33 ms there is also the window's turn
    static constexpr double coarsest = 4;     // [pixels]

    /// From ray to ray along each axis [pixels], for a picture of so many. It changes in steps, and not back and forth:
    /// whoever casts the rays has to allocate its buffers anew.
    double apart(double pixels) noexcept
    {
        constexpr double steps = 4, change = 0.2;
        rays_ = std::clamp(rays_, pixels / (coarsest * coarsest), pixels);
        const double wanted = std::sqrt(pixels / rays_);
        if (std::abs(wanted - apart_) > change)
            apart_ = std::round(wanted * steps) / steps;
        return apart_;
    }
    /// Tells how long the whole picture took. Thirteen short ones undo what a long one did: so one of fourteen is too long.
    void took(double time) noexcept
    {
        constexpr double fewer = 0.85, more = 1.0125;
        rays_ *= time > seconds ? fewer : more;
    }

private:
    double rays_ = 30e3;  // that fit in a picture
    double apart_ = 2;
};

}  // namespace palpate::render
