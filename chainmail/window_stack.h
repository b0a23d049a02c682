#pragma once

#include <chainmail/window.h>

#include <array>
#include <span>
#include <vector>

namespace palpate::chainmail {

/// Where the windows shall be: around a point, but with as little air in them as can be.
struct Focus {
    Vec3 point{0.0};   // at rest [m]
    Vec3 inward{0.0};  // unit vector into the body, or zero: windows are centred on the point
    double depth = 0;  // of the point under the surface [m]

    Focus(Vec3 at = Vec3(0.0), Vec3 into = Vec3(0.0), double under = 0.0) noexcept : point(at), inward(into), depth(under)
    {
    }
};

/// The focus around a point at rest [m].
Focus focusAt(const volume::DistanceField& surface, Vec3 point) noexcept;

/// The nested windows as one finite-element space: where they are, and the operator on all of them together.
class WindowStack {
public:
    /// @param window  nodes of a window along the way in, odd; sideways it has half as many again. A level with fewer is
    ///                held whole
    /// @param focus   where the windows start; its inward direction decides which way is in
    /// The body must outlive it.
    WindowStack(const ElasticBody& body, int window, const Focus& focus);

    std::span<Window> windows() noexcept { return windows_; }
    std::span<const Window> windows() const noexcept { return windows_; }
    Window& operator[](std::size_t level) noexcept { return windows_[level]; }
    std::size_t size() const noexcept { return windows_.size(); }
    const ElasticBody& body() const noexcept { return *body_; }
    const Kernels& kernels() const noexcept { return *kernels_; }
    float* scratch() noexcept { return scratch_.data(); }

    /// Moves windows whose middle is some nodes away from where `focus` has it; where `carry`, takes u and d along.
    /// @returns  true when a window moved: what was computed from u and d has to be computed again
    bool follow(const Focus& focus, bool carry) noexcept;

    /// y = -A x on the degrees of freedom, over all windows; makes x continuous at the windows' borders first.
    void apply(Field x, Field y) noexcept { applyWith(x, y, false); }
    /// As apply(), for finite strain; returns the energy [J].
    double applyFinite(Field x, Field y) noexcept { return applyWith(x, y, true); }

    /// Adds a force at a node: to the residual of a degree of freedom; at a border node, to those it follows.
    void addForce(std::size_t level, std::size_t node, Vec3 force) noexcept;

    /// { x . a, x . b }, over the degrees of freedom where a and b are zero elsewhere.
    std::array<double, 2> dots(Field x, Field a, Field b) const noexcept;
    double dot(Field x, Field a) const noexcept { return dots(x, a, a)[0]; }
    /// out = x + a y
    void combine(Field x, double a, Field y, Field out) noexcept;
    /// u += step p and a += step q; d = keep d + step p and e = keep e + step q.
    void advance(double step, Field p, Field q, double keep) noexcept;
    void copy(Field x, Field y) noexcept;
    void clear(Field field) noexcept;

private:
    Vec3 wantedPlace(std::size_t level, const Focus& focus) const noexcept;
    Index3 wantedLow(std::size_t level, const Focus& focus) const noexcept;
    void place() noexcept;
    void transfer(Field field) noexcept;
    double applyWith(Field x, Field y, bool finite) noexcept;

    const ElasticBody* body_;
    const Kernels* kernels_;
    std::vector<Window> windows_;
    std::vector<Index3> low_, oldLow_;
    Floats scratch_;
};

}  // namespace palpate::chainmail
