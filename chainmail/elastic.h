#pragma once

#include <chainmail/held_tool.h>
#include <chainmail/multigrid.h>
#include <chainmail/window_stack.h>

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

namespace palpate::chainmail {

struct ElasticOptions {
    int window = 15;                          // nodes of a window along the way in, odd; see WindowStack
    int cycles = 2;                           // per call of relax(); one more where that leaves much out of balance
    volume::Law law = volume::SmallStrain{};  // of all tissue
    double period = 1e-3;                     // of a tick [s]: what relaxes does so by the ticks that its loads name
    std::size_t maxSites = 4096;              // points, nodes under the surface and ties held at once, at least
    double touches = 0;       // surface of the tools that press: more sites where those need it, see sitesFor() [m^2]
    double tolerance = 0.01;  // no more once the forces out of balance are this fraction of the contacts' [-]
    double unfelt = 0.0;      // and none beyond `cycles` while they are less than this [N]
    int heldPeriod = 3;       // of an ElasticLevel: see there
    bool warmStart = true;    // begin with the last call's increment; without, a call begins where the tissue lies
    const Kernels* kernels = nullptr;  // the arithmetic; null: the widest set of this machine. All have the same results
};

struct ElasticResult {
    double energy = 0;           // of tissue and contacts [J]
    double start = 0;            // the same when the call began, the tools where they are now [J]
    double residual = 0;         // forces out of balance before the last step, Euclidean norm over degrees of freedom [N]
    double depth = 0;            // of the deepest point of tissue inside a tool [m]
    double behind = 0;           // by how much the tool that is held back most is, see HeldTool [m]
    std::uint32_t contacts = 0;  // points that a tool presses
    std::uint32_t cycles = 0;
    std::uint32_t shortened = 0;  // steps that would have raised the energy
    bool moved = false;           // windows moved
};

/// Level 2: the equilibrium of an elastic body that tools press and pull, tracked from call to call on nested windows
/// around the tool.
///
/// Each call first goes along the last call's increment, as far as lowers the energy most: a tool that moves on steadily
/// finds almost all of its answer there. Then come cycles of conjugate gradients, preconditioned by one multigrid cycle
/// over the windows and conjugate to the step before, the last call's increment included. Every step has a line search on
/// the energy with the contacts as they are along it, so that none raises the energy: one that would is shortened, and
/// dropped at last.
///
/// A body that relaxes (ElasticBody::relaxes) is a generalised Maxwell solid. Of its force right after a step, a(u), each
/// term i of the Prony series has taken a history h_i, and the tissue's force is a(u) - h_0 - h_1, with
///
///     dh_i/dt = (a_i(u) - h_i) / t_i
///
/// a_i being the force of the same tissue with its moduli times the term's weights, cell by cell: exact where tissues meet.
/// In a call the history is a dead load, so that a call keeps one energy. The terms go on by turns, exactly for a u that
/// rests. Source: R. L. Taylor, K. S. Pister, G. L. Goudreau, "Thermomechanical analysis of viscoelastic solids", Int. J.
/// Numer. Methods Eng. 2, 1970 (recursion); history by node and not by cell, since all tissue has the same times.
///
/// A tool presses only as deep as the cells bear, see HeldTool.
///
/// Sources: S. F. McCormick, "Multilevel Adaptive Methods for Partial Differential Equations", 1989 (composite grids);
/// A. V. Knyazev, "Toward the optimal preconditioned eigensolver", SIAM J. Sci. Comput. 23, 2001 (locally optimal steps).
/// Mathematics, pictures and figures: docs/kernel.md.
class Elastic {
    static constexpr double furtherCycles = 1.5;  // a second cycle in a tick costs too much for what is nearly balanced
    static constexpr double farOff = 6.0;         // and one beyond the most is worth it for what is not
    static constexpr std::size_t maxTools = 16, maxTies = 64;

public:
    /// @param focus  where the windows start
    /// The body must outlive it.
    Elastic(const ElasticBody& body, const ElasticOptions& options, const Focus& focus);

    /// Goes on towards the equilibrium under this load; without a load the body is at rest. What the load refers to must
    /// live until the next call. Cost O(nodes of the windows); allocates nothing, never throws.
    ElasticResult relax(const ElasticLoad& load) noexcept { return relaxWhile(load, tick()); }
    /// As relax(), in parts, for a load whose force nobody waits for. Here it moves the windows, or meets the load and goes
    /// along the last increment; goOn() has the rest. Without friction, moves and steps that are shortened twice, enough
    /// parts end with the bits of relax().
    ElasticResult begin(const ElasticLoad& load) noexcept;
    /// Goes on with the last load by half a cycle: the correction of the forces out of balance, or the step along it. None
    /// where relax() would have stopped by now. After a move of the windows it meets the load. What the load refers to must
    /// still live.
    /// @param isLast  part of this load: it leaves no half, and has a whole cycle if there was none
    ElasticResult goOn(bool isLast = false) noexcept;
    /// As relax(), for at most `cycles`, until the residual is under `tolerance` times the contacts' forces. No tool is
    /// held back.
    ElasticResult relax(const ElasticLoad& load, int cycles, double tolerance) noexcept
    {
        return relaxWhile(load, {cycles, tolerance, tolerance, 0.0, false});
    }

    /// Force of the tissue on tool `i` and on tie `i` of the last load [N]: that of the contacts, times the ratio of the
    /// tissue's virtual work along the displacement to theirs. Balanced the ratio is 1. Short of it contacts are out by the
    /// error of the displacement, since they are what a tool moves first; with the ratio they are out by its square, as
    /// far as the tissue's answer to the next push is like its answer so far. (Becker and Rannacher, "An optimal control
    /// approach to a posteriori error estimation", Acta Numerica 10, 2001: the residual times the dual solution, for which
    /// the displacement itself stands here.) A frictionless tool that alone touches the body, without ties, also has the
    /// lag of the force along the surface taken off: there the displacement goes along with the tool, and -du/dx stands for
    /// the dual solution, see findLag().
    /// Over a move of the windows, toolForce() is blended, see MoveBlend.
    Vec3 toolForce(std::size_t i) const noexcept;
    Vec3 tieForce(std::size_t i) const noexcept;
    /// By how much tool `i` of the last load is held back on its way to what is held in space, see HeldTool [m].
    double behind(std::size_t i) const noexcept
    {
        return atRest_ || i >= held_.size() ? 0.0 : held_[i].behind - held_[i].inHeld;
    }
    /// How deep the surface is in tool `i` of the last load, as deep as that is held back [m].
    double depth(std::size_t i) const noexcept { return atRest_ || i >= held_.size() ? 0.0 : held_[i].depth; }
    /// Displacement of the material that is at `rest` [m].
    Vec3 displacement(Vec3 rest) const noexcept;
    /// The same at the middle of a cell of the finest level.
    Vec3 displacementOf(Index3 cell) const noexcept;
    bool atRest() const noexcept { return atRest_; }

    /// Of a body that relaxes: how far each term of its history has got, as a fraction of where it goes to if nothing
    /// moves, mean over the body. Uses up working memory, as relax() does.
    using HistoryShares = std::array<double, volume::relaxationTerms>;
    HistoryShares historyShares() noexcept;
    /// Begins with such a history, until its own displacement has been found: for windows that take over from others.
    void beginWith(const HistoryShares& fractions) noexcept;
    const WindowStack& stack() const noexcept { return stack_; }
    const ElasticBody& body() const noexcept { return stack_.body(); }
    /// Nodes of all windows.
    std::size_t nodes() const noexcept;
    std::span<const ContactSite> sites() const noexcept { return std::span(sites_).first(siteCount_); }

private:
    // Energy of the tissue along a direction.
    struct Parabola {
        double slope = 0, curvature = 0;
        double at(double length) const noexcept { return (slope + 0.5 * curvature * length) * length; }
        // The same where the direction has led, for what has been gone of it.
        Parabola from(double length) const noexcept
        {
            return {(slope + curvature * length) * length, curvature * length * length};
        }
    };
    // d, of the increment; or p = z + beta (the last step), which the first step makes.
    struct Direction {
        Field field = Field::p;
        double beta = 0;
        Parabola tissue;
        Along contacts;  // where the step starts
    };

    // What the next direction is made conjugate to: a step of this call with its image, d and e or p and q.
    struct LastStep {
        Field direction = Field::d;
        Field image = Field::e;
        Parabola tissue;    // along all of it, where it led
        double length = 0;  // of it, in the sites' p and in the field p
    };

    std::span<ContactSite> active() noexcept { return std::span(sites_).first(siteCount_); }
    // At most `cycles`: the first while the residual is over `first`, others while it is over `further` times the contacts'
    // forces. One more after them while it is over `far`; 0 = none.
    struct Effort {
        int cycles;
        double first, further, far;
        bool isTick = true;  // tools are held back where the body does not bear them, and a warm start may be the last step
        bool inParts = false;  // this call meets the load, and goOn() has the cycles
    };
    Effort tick() const noexcept
    {
        const double t = options_.tolerance;
        return {options_.cycles, t, furtherCycles * t, farOff * t};
    }
    Effort part() const noexcept
    {
        Effort effort = tick();
        effort.inParts = true;
        return effort;
    }
    // How far the solution of a load has got.
    struct Course {
        Effort effort{};
        int usual = 0;          // cycles that it may have, but for one more where it is far off
        int last = 0;           // and with that one
        int next = 0;           // the cycle that comes next
        double start = 0;       // energy when the call began, tissue and contacts [J]
        bool isOpen = false;    // the tissue's force was not evaluated where it is
        bool isCopied = false;  // r is a
        bool isKnown = false;   // r is the residual: it ended balanced
        bool isHalf = false;    // z is its correction, and the step along it is left
    };
    ElasticResult relaxWhile(const ElasticLoad& load, const Effort& effort) noexcept;
    void relieve(std::span<const ElasticTool> tools) noexcept;
    bool follow(const ElasticLoad& load) noexcept;
    Focus whereItSticks(const ElasticLoad& load) noexcept;
    void solve(int most, ElasticResult& result) noexcept;
    double toleranceOf(const ElasticResult& result) const noexcept;
    void endBalanced() noexcept;
    void endCycle(ElasticResult& result) noexcept;
    void close(ElasticResult& result) noexcept;
    bool isBalanced(double residual, double tolerance) const noexcept;
    void finish(ElasticResult& result) noexcept;
    std::span<const ElasticTool> heldTools(std::span<const ElasticTool> tools, bool holdsBack) noexcept;
    void settle() noexcept;
    void startAnew() noexcept;
    void meet(const ElasticLoad& load, bool moved) noexcept;
    bool touched() const noexcept;
    WindowStack::Evaluated tissueForce(Field y, Field along) noexcept;
    void refreshForces() noexcept;
    bool springsBack() const noexcept;
    void remember(int periods) noexcept;
    void takeGiven() noexcept;
    double refreshResidual() noexcept;
    void addContactForces() noexcept;
    void scaleIncrement() noexcept;
    double lastInField() const noexcept { return last_.direction == Field::p ? last_.length : increment_; }
    void prepareContacts() noexcept;
    Along look() noexcept;
    double lineSearch(double slope, double curvature, Along start, int steps) const noexcept;
    bool sitesHold(std::span<const ElasticTool> tools) const noexcept;
    bool tiesHold(std::span<const Tie> ties) const noexcept;
    void findSitesOf(const ElasticLoad& load, bool moved) noexcept;
    // Calls visit(site) for all, which sets their energy.
    template <typename Visit>
    void touchAll(const Visit& visit) noexcept
    {
        contactEnergy_ = 0.0;
        for (ContactSite& s : active()) {
            visit(s);
            contactEnergy_ += s.energy;
        }
    }
    void moveSites(double length) noexcept;
    void letSlip() noexcept;
    void keepSlips() noexcept;
    void takeSlips(std::span<ContactSite> found) noexcept;
    double frictionOf(const ContactSite& site) const noexcept;
    double searchParabola(const Direction& to, ElasticResult& result) noexcept;
    bool warmStart(ElasticResult& result) noexcept;
    bool confirm(double start) noexcept;
    void retreat() noexcept;
    void again(ElasticResult& result) noexcept;
    static constexpr double noLimit = -std::numeric_limits<double>::infinity();  // of the energy that a step must go under
    bool takeStep(const Direction& to, double limit, ElasticResult& result) noexcept;
    bool takeLinearStep(Direction to, ElasticResult& result) noexcept;
    void keepStep(const Direction& to, KeptStep step) noexcept;
    void forgetIncrement() noexcept;
    void forgetStep() noexcept;
    bool step(double limit, ElasticResult& result) noexcept;
    double loadForce() const noexcept;
    void balance() noexcept;
    void findLag() noexcept;
    void measure(ElasticResult& result) noexcept;
    void blendMoves(bool isTick, bool moved) noexcept;

    ElasticOptions options_;
    volume::Reach reach_;
    WindowStack stack_;
    Multigrid multigrid_;
    std::vector<ContactSite> sites_;
    std::size_t siteCount_ = 0, touching_ = 0;  // sites, and those of tools, which come first
    std::vector<occupancy::ShapeDistance> shapes_;
    struct FoundFor {
        occupancy::RoundCone shape;
        Division pieces;
    };
    std::vector<FoundFor> foundFor_;            // the tools when the sites were looked for
    std::vector<PressedBox> pressed_;           // by each tool, when the sites were looked for
    std::vector<Tie> tiesFound_;                // the ties then, as far as there are not more than that
    std::vector<HeldTool> held_;                // of each tool
    std::vector<ElasticTool> tools_;            // as the body feels them
    std::vector<occupancy::RoundCone> toolAt_;  // in the last call
    // ContactSite::slip and limit, from one search for sites to the next.
    struct Slip {
        std::uint32_t point = 0;
        std::uint16_t owner = 0;
        Vec3f rest{0.0F};  // of a piece of the point [m]
        Vec3f way{0.0F};
        float limit = 0;
    };
    std::vector<Slip> slips_;  // in the order of sites: by tool, and there by point
    std::span<const Tie> ties_;
    std::array<int, volume::relaxationTerms> since_{};  // periods since each term of the history went on
    std::size_t term_ = 0;                              // whose turn it is
    int untilTurn_ = 0;                                 // calls
    HistoryShares given_{};                             // see beginWith()
    int givenFor_ = 0;                                  // calls
    double historyEnergy_ = 0;                          // history . u [J]
    double energy_ = 0;                                 // of the tissue, history's included [J]
    double startEnergy_ = 0;                            // the same when the call began [J]
    double contactEnergy_ = 0;                          // [J]
    double contactForce_ = 0;                           // sum of the contacts' forces, each by its size, in r [N]
    Course course_;
    std::optional<Vec3> stuck_;           // the middle of the tissue that sticks to the tool that is led, at rest [m]
    std::optional<ElasticLoad> waiting_;  // windows moved for it, and contacts were not found since
    LastStep last_;
    std::optional<std::array<double, 3>> products_;  // a . u, and of the increment d: a . d, e . d; where known
    double increment_ = 1;                           // the last call's, in the fields d and e; after a step along p 1
    double stiffness_ = 0;                           // along the last step, of tissue and contacts
    std::array<double, 3> nearness_{1, 1, 1};        // by cycle: stiffness along z, in the residual's work along it
    double balance_ = 1;                             // see toolForce()
    int sinceRefresh_ = 0;
    int sinceFound_ = 0;         // calls since surface points were looked for
    double untouchedFor_ = 0.0;  // [s]
    bool slides_ = false;        // a tool has friction
    bool atRest_ = true;
    bool hasIncrement_ = false;
};

}  // namespace palpate::chainmail
