#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <utility>
#include <vector>

namespace palpate::chainmail {

/// Minimises an energy by steps of Newton's method, whose inverse is a first guess and what the last steps have shown of it
/// (J. Nocedal, "Updating quasi-Newton matrices with limited storage", Math. Comp. 35, 1980). For bodies that are solved
/// once: it allocates.
class QuasiNewton {
public:
    using Values = std::vector<double>;
    /// A step, and the change of the gradient along it.
    using Pair = std::pair<Values, Values>;

    struct Limits {
        std::size_t remembered;  // steps
        int halvings;            // of one step
    };

    /// @param u         where the energy is least so far; step() moves it. Both outlive this.
    /// @param gradient  of the energy at u
    /// @param evaluate  brings the gradient to where u is
    /// @param guess     applies the first guess of the inverse in place, given the last pair (nullptr: none yet)
    /// @pre   the gradient is that at u
    QuasiNewton(Values& u, const Values& gradient, Limits limits, std::function<void()> evaluate,
                std::function<void(Values&, const Pair*)> guess);

    /// One step, halved until the slope at its end is no longer steeply up: the energy's last bits are too coarse to tell.
    /// @returns  how much of it was gone; 0 where there is no way down, and then what was remembered is forgotten
    double step();
    /// The last step found no way down, and there was nothing to forget.
    bool stuck() const noexcept { return stuck_; }
    /// Largest component of the whole of the last step.
    double largest() const noexcept { return largest_; }

private:
    Values direction() const;
    double advance(const Values& start, const Values& step);

    Values& u_;
    const Values& gradient_;
    Limits limits_;
    std::function<void()> evaluate_;
    std::function<void(Values&, const Pair*)> guess_;
    std::deque<Pair> pairs_;
    double largest_ = 0;
    bool stuck_ = false;
};

}  // namespace palpate::chainmail
