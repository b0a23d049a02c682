// The sites of Elastic: which points meet the tools, and how they move with them.
#include <chainmail/elastic.h>
#include <chainmail/rod.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

namespace palpate::chainmail {

namespace {

constexpr double reach = 0.6;         // spacings from a tool within which surface points are looked at
constexpr double drift = 0.25;        // spacings that a tool may move until they are looked for again
constexpr int stillPeriod = 64;       // calls after which they are beside ties, which drag tissue to a tool that rests
constexpr double smallTool = 1.5;     // radius, in cells, up to which cells lack less the deeper a tool is in its radii
constexpr double lacksNothing = 4.0;  // radius of a patch, in cells: taken where a tool's depth is not known

// How many sites ties take, at most.
std::size_t placesOf(std::span<const Tie> ties, double spacing) noexcept
{
    double sum = 0.0;
    for (const Tie& tie : ties) {
        sum += tie.piece.isRod() ? maxRingPoints * (1.0 + std::ceil(tie.piece.length / spacing)) : 1.0;
    }
    return static_cast<std::size_t>(sum);
}

// The way of a tool's material point at `at` when the tool moves by the least turn of its axis.
Vec3 wayOf(Vec3 at, const occupancy::RoundCone& from, const occupancy::RoundCone& to) noexcept
{
    const Vec3 way = to.a - from.a, before = from.b - from.a, after = to.b - to.a;
    return before == after ? way : way + turnedWay(at - from.a, glm::normalize(before), glm::normalize(after));
}

// A ball of few cells is deep in its radii when its patch is as wide as a cell, and what cells lack then varies between
// nodes as under a narrower patch: by this factor, measured with balls of 1.25 to 1.75 cells on 12 to 40 mm of fat on bone.
// Balls of 5 cells were measured for ResolvedShare. What confines tissue and widens the patch counts half. Cells at small
// strain need none of it.
double narrowing(const ElasticTool& tool, double byForce, double spacing) noexcept
{
    constexpr double measured = 5.0, less = 0.4;
    const double byDepth = radiusOfPatch(tool);
    const double narrow =
        std::sqrt(byDepth / byForce) *
        std::min((1.0 + less * byDepth / (measured * spacing)) / (1.0 + less * byDepth / tool.shape.widest()), 1.0);
    return glm::mix(narrow, 1.0, wrapping(tool));
}

// What a tool's contacts in one window have in common.
class Pressure {
public:
    Pressure(const ElasticTool& tool, const HeldTool& held, const ElasticBody& body, std::size_t level,
             bool isSmall) noexcept
        : isFinest_(level == 0), most_(stiffestPerArea(tool)), share_(lacksNothing, lacksNothing, Between())
    {
        const auto& grid = body.levels[level].nodes;
        const double byDepth = radiusOfPatch(tool), now = held.changed();
        const bool knowsForce = isFinest_ && !body.relaxes;
        const double byForce =
            knowsForce ? radiusOfPatch(tool, now * held.load, now * held.indented, now * held.onEnds) : byDepth;
        const double deep = glm::length(tool.pushed) / tool.shape.widest();  // [radii]
        const double small = std::min(smallTool * grid.spacing / tool.shape.widest(), 1.0);
        lessDeep_ = isFinest_ && !isSmall ? 1.0 / (1.0 + 0.6 * small * small * deep) : 1.0;
        confined_ = byForce > byDepth ? std::pow(byForce / byDepth, std::max(1.0 - deep, 0.0)) : 1.0;
        if (byDepth > 0.0) {
            const double cells = byForce / grid.spacing;
            const double between = isFinest_ && !isSmall ? cells * narrowing(tool, byForce, grid.spacing) : cells;
            share_ = ResolvedShare(cells, between, betweenNodes(grid, tool));
        }
    }

    // Stiffness of a site where the surface is stretched as now.
    void spread(ContactSite& s, const Stretch& now, float sliver) const noexcept
    {
        const double share = share_({lessDeep_ * static_cast<double>(s.lacks), static_cast<double>(s.compressible),
                                     isFinest_ ? static_cast<double>(sliver) : 0.0});
        s.resolved = isFinest_ ? 1.0F : static_cast<float>(share);
        const double bound = most_ * static_cast<double>(s.area);
        const double atRest = std::max(s.atRest, std::min(confined_ * s.atRest, bound));
        s.stiffness = share * now.area * std::min(now.modulus * atRest, stiffened * bound);
    }

private:
    bool isFinest_;
    double most_;      // stiffness per area
    double lessDeep_;  // times what cells lack
    double confined_;  // times the stiffness
    ResolvedShare share_;
};

// Contacts press on the area that the tissue has now, as stiffly as it is now, and are softer while a tool touches
// less than the cells of a window resolve, by Hertz's radius of what it touches, and a small tool the less so the deeper
// it is in its radii (decisions 321, 334). Tissue that something rigid confines gives way less under the same pressure, by
// f^(1/3) where it bears f times what a half-space would at this depth, and so may they: that is by how much the patch is
// wider. Hertz's law is no measure of it deeper than a radius. Wider windows, whose force on a small patch may be
// twice too large, and tissue that relaxes, whose force falls while it lies as before, take the patch by the depth.
// All this is kept while a call solves, so that a call keeps one energy.
class Pressures {
public:
    Pressures(const WindowStack& stack, const volume::Law& law, std::span<const ElasticTool> tools,
              std::span<const HeldTool> held) noexcept
        : body_(stack.body()), tools_(tools), held_(held), isSmall_(volume::isSmall(law)), stretchAt_(stack, law)
    {
    }

    // Stiffness of a point that a tool may press. Surface points of a tool in one window follow each other.
    void spread(ContactSite& s) noexcept
    {
        if (s.isSubsurface) {
            const double most = stiffened * stiffestPerArea(tools_[s.owner]) * static_cast<double>(s.area);
            s.stiffness = std::min((isSmall_ ? 1.0 : stretchAt_(s).modulus) * s.atRest, most);
            return;
        }
        if (s.owner != owner_ || s.level != level_) {
            owner_ = s.owner;
            level_ = s.level;
            under_.emplace(tools_[s.owner], held_[s.owner], body_, s.level, isSmall_);
        }
        // What moved last was measured then.
        const Stretch now = isSmall_          ? Stretch{}
                            : s.stretch > 0.0 ? Stretch{s.stretch, static_cast<double>(s.stiffer)}
                                              : stretchAt_(s);
        under_->spread(s, now, body_.points[s.point].sliver);
    }

private:
    const ElasticBody& body_;
    std::span<const ElasticTool> tools_;
    std::span<const HeldTool> held_;
    bool isSmall_;
    StretchAt stretchAt_;
    std::optional<Pressure> under_;
    std::size_t owner_ = ElasticLoad::noTool, level_ = 0;
};

}  // namespace

// The tools, held back where the body does not bear them.
std::span<const ElasticTool> Elastic::heldTools(std::span<const ElasticTool> tools, bool holdsBack) noexcept
{
    held_.resize(tools.size());
    tools_.clear();
    for (std::size_t i = 0; i < tools.size(); ++i) {
        tools_.push_back(held_[i].place(tools[i], stack_.body(), volume::isSmall(options_.law), holdsBack));
    }
    return tools_;
}

// True when the surface points found for an earlier call still serve: no tool moved far.
bool Elastic::sitesHold(std::span<const ElasticTool> tools) const noexcept
{
    if (atRest_ || tools.size() != foundFor_.size()) {
        return false;
    }
    const double spacing = stack_.body().levels.front().nodes.spacing, far = drift * spacing;
    const double edge = stack_.body().pieceEdge;
    for (std::size_t i = 0; i < foundFor_.size(); ++i) {
        const auto& now = tools[i].shape;
        const auto& [then, pieces] = foundFor_[i];
        if (glm::distance(now.a, then.a) > far || glm::distance(now.b, then.b) > far || now.radiusA != then.radiusA ||
            now.radiusB != then.radiusB || !stillServes(pieces, tools[i], spacing, edge)) {
            return false;
        }
    }
    return true;
}

bool Elastic::tiesHold(std::span<const Tie> ties) const noexcept
{
    return std::ranges::equal(ties, tiesFound_, [](const Tie& a, const Tie& b) { return a.holdsAs(b); });
}

// Finds the points that tools may touch, and behind them in the list the ties: a needle that goes on has other ones in
// every call, and a probe beside it the same points.
void Elastic::findSitesOf(const ElasticLoad& load, bool moved) noexcept
{
    bool toolsHold = !moved && sitesHold(load.tools);
    ++sinceFound_;
    if (toolsHold && tiesHold(load.ties)) {
        return;
    }
    toolsHold = toolsHold && (load.tools.empty() || sinceFound_ < stillPeriod);
    const double spacing = stack_.body().levels.front().nodes.spacing;
    std::size_t fresh = touching_;  // the first site that is new
    if (!toolsHold) {
        pressed_.assign(held_.size(), PressedBox());
        keepSlips();
        for (const ContactSite& s : sites()) {
            if (!s.isTie && s.active() && s.owner < pressed_.size()) {
                pressed_[s.owner].add(s.rest);
            }
        }
        fresh = 0;
        sinceFound_ = 0;
        const std::size_t room = sites_.size() - std::min(sites_.size(), placesOf(load.ties, spacing));
        touching_ = findSites(stack_.body(), stack_.windows(), load.tools, shapes_, pressed_, reach * spacing,
                              std::span(sites_).first(room));
        foundFor_.clear();
        for (const ElasticTool& tool : load.tools) {
            foundFor_.push_back({tool.shape, piecesUnder(tool, spacing, stack_.body().pieceEdge)});
        }
    }
    siteCount_ = touching_ + findTies(stack_.body(), stack_.windows(), load.ties, std::span(sites_).subspan(touching_));
    tiesFound_.assign(load.ties.begin(),
                      load.ties.begin() + static_cast<std::ptrdiff_t>(std::min(load.ties.size(), maxTies)));
    takeSlips(active().subspan(fresh));
}

void Elastic::keepSlips() noexcept
{
    slips_.clear();
    for (const ContactSite& s : sites()) {
        if (!s.isTie && !s.isSubsurface) {
            slips_.push_back({s.point, s.owner, Vec3f(s.rest), Vec3f(s.slip), static_cast<float>(s.limit)});
        }
    }
}

// Points are held as they were before, or not; a piece of a point as the piece that was nearest to it.
void Elastic::takeSlips(std::span<ContactSite> found) noexcept
{
    auto first = slips_.cbegin();
    for (ContactSite& s : found) {
        if (frictionOf(s) <= 0.0) {
            continue;
        }
        const auto of = std::pair(s.owner, s.point);
        first = std::find_if(first, slips_.cend(), [&](const Slip& k) { return std::pair(k.owner, k.point) >= of; });
        const auto last =
            std::find_if(first, slips_.cend(), [&](const Slip& k) { return std::pair(k.owner, k.point) != of; });
        const auto nearest = std::min_element(first, last, [&](const Slip& a, const Slip& b) {
            return glm::distance(Vec3(a.rest), s.rest) < glm::distance(Vec3(b.rest), s.rest);
        });
        if (nearest != last) {
            s.slip = Vec3(nearest->way);
            s.limit = static_cast<double>(nearest->limit);
        }
    }
}

void Elastic::meet(const ElasticLoad& load, bool moved) noexcept
{
    shapes_.clear();
    for (const ElasticTool& tool : load.tools) {
        shapes_.emplace_back(tool.shape);
    }
    ties_ = load.ties;
    findSitesOf(load, moved);
    slides_ = std::ranges::any_of(load.tools, [](const ElasticTool& tool) { return tool.friction > 0.0; });
    // Tools that moved on take the points that they hold along.
    const bool drags = slides_ && toolAt_.size() == load.tools.size();
    Pressures pressures(stack_, options_.law, tools_, held_);
    touchAll([&](ContactSite& s) {
        if (!s.isTie) {
            if (drags) {
                s.slip += wayOf(s.rest + s.u, toolAt_[s.owner], load.tools[s.owner].shape);
            }
            pressures.spread(s);
        }
        touch(s, shapes_, ties_);
        if (const double friction = frictionOf(s); friction > 0.0 && s.limit <= 0.0) {
            s.limitBy(friction);
            press(s);
        }
    });
    toolAt_.clear();
    for (const ElasticTool& tool : load.tools) {
        toolAt_.push_back(tool.shape);
    }
}

// True when a tool is inside the tissue, as it lies or as it would lie at rest.
bool Elastic::touched() const noexcept
{
    const auto all = sites();
    return std::any_of(all.begin(), all.end(),
                       [&](const ContactSite& s) { return s.active() || shapes_[s.owner].distance(s.rest) < 0.0; });
}

void Elastic::moveSites(double length) noexcept
{
    touchAll([&](ContactSite& s) {
        s.u += length * s.p;
        if (slides_) {
            s.slip -= length * s.p;
        }
        touch(s, shapes_, ties_);
    });
}

// Beyond what friction holds by the contact's own force the tool has slipped, for good.
void Elastic::letSlip() noexcept
{
    if (!slides_) {
        return;
    }
    touchAll([&](ContactSite& s) {
        const double friction = frictionOf(s);
        if (friction <= 0.0) {
            return;
        }
        s.limitBy(friction);
        const Vec3 along = s.along();
        const double length = glm::length(along);
        s.slip = length > s.limit ? s.limit / length * along : along;
        press(s);
    });
}

double Elastic::frictionOf(const ContactSite& site) const noexcept
{
    return site.isTie || site.isSubsurface ? 0.0 : tools_[site.owner].friction;
}

}  // namespace palpate::chainmail
