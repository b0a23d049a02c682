// Which points of the surface tools may touch, how stiff they are, and where ties hold.
#include <chainmail/elastic_contact.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>

namespace palpate::chainmail {

namespace {

constexpr double slight = 0.02;       // area of a surface point that is not worth dividing, in that of its sub-cell's face
constexpr double close = 0.3;         // how far from a tool points are divided [cells],
constexpr double smallPatch = 1.1;    // and how far from its middle where they are divided finely [cells]
constexpr double leastRadius = 1.25;  // of a tool that nodes under the surface hold up [cells]
constexpr double lengthRounding = 1e-6;  // of a rod, in cells
constexpr double otherTissue = 1.25;     // times as stiff as the softest along a ring of a rod
constexpr double endless = 1.0;          // length of a rod [m]
constexpr double shortestRing = 0.13;    // that is halved, in the finest cells
constexpr double givesAsFitted = 0.47;   // Poisson's ratio of the tissue that ResolvedShare is fitted to

double touchedAtFirst(double radius) noexcept
{
    return 0.25 * std::numbers::pi * radius * radius;
}

// Stiffness of a surface point by its area at rest.
double siteStiffness(const ElasticBody& body, const SurfacePoint& p, const ElasticTool& tool) noexcept
{
    const auto& grid = body.levels.front().nodes;
    const Index3 cell = grid.cellAt(Vec3(p.anchor));
    const bool givesWay = grid.contains(cell) && body.held[grid.offset(cell)] == 0.0F;
    const double most = stiffestPerArea(tool) * (givesWay ? stiffened : 1.0);
    return std::min(penalty * youngsModulusOf(p.mu) / grid.spacing, most) * static_cast<double>(p.area);
}

// How much more compliance than the finest cells of soft tissue those around a site lack, over its own. What is as stiff as
// may be gives way less than that in cells of any size, nor does it lie around a tool as its modulus says: radiusOfPatch().
void findLacking(const ElasticBody& body, const SurfacePoint& p, ContactSite& site) noexcept
{
    const CellLevel& finest = body.levels.front();
    const double uncapped = penalty * youngsModulusOf(p.mu) / finest.nodes.spacing * static_cast<double>(site.area);
    const double kept = site.atRest / uncapped, nu = poissonAt(finest, site.anchor);
    site.compressible = static_cast<float>(std::max(0.0, givesAsFitted - nu) * kept);
    site.lacks = static_cast<float>(1.0 + (std::ldexp(1.0, site.level) - 1.0) * kept);
    site.indented = static_cast<float>(2.0 * static_cast<double>(p.mu) / (1.0 - nu) * kept);
}

// A unit vector across a unit vector.
Vec3 acrossOf(Vec3 way) noexcept
{
    const Vec3 size = glm::abs(way);
    const Vec3 axis = size.x <= size.y && size.x <= size.z ? Vec3(1, 0, 0)
                      : size.y <= size.z                   ? Vec3(0, 1, 0)
                                                           : Vec3(0, 0, 1);
    return glm::normalize(glm::cross(way, axis));
}

class Finder {
public:
    Finder(const ElasticBody& body, std::span<const Window> windows, double near, std::span<ContactSite> out)
        : body_(body), windows_(windows), near_(near), out_(out)
    {
    }

    void addTie(const Tie& tie, std::size_t index) noexcept
    {
        ContactSite site;
        site.rest = site.anchor = tie.rest;
        site.owner = static_cast<std::uint16_t>(index);
        site.isTie = true;
        site.stiffness = tie.along;
        site.across = tie.across;
        site.normal = tie.axis;
        if (tie.piece.isRod()) {
            addRod(tie, site, index);
        } else {
            add(site);
        }
    }

    void addTool(const ElasticTool& tool, const occupancy::ShapeDistance& shape, const PressedBox& pressed,
                 std::size_t index) noexcept
    {
        const auto& grid = body_.levels.front().nodes;
        const auto& s = tool.shape;
        const double around = near_ + grid.spacing, radius = s.widest() + around;
        const Vec3 first = glm::min(s.a, s.b), last = glm::max(s.a, s.b);
        const Vec3 low = glm::min(glm::min(first, first - tool.pushed) - radius, pressed.low - around);
        const Vec3 high = glm::max(glm::max(last, last - tool.pushed) + radius, pressed.high + around);
        forEachRow(low, high, [&](std::size_t row, int from, int to) { addRow(tool, shape, index, row, from, to); });
    }

    // Nodes under the surface that at rest were where the tool is, and still are close to it.
    void addSubsurface(const ElasticTool& tool, const occupancy::ShapeDistance& shape, std::size_t index) noexcept
    {
        const auto& grid = body_.levels.front().nodes;
        const auto& s = tool.shape;
        if (s.widest() < leastRadius * grid.spacing) {
            return;
        }
        const double around = s.widest() + near_;
        forEachRow(glm::min(s.a, s.b) - around, glm::max(s.a, s.b) + around, [&](std::size_t row, int from, int to) {
            for (const SubsurfaceNode& n :
                 inRow(body_.subsurface, body_.subsurfaceRows, row, from, to, &SubsurfaceNode::node)) {
                addNode(tool, shape, index, n);
            }
        });
    }

    std::size_t count() const noexcept { return count_; }

private:
    // Calls visit(row, first, last) for the rows of cells that meet a box. Cells in the list of the surface are numbered by
    // their middles' grid, which starts at the lowest node; a node has the number of the cell above it.
    template <typename Visit>
    void forEachRow(Vec3 low, Vec3 high, const Visit& visit) noexcept
    {
        const auto& grid = body_.levels.front().nodes;
        const Vec3 most(grid.size - 2);
        const Index3 from(glm::clamp(glm::floor((low - grid.origin) / grid.spacing), Vec3(0.0), most));
        const Index3 to(glm::clamp(glm::floor((high - grid.origin) / grid.spacing), Vec3(0.0), most));
        for (int z = from.z; z <= to.z; ++z) {
            for (int y = from.y; y <= to.y; ++y) {
                visit(static_cast<std::size_t>(y + z * grid.size.y), from.x, to.x);
            }
        }
    }

    // A piece of a rod: rings of points around it, one per cell along it. Points that would lie outside of the tissue move
    // with the axis.
    void addRod(const Tie& tie, ContactSite site, std::size_t index) noexcept
    {
        locate(body_, windows_, tie.rest, site);
        if (!hasTissue(tie.rest) || site.level >= windows_.size()) {
            return;
        }
        // Next to a window's border cells give way as little as those of the next coarser window, which hold it.
        const std::size_t level = std::min<std::size_t>(site.level + (atBorder(site) ? 1U : 0U), windows_.size() - 1);
        const double spacing = body_.levels[level].nodes.spacing;
        const double rings = std::max(1.0, std::ceil(tie.piece.length / spacing - lengthRounding));
        const double length = tie.piece.length / rings;
        for (double r = 0.0; r < rings; ++r) {
            const Vec3 middle = tie.rest + ((r + 0.5) * length - 0.5 * tie.piece.length) * tie.restAxis;
            addRing(tie, site, {middle, length, spacing}, index);
        }
    }

    struct RingPlace {
        Vec3 middle;
        double length, spacing;  // spacing: of the cells that hold it [m]
    };

    // A ring holds as firmly as its tissue; one that begins in another tissue than it ends in is halved. Bone does not
    // move with the rest of the rod, so neither the rod's length nor the window counts there.
    void addRing(const Tie& tie, ContactSite& site, const RingPlace& at, std::size_t index) noexcept
    {
        const double finest = body_.levels.front().nodes.spacing;
        const auto tissueOf = [&](Vec3 place) { return hasTissue(place) ? place : tie.rest; };
        const auto mu = [&](double half) {
            const Vec3 place = tissueOf(at.middle + 0.5 * half * at.length * tie.restAxis);
            return static_cast<double>(muAt(body_.levels.front(), place));
        };
        const auto [least, most] = std::minmax({mu(-1.0), mu(0.0), mu(1.0)});
        if (most > otherTissue * least && at.length > shortestRing * finest) {
            const Vec3 quarter = 0.25 * at.length * tie.restAxis;
            addRing(tie, site, {at.middle - quarter, 0.5 * at.length, at.spacing}, index);
            addRing(tie, site, {at.middle + quarter, 0.5 * at.length, at.spacing}, index);
            return;
        }
        const Vec3 onAxis = tissueOf(at.middle);
        const bool inBone = isHeld(onAxis);
        const RodRing ring = inBone ? ringOf({tie.piece.radius, at.length, endless}, mu(0.0), finest)
                                    : ringOf({tie.piece.radius, at.length, tie.piece.rod}, mu(0.0), at.spacing);
        site.stiffness = ring.along / ring.points;
        site.across = ring.across / ring.points;
        const Vec3 one = acrossOf(tie.restAxis), other = glm::cross(tie.restAxis, one);
        for (double i = 0.0; i < ring.points; ++i) {
            // Pieces are turned against each other: where cells are long, there are several rings in each.
            const double angle = 2.0 * std::numbers::pi * (i / ring.points + 0.125 * static_cast<double>(index));
            site.rest = at.middle + ring.radius * (std::cos(angle) * one + std::sin(angle) * other);
            site.anchor = hasTissue(site.rest) ? site.rest : onAxis;
            add(site, isHeld(site.anchor));
        }
    }

    // Of a site's cell: whether the next coarser window holds one of its nodes.
    bool atBorder(const ContactSite& site) const noexcept
    {
        const Window& w = windows_[site.level];
        for (int c = 0; c < 8; ++c) {
            if (w.border[w.fragments.original(w.layout.corner(site.node, c))] != 0.0F) {
                return true;
            }
        }
        return false;
    }

    void addRow(const ElasticTool& tool, const occupancy::ShapeDistance& shape, std::size_t index, std::size_t row,
                int first, int last) noexcept
    {
        for (const SurfaceCell& cell : inRow(body_.cells, body_.rows, row, first, last, &SurfaceCell::cell)) {
            if (mayTouch(shape, cell)) {
                addCell(tool, shape, index, cell);
            }
        }
    }

    bool mayTouch(const occupancy::ShapeDistance& shape, const SurfaceCell& cell) noexcept
    {
        const auto& grid = body_.levels.front().nodes;
        const Vec3 rest = grid.position(cell.cell) + 0.5 * grid.spacing;
        const double near = near_ + 1.2 * grid.spacing;
        if (shape.distance(rest) < near) {
            return true;
        }
        ContactSite middle;
        locateMiddle(body_, windows_, cell.cell, middle);
        return middle.level < windows_.size() && shape.distance(rest + gather(windows_, middle, Field::u)) < near;
    }

    void addCell(const ElasticTool& tool, const occupancy::ShapeDistance& shape, std::size_t index,
                 const SurfaceCell& cell) noexcept
    {
        const double spacing = body_.levels.front().nodes.spacing, edge = body_.pieceEdge;
        const Division all = piecesUnder(tool, spacing, edge);
        const double fine = 0.5 * smallPatch * smallPatch * spacing / tool.shape.widest();
        for (std::uint32_t i = cell.first; i < cell.first + cell.count; ++i) {
            if (count_ == out_.size()) {
                return;
            }
            const SurfacePoint& point = body_.points[i];
            ContactSite& site = *std::construct_at(&out_[count_]);
            site.rest = Vec3(point.position);
            site.anchor = Vec3(point.anchor);
            site.owner = static_cast<std::uint16_t>(index);
            site.point = i;
            site.atRest = site.stiffness = siteStiffness(body_, point, tool);
            site.area = point.area;
            const bool added = addIfNear(shape, site);
            const int pieces = all.of(i);
            if (added && pieces > 1 && static_cast<double>(point.area) > slight * edge * edge) {
                divideLast(shape, pieces, pieces > 2 ? std::min(close, fine) : close);
            }
        }
    }

    // Wider windows, which have the tissue far from the tools that are led, press with their surface alone.
    void addNode(const ElasticTool& tool, const occupancy::ShapeDistance& shape, std::size_t index,
                 const SubsurfaceNode& node) noexcept
    {
        const auto& grid = body_.levels.front().nodes;
        const Vec3 at = grid.position(node.node);
        if (count_ == out_.size() || shape.distance(at) > near_) {
            return;
        }
        ContactSite& site = *std::construct_at(&out_[count_]);
        site.rest = site.anchor = at;
        site.owner = static_cast<std::uint16_t>(index);
        site.isSubsurface = true;
        site.area = static_cast<float>(grid.spacing * grid.spacing);
        const SurfacePoint as{.position = Vec3f(at), .anchor = Vec3f(at), .area = site.area, .mu = node.mu};
        site.atRest = site.stiffness = siteStiffness(body_, as, tool);
        if (meetsTissue(site) && site.level == 0 && shape.distance(at + site.u) <= near_) {
            findLacking(body_, as, site);
            ++count_;
        }
    }

    // The surface of the sub-cell that was added last as `along` pieces along each of two edges, where it may soon touch.
    // Other sub-cells, in front of it or behind it, have the rest of the area, and are divided alike.
    // @param near  how far from the tool [cells]
    void divideLast(const occupancy::ShapeDistance& shape, int along, double near) noexcept
    {
        const ContactSite whole = out_[count_ - 1];
        if (!isNear(shape, whole, near * body_.levels.front().nodes.spacing)) {
            return;
        }
        --count_;
        const SurfacePoint& point = body_.points[whole.point];
        const Vec3 normal(point.normal);
        const Vec3 one = body_.pieceEdge / along * acrossOf(normal), other = glm::cross(normal, one);
        const int count = along * along;
        const double first = 0.5 - 0.5 * along;
        for (int i = 0; i < count; ++i) {
            const Vec3 off = (i % along + first) * one + (i / along + first) * other;
            if (count_ == out_.size()) {
                return;
            }
            ContactSite& site = out_[count_] = whole;
            site.rest += off;
            site.anchor += isOfSameTissue(site.anchor, site.anchor + off) ? off : Vec3(0.0);
            site.atRest = site.stiffness = whole.atRest / count;
            site.area = whole.area / static_cast<float>(count);
            addIfNear(shape, site);
        }
    }

    bool isHeld(Vec3 at) const noexcept
    {
        const auto& grid = body_.levels.front().nodes;
        return body_.held[grid.offset(grid.cellAt(at))] > 0.5F;
    }

    // Of two places less than a cell apart.
    bool isOfSameTissue(Vec3 one, Vec3 other) const noexcept
    {
        const CellLevel& level = body_.levels.front();
        return hasTissue(other) && shareNode(level, level.nodes.cellAt(one), level.nodes.cellAt(other));
    }

    bool hasTissue(Vec3 at) const noexcept { return muAt(body_.levels.front(), at) > 0.0F; }

    // The site at the list's end stays there where a tool is near.
    bool addIfNear(const occupancy::ShapeDistance& shape, ContactSite& site) noexcept
    {
        if (!meetsTissue(site) || !isNear(shape, site, near_)) {
            return false;
        }
        findLacking(body_, body_.points[site.point], site);
        ++count_;
        return true;
    }

    // Tissue that a tool left behind still has to find back to it.
    static bool isNear(const occupancy::ShapeDistance& shape, const ContactSite& site, double near) noexcept
    {
        return shape.distance(site.rest) <= near || shape.distance(site.rest + site.u) <= near;
    }

    // Where it is, and how it has moved. False where no window has it.
    bool meetsTissue(ContactSite& site) const noexcept
    {
        locate(body_, windows_, site.anchor, site);
        if (site.level >= windows_.size()) {
            return false;
        }
        site.u = gather(windows_, site, Field::u);
        return true;
    }

    // What is held moves with no node: the cells of wider windows may hold soft tissue beside it.
    void add(ContactSite& site, bool held = false) noexcept
    {
        if (count_ == out_.size() || !meetsTissue(site)) {
            return;
        }
        ContactSite& added = out_[count_++] = site;
        if (held) {
            added.fraction.fill(0.0F);
            added.u = Vec3(0.0);
        }
    }

    const ElasticBody& body_;
    std::span<const Window> windows_;
    double near_;  // [m]
    std::span<ContactSite> out_;
    std::size_t count_ = 0;
};

}  // namespace

double stiffestPerArea(const ElasticTool& tool) noexcept
{
    return tool.stiffest / touchedAtFirst(tool.shape.widest());
}

double stiffnessUncapped(const ElasticBody& body, double radius) noexcept
{
    const CellLevel& finest = body.levels.front();
    float mu = 0.0F;
    for (const SurfacePoint& p : body.points) {
        const Index3 node(glm::round((Vec3(p.anchor) - finest.nodes.origin) / finest.nodes.spacing));
        const bool isFixed = finest.nodes.contains(node) && finest.fixed[finest.nodes.offset(node)] != 0;
        mu = isFixed ? mu : std::max(mu, p.mu);
    }
    return std::max(ElasticTool().stiffest, penalty * youngsModulusOf(mu) / finest.nodes.spacing * touchedAtFirst(radius));
}

double touchedBy(const occupancy::RoundCone& shape, double spacing) noexcept
{
    const double reach = shape.widest() + 3.0 * spacing;
    return 2.0 * std::numbers::pi * reach * (2.0 * reach + glm::distance(shape.a, shape.b));
}

std::size_t sitesFor(const ElasticBody& body, double area, std::size_t least) noexcept
{
    constexpr double sides = 2.0, quarters = 1024.0;  // what few points near a small patch are more, as four each
    double whole = 0.0;
    for (const SurfacePoint& p : body.points) {
        whole += static_cast<double>(p.area);
    }
    const double share = whole > 0.0 ? std::min(sides * area / whole, 1.0) : 0.0;
    const std::size_t all = body.points.size() + body.subsurface.size();
    return std::max(least, static_cast<std::size_t>(share * static_cast<double>(all) + quarters));
}

std::size_t findSites(const ElasticBody& body, std::span<const Window> windows, std::span<const ElasticTool> tools,
                      std::span<const occupancy::ShapeDistance> shapes, std::span<const PressedBox> pressed, double near,
                      std::span<ContactSite> out) noexcept
{
    Finder finder(body, windows, near, out);
    for (std::size_t i = 0; i < tools.size(); ++i) {
        finder.addTool(tools[i], shapes[i], i < pressed.size() ? pressed[i] : PressedBox(), i);
    }
    for (std::size_t i = 0; i < tools.size(); ++i) {
        finder.addSubsurface(tools[i], shapes[i], i);
    }
    return finder.count();
}

std::size_t findTies(const ElasticBody& body, std::span<const Window> windows, std::span<const Tie> ties,
                     std::span<ContactSite> out) noexcept
{
    Finder finder(body, windows, 0.0, out);
    for (std::size_t i = 0; i < ties.size(); ++i) {
        finder.addTie(ties[i], i);
    }
    return finder.count();
}

}  // namespace palpate::chainmail
