#pragma once

#include <chainmail/window.h>

#include <array>
#include <optional>
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
    /// @param kernels the arithmetic
    /// The body must outlive it, and the kernels.
    WindowStack(const ElasticBody& body, int window, const Focus& focus, const Kernels& kernels = chainmail::kernels());

    std::span<Window> windows() noexcept { return windows_; }
    std::span<const Window> windows() const noexcept { return windows_; }
    Window& operator[](std::size_t level) noexcept { return windows_[level]; }
    std::size_t size() const noexcept { return windows_.size(); }
    const ElasticBody& body() const noexcept { return *body_; }
    const Kernels& kernels() const noexcept { return *kernels_; }
    float* scratch() noexcept { return scratch_.data(); }

    /// Moves windows whose middle is some nodes away from where `focus` has it; where `carry`, takes u, d and the history
    /// along. The history is a force: its work along a displacement that the coarser window has too stays what it was.
    /// @returns  true when a window moved: what was computed from u and d has to be computed again
    bool follow(const Focus& focus, bool carry) noexcept;

    /// y = -A x on the degrees of freedom, over all windows. x must be continuous at the windows' borders.
    void apply(Field x, Field y) noexcept { evaluate(x, y, x, volume::SmallStrain{}); }

    /// The tissue's force y at displacement x, which must be continuous at the windows' borders.
    struct Evaluated {
        double energy = 0;   // at finite strain; else 0 [J]
        double product = 0;  // along . y
    };
    Evaluated evaluate(Field x, Field y, Field along, const volume::Law& law) noexcept
    {
        return evaluate(x, y, along, law, {});
    }

    /// The same of term `term` of the Prony series alone: the force at u of tissue with its fraction of the moduli.
    void evaluateTerm(std::size_t term, Field y, const volume::Law& law) noexcept
    {
        evaluate(Field::u, y, Field::u, law, term);
    }
    /// Its history.
    static Field history(std::size_t term) noexcept { return term == 0 ? Field::h0 : Field::h1; }

    /// Gives border nodes what the next coarser window has there. Sums of continuous fields are continuous but for
    /// rounding, and what a multigrid cycle or follow() leaves is continuous.
    void joinBorders(Field x) noexcept;

    /// Adds a force at a node: to the residual of a degree of freedom; at a border node, to those it follows.
    void addForce(std::size_t level, std::size_t node, Vec3 force) noexcept
    {
        Window& w = windows_[level];
        node = w.fragments.original(node);
        if (w.dof[node] != 0.0F) {
            w.add(Field::r, node, force);
        } else if (w.border[node] != 0.0F) {
            addToParents(level, node, force);
        }
    }

    /// { x . a, x . b }, over the degrees of freedom where a and b are zero elsewhere.
    std::array<double, 2> dots(Field x, Field a, Field b) const noexcept;
    double dot(Field x, Field a) const noexcept { return dots(x, a, a)[0]; }
    /// r . du/dx_i for each axis i, in the finest window [x r / m].
    Vec3 alongSlopes(Field r, Field u) const noexcept;
    /// out = x + a y
    void combine(Field x, double a, Field y, Field out) noexcept;
    /// u += step d, a += step e, r = a.
    void warmStart(double step) noexcept;
    /// p = z + beta last, u += step p; last may be p.
    void direct(Field last, double beta, double step) noexcept;
    /// The end of a step along `direction`, p or d, see KeptStep. Returns { a . u, a . d, e . d }.
    std::array<double, 3> keepStep(Field direction, const KeptStep& step) noexcept;
    void copy(Field x, Field y) noexcept;
    void clear(Field field) noexcept;

private:
    Vec3 wantedPlace(std::size_t level, const Focus& focus) const noexcept;
    Index3 wantedLow(std::size_t level, const Focus& focus) const noexcept;
    void place() noexcept;
    void findFreedom() noexcept;
    void addToParents(std::size_t level, std::size_t node, Vec3 force) noexcept;
    void dropFields(bool carry) noexcept;
    void transfer(Field field) noexcept;
    Evaluated evaluate(Field x, Field y, Field along, const volume::Law& law, std::optional<std::size_t> term) noexcept;
    void gatherForces(Field field) noexcept;
    void handOutForces(Field field) noexcept;
    static StepFields stepFields(Window& window, Field direction) noexcept;

    const ElasticBody* body_;
    const Kernels* kernels_;
    std::vector<Window> windows_;
    std::vector<Index3> low_, oldLow_;
    std::vector<std::size_t> oldCount_;  // Layout::count
    Floats scratch_;
};

}  // namespace palpate::chainmail
