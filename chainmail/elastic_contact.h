#pragma once

#include <chainmail/rod.h>
#include <chainmail/window_stack.h>
#include <occupancy/tool_shape.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <limits>
#include <span>
#include <vector>

namespace palpate::chainmail {

inline constexpr double penalty = 20.0;    // contact stiffness per area, in E / h
inline constexpr double stiffened = 10.0;  // of ElasticTool::stiffest: the bound where tissue gives way

/// A rigid tool that tissue cannot enter.
struct ElasticTool {
    occupancy::RoundCone shape;  // where it is now [m]
    Vec3 pushed{0.0};  // its way there from where it would lie on the surface at rest; 0: nothing is known of its depth [m]
    double stiffest = 1e4;  // of the whole contact with bone [N/m]; with tissue that gives way `stiffened` times as much
    double friction = 0;    // Coulomb [-]
};

/// A material point that is held by springs, by a needle's tip; or, with a radius, a piece of a needle's shaft that tissue
/// sticks to: a rigid rod, see ringOf().
struct Tie {
    Vec3 rest{0.0};      // of a piece its middle [m]
    Vec3 u{0.0};         // the displacement that the springs pull to [m]
    Vec3 axis{0, 0, 1};  // unit vector
    double along = 0;    // stiffness of a point along the axis [N/m]
    double across = 0;   // and across it [N/m]

    RodPiece piece{};        // none: a point
    Vec3 restAxis{0, 0, 1};  // the rod's axis where it got hold of the tissue, unit vector

    /// The displacement that a point which was at `at` at rest is pulled to: the rod's, which has turned from restAxis to
    /// axis.
    Vec3 pulled(Vec3 at) const noexcept;
    /// True where only `u` may be another: the same points are held, as stiffly.
    bool holdsAs(const Tie& other) const noexcept;
};

/// The way of a point at `off` from where a body turns about, when that turns by the least turn from one unit vector to
/// another (O. Rodrigues, 1840); none where these are against each other.
Vec3 turnedWay(Vec3 off, Vec3 from, Vec3 to) noexcept;

struct ElasticLoad {
    static constexpr std::size_t noTool = std::numeric_limits<std::size_t>::max();

    std::span<const ElasticTool> tools;
    std::span<const Tie> ties;
    Focus focus;
    std::size_t led = noTool;  // index of the tool that the focus lies under, if there is one
    int periods = 1;           // since the call before, see ElasticOptions: tissue that relaxes goes on by as much
};

/// Where tool and tissue meet: a point of the surface that a tool may press, or a tie.
///
/// The penalty grows with the square of the depth, E = k depth^2 / 2 at each surface point, so that the force is smooth
/// when the tool slides, and the sum of all sites' forces is the gradient of one energy. A sphere on a grid of nodes would
/// pop from node to node; points four times as dense as the nodes, with their areas, do not. k = 20 E / h per area, both as
/// the tissue lies now: under a pressure p a tool sinks in by p h / 20 E, however far the surface under it is stretched,
/// and however much the tissue stiffens by that.
///
/// Friction is a spring along the surface up to Coulomb's limit, softer than the push: under a friction of mu p a point
/// slips by mu p h / 2 E until it slides, 0.1 mm and less. As stiff as the push it would slide and stick from one call to
/// the next, since a tool goes further in a millisecond.
///
/// Points of the surface alone let a tool squeeze a soft layer of few cells out between them: a cell under its pole turns
/// inside out, node by node, while the mean of its corners, from which its energy comes, does not. So the nodes under the
/// surface are kept out of a tool as well. Where the tissue lies around the tool, none of them is inside it.
///
/// A call goes over all sites some fourteen times: what is asked for together lies in one cache line.
struct alignas(64) ContactSite {
    static constexpr double gripOfPush = 0.1;  // stiffness of friction, of the push's

    Vec3 p{0.0};           // of the search direction [m]
    Vec3 normal{0.0};      // out of the tool there; of a tie, its axis
    double depth = 0;      // of a surface point inside the tool [m]
    double stiffness = 0;  // of a surface point by its area in this call; of a tie along its axis [N/m]

    Vec3 u{0.0};       // its displacement [m]
    Vec3 force{0.0};   // on the tissue [N]
    double limit = 0;  // slip along the surface up to which friction is a spring in this call; 0: none [m]
    bool isTie = false;
    bool isSubsurface = false;  // a node under the surface, which a tool presses as it does a point of the surface
    float compressible = 0;     // Lacking::compressible

    Vec3 rest{0.0};
    Vec3 slip{0.0};          // how far the tool went on since it took hold of the point, while they touch [m]
    double energy = 0;       // [J]
    std::uint32_t node = 0;  // lowest node of the cell that it lies in
    std::uint16_t level = 0;
    std::uint16_t owner = 0;  // index of tool or tie

    std::array<float, 8> fraction{};  // of each node of the cell: trilinear, x fastest
    Vec3 z{0.0};                      // of the search direction the part that is new [m]
    double across = 0;                // stiffness of a tie across its axis [N/m]

    Vec3 anchor{0.0};         // the point in a cell that it moves with [m]
    double atRest = 0;        // stiffness of a surface point, by its area at rest [N/m]
    double stretch = 0;       // of its area at the end of the last call, see StretchAt; 0: not known
    std::uint32_t point = 0;  // index of the surface point
    float area = 0;           // of the surface that it stands for, at rest [m^2]
    float lacks = 1;          // Lacking::times
    float resolved = 1;       // fraction of its stiffness that wider cells leave it
    float stiffer = 1;        // by which its tissue had stiffened at the end of the last call, see StretchAt
    float indented = 0;       // E / (1 - nu^2) of its tissue at rest, no more than the contact is as stiff as [Pa]

    bool active() const noexcept { return isTie || depth > 0.0 || limit > 0.0; }
    Vec3 along() const noexcept { return slip - glm::dot(slip, normal) * normal; }
    /// Takes Coulomb's limit, by the push as it is.
    void limitBy(double friction) noexcept { limit = friction / gripOfPush * std::max(depth, 0.0); }
    double grip() const noexcept { return gripOfPush * stiffness; }
    /// By how much the force falls when the point moves by v [N].
    Vec3 resist(Vec3 v) const noexcept
    {
        if (!active()) {
            return Vec3(0.0);
        }
        if (limit > 0.0) {
            const double out = glm::dot(normal, v);
            return (depth > 0.0 ? stiffness : 0.0) * out * normal + resistAlong(v - out * normal);
        }
        return across * v + (stiffness - across) * glm::dot(normal, v) * normal;
    }
    /// The same of friction alone. Where it slips, its force keeps its size and turns.
    /// @param v  along the surface
    Vec3 resistAlong(Vec3 v) const noexcept
    {
        const Vec3 way = along();
        const double length = glm::length(way);
        return length < limit ? grip() * v : grip() * limit / length * (v - glm::dot(way, v) / (length * length) * way);
    }
};

/// Depth, normal, force and energy of a site where it is now. Friction holds a point with the stiffness grip() up to the
/// slip `limit`; beyond, its force stays. The limit is Coulomb's, by the push at the end of the call before, and kept while
/// a call solves: so friction has an energy, and the contact stays a convex problem. A tool that goes back by more than the
/// surface is sunk into it lets go of nothing until the tissue had its time to follow.
void touch(ContactSite& site, std::span<const occupancy::ShapeDistance> shapes, std::span<const Tie> ties) noexcept;
/// The same where only the slip or its limit is another. @pre the site is no tie
void press(ContactSite& site) noexcept;

/// Derivatives of the contacts' energy by the way along the direction p [J].
struct Along {
    double slope = 0, curvature = 0;
    /// Adds a contact's at `alpha` of the way, to first order in the tool's surface: depth falls by normal . p.
    void add(const ContactSite& site, double alpha) noexcept;
};
Along contactsAlong(std::span<const ContactSite> sites, double alpha) noexcept;

/// ElasticTool::stiffest with which every tissue of the body's surface that gives way is held by 20 E / h: for forces that
/// no hand will feel. At least the standard.
double stiffnessUncapped(const ElasticBody& body, double radius) noexcept;

/// What the contact of a tool is at most as stiff as, per area of the surface now: ElasticTool::stiffest, spread over a
/// quarter of the tool's cross-section, what a shallow press touches [N/m^3].
double stiffestPerArea(const ElasticTool& tool) noexcept;
/// Of the patch that a tool touches, sqrt(R d) by Hertz [m].
double radiusOfPatch(const ElasticTool& tool) noexcept;
/// The same of a ball by its force F, a^3 = 3 F R (1 - nu^2) / 4 E: equal on a half-space, and right as well where
/// something stiff or soft lies under the tissue, or where that gives way as a whole. What is far from the patch moves all
/// of it alike, which changes the depth but not how the ball lies in it. At most 2 sqrt(R d), which is that of a thin
/// incompressible layer on something rigid: what it loses under the ball is what it rises around it. A capsule is a ball
/// where its end presses; it keeps sqrt(R d) where half of the force is on its side.
/// @param load      sum of the sizes of its contacts' forces [N]; 0: not known
/// @param indented  sum of these times E / (1 - nu^2) of their tissue [N Pa]
/// @param onEnds    sum of those on its ends [N]
double radiusOfPatch(const ElasticTool& tool, double load, double indented, double onEnds) noexcept;
/// Whether a tool's surface with this normal, a unit vector out of it, is a part of the spheres at its ends: along its side
/// normals have the angle of its taper to its axis. All of a ball is.
bool isOnEnd(const occupancy::RoundCone& shape, Vec3 normal) noexcept;
/// How far the surface lies around a tool, by its depth in radii: 0 up to 0.4, 1 from 0.6 on.
double wrapping(const ElasticTool& tool) noexcept;
/// Into how many pieces along each of two edges surface points are divided while a tool's patch is small: points of a small
/// patch are then as dense as this, wherever in the cells the surface lies. Where it lies around a tool, points as dense as
/// the tool's cells make them too stiff: they become whole, one part after the other. All at once changed the
/// force by up to 5 %.
struct Division {
    static constexpr int parts = 16;

    int along = 1;
    int whole = 0;  // parts of the points, which are one piece

    bool operator==(const Division&) const = default;
    /// Into how many pieces along each edge a point of the surface is divided.
    int of(std::uint32_t point) const noexcept;
    /// Whether points divided so serve as these do, up to one part.
    bool servesFor(const Division& other) const noexcept;
};
/// @param spacing  of the finest cells [m]
/// @param edge     ElasticBody::pieceEdge
/// @param share    times the radius of the tool's patch
Division piecesUnder(const ElasticTool& tool, double spacing, double edge, double share = 1.0) noexcept;
/// Whether points found with a division still serve under a tool: until its patch is 3 % beyond where another begins.
bool stillServes(const Division& found, const ElasticTool& tool, double spacing, double edge) noexcept;

/// How many surface points tools may touch at once whose surface, three cells around them included, is `area` [m^2]: of the
/// body both sides, as densely as its points lie, and not more than it has. At least `least`.
std::size_t sitesFor(const ElasticBody& body, double area, std::size_t least) noexcept;
/// That surface of one tool [m^2].
double touchedBy(const occupancy::RoundCone& shape, double spacing) noexcept;

/// Box around what a tool presses, where that lies at rest. Friction drags tissue along with a tool, away from there.
struct PressedBox {
    Vec3 low{std::numeric_limits<double>::max()}, high{std::numeric_limits<double>::lowest()};  // [m]

    void add(Vec3 rest) noexcept
    {
        low = glm::min(low, rest);
        high = glm::max(high, rest);
    }
};

/// Fills `out` with the surface points that tools may touch: those within `near` [m] of one, as the tissue lies now or as
/// it would lie at rest. Looked at are those that lie around the tool at rest, or around what it pressed before.
/// @param pressed  by each tool before; may be shorter
/// @returns        how many; more than out holds are left out
std::size_t findSites(const ElasticBody& body, std::span<const Window> windows, std::span<const ElasticTool> tools,
                      std::span<const occupancy::ShapeDistance> shapes, std::span<const PressedBox> pressed, double near,
                      std::span<ContactSite> out) noexcept;
/// Fills `out` with the ties.
/// @returns  how many; more than out holds are left out
std::size_t findTies(const ElasticBody& body, std::span<const Window> windows, std::span<const Tie> ties,
                     std::span<ContactSite> out) noexcept;

/// The surface around a site now, over that at rest.
struct Stretch {
    double area = 1;     // |cof(F) N|, F the deformation gradient at the middle of the cell's tissue, N the normal at rest
                         // (Nanson's formula) [-]
    double modulus = 1;  // shear modulus, by the law of material at F [-]
};

/// Stretch at sites, within bounds that keep a cell that is turned inside out from having its say. Remembers the last cell:
/// sites of one cell follow each other.
class StretchAt {
public:
    StretchAt(const WindowStack& stack, const volume::Law& law) noexcept : stack_(stack), law_(law) {}
    Stretch operator()(const ContactSite& site) noexcept;

private:
    const WindowStack& stack_;
    volume::Law law_;
    std::uint32_t node_ = 0;
    std::uint32_t level_ = ~0U;
    std::array<Vec3, 3> cofactor_{};  // columns of cof(F)
    double modulus_ = 1;
};

/// How far between nodes a place is, by b = f (1 - f) along both edges of a cell that lie along the surface, f the place
/// along one, 0 to 1. The defaults are the means over all places.
struct Between {
    double sum = 1.0 / 3.0;       // of both
    double square = 1.0 / 15.0;   // sum of both squares
    double product = 1.0 / 36.0;  // of both
};
/// Of the middle of what a tool touches, over the edges across its way. The mean for a capsule that lies flat, unless it is
/// shorter than its patch, and for a tool that is a radius deep.
Between betweenNodes(const volume::NodeGrid& grid, const ElasticTool& tool) noexcept;

/// By what cells around a point lack other compliance than those of the finest level that are full of soft tissue.
struct Lacking {
    double times = 1;         // as much
    double compressible = 0;  // by how much Poisson's ratio is under 0.47 [-]
    double sliver = 0;        // SurfacePoint::sliver
};

/// Fraction of the contact's stiffness that points have under a patch of radius a on cells of side h.
///
/// Cells do not give way under a patch smaller than themselves as tissue does, least in the middle between nodes. What they
/// lack there is a compliance c h / E per area:
///
///     c = m + g (sum - 1/3) + q (square - 1/15) + x (product - 1/36)
///     share = 1 / (1 + 20 c)
///
/// m, g, q and x are functions of a / h; all end at 2. They are what a ball on a half-space (Hertz 1882; nu 0.47, from 1.4
/// cells on 0.45) needs on grids shifted along the surface and across it; `palpate accuracy --verify` has the errors that
/// are left.
///
/// A point in a wider window lies in cells that are wider than h, and lack as many times the compliance. Tissue with nu
/// under 0.47 lacks 0.6 (0.47 - nu) h / E more, where E is 2.9 mu, and less than that under 1/4 and over 2 cells; its g, q
/// and x are 1 + 1.2 (0.47 - nu) times as large: by the same measurements at nu 0, 0.2 and 0.35.
class ResolvedShare {
public:
    /// @param radiusInCells  in cells of its window
    /// @param between  radius of which g, q and x are taken, in the same cells
    /// @param across   betweenNodes() of the tool
    ResolvedShare(double radiusInCells, double between, const Between& across) noexcept;
    double operator()(const Lacking& lacking) const noexcept;

private:
    double mean_, uneven_;          // of the compliance c: m, and what is added to it
    double compressible_, sliver_;  // compliance per Lacking's
};

/// Value of a field at sites. Remembers the last cell: sites of one cell follow each other.
class ValueAt {
public:
    ValueAt(std::span<const Window> windows, Field field) noexcept : windows_(windows), field_(field) {}
    /// @pre  nothing but this reads the field between calls
    Vec3 operator()(const ContactSite& site) noexcept;

private:
    std::span<const Window> windows_;
    Field field_;
    std::uint32_t node_ = 0;
    std::uint32_t level_ = ~0U;
    std::array<Vec3, 8> nodes_{};
};

/// The same at one site.
inline Vec3 gather(std::span<const Window> windows, const ContactSite& site, Field field) noexcept
{
    return ValueAt(windows, field)(site);
}

/// Shares of a cell's nodes in what is at `t` of its edges: trilinear, x fastest.
inline std::array<float, 8> trilinear(Vec3 t) noexcept
{
    const std::array<Vec3, 2> w{1.0 - t, t};
    std::array<float, 8> fraction{};
    for (std::size_t c = 0; c < 8; ++c) {
        fraction[c] = static_cast<float>(w[c & 1].x * w[(c >> 1) & 1].y * w[c >> 2].z);
    }
    return fraction;
}

/// Finest window with the cell around `rest` [m], and where in it. `level` = number of windows when none has it.
void locate(const ElasticBody& body, std::span<const Window> windows, Vec3 rest, ContactSite& site) noexcept;
/// The same for the middle of a cell of the finest level: on a coarser level it lies at (2 m + 1) / 2^(level + 1) of a
/// cell's edges, m whole numbers.
void locateMiddle(const ElasticBody& body, std::span<const Window> windows, Index3 cell, ContactSite& site) noexcept;

}  // namespace palpate::chainmail
