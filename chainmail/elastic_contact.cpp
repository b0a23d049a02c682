#include <chainmail/elastic_contact.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate::chainmail {

namespace {

// Compliance that cells lack under a patch, in h / E per area: its mean over places in the grid, and by how much it grows
// with what betweenNodes() says. Smaller patches count as the first.
struct LackingAt {
    double radius = 0;  // of the patch, in cells
    double mean = 0;
    double sum = 0;
    double square = 0;
    double product = 0;
};
constexpr std::array<LackingAt, 21> lacking{
    {{0.15, 0.102, 0.07, 0.31, -0.25},     {0.2, 0.162, 0.16, 0.79, -0.72},      {0.25, 0.170, 0.15, 1.07, -0.81},
     {0.3, 0.178, 0.15, 1.44, -0.85},      {0.35, 0.185, 0.18, 1.59, -1.05},     {0.4, 0.178, 0.13, 1.74, -0.92},
     {0.45, 0.176, 0.17, 1.73, -1.06},     {0.5, 0.167, 0.15, 1.62, -0.90},      {0.6, 0.150, 0.10, 1.42, -0.72},
     {0.7, 0.129, 0.02, 1.05, -0.45},      {0.8, 0.110, -0.01, 0.36, -0.06},     {0.9, 0.093, 0.02, -0.24, -0.05},
     {1.0, 0.075, -0.04, -0.45, 0.22},     {1.1, 0.060, -0.05, -0.55, 0.30},     {1.25, 0.042, -0.06, -0.15, 0.21},
     {1.4, 0.029, -0.084, 0.367, 0.046},   {1.5, 0.021, 0.011, 0.434, -0.114},   {1.6, 0.0154, 0.054, 0.386, -0.129},
     {1.75, 0.007, -0.026, 0.604, -0.068}, {1.9, 0.0028, -0.013, 0.111, -0.103}, {2.0, 0.0, 0.0, 0.0, 0.0}}};

LackingAt lackingAt(double radius) noexcept
{
    const auto above = std::lower_bound(lacking.begin() + 1, lacking.end() - 1, radius,
                                        [](const LackingAt& l, double r) { return l.radius < r; });
    const LackingAt &to = *above, &from = *(above - 1);
    const double t = std::clamp((radius - from.radius) / (to.radius - from.radius), 0.0, 1.0);
    const auto at = [&](double LackingAt::*value) { return glm::mix(from.*value, to.*value, t); };
    return {radius, at(&LackingAt::mean), at(&LackingAt::sum), at(&LackingAt::square), at(&LackingAt::product)};
}

// Cosine between a capsule and its way up to which it lies: what is small then is a strip, of many points.
constexpr double steep = 0.7;
// Radius of a patch, in cells, up to which surface points lie as close to each other as that, in cells.
struct Closeness {
    double radius, apart;
};
constexpr std::array<Closeness, 2> closeness{{{0.75, 0.13}, {1.75, 0.35}}};
constexpr double slightly = 1e-6;
constexpr double minRatio = 0.3;  // of areas: bounds far beyond what tissue bears
constexpr double maxRatio = 30.0;
constexpr double maxStiffer = 100.0;

}  // namespace

double radiusOfPatch(const ElasticTool& tool) noexcept
{
    return std::sqrt(tool.shape.widest() * glm::length(tool.pushed));
}

double radiusOfPatch(const ElasticTool& tool, double load, double indented, double onEnds) noexcept
{
    const double byDepth = radiusOfPatch(tool), round = load > 0.0 ? 2.0 * onEnds / load - 1.0 : 0.0;
    if (!(byDepth > 0.0) || round <= 0.0) {
        return byDepth;
    }
    const double byForce = std::min(std::cbrt(0.75 * tool.shape.widest() * load * load / indented), 2.0 * byDepth);
    return round < 1.0 ? byDepth * std::pow(byForce / byDepth, round) : byForce;
}

bool isOnEnd(const occupancy::RoundCone& shape, Vec3 normal) noexcept
{
    constexpr double rounding = 1e-9;  // [m]
    return shape.a == shape.b || std::abs(glm::dot(normal, shape.b - shape.a) + shape.radiusB - shape.radiusA) > rounding;
}

double wrapping(const ElasticTool& tool) noexcept
{
    return std::clamp(5.0 * glm::length(tool.pushed) / tool.shape.widest() - 2.0, 0.0, 1.0);
}

int Division::of(std::uint32_t point) const noexcept
{
    constexpr std::uint32_t golden = 2654435769U;  // of 2^32: points beside each other are in different parts
    return static_cast<int>((point * golden) >> 28U) < whole ? 1 : along;
}

bool Division::servesFor(const Division& other) const noexcept
{
    const auto isOne = [](const Division& d) { return d.along == 1 || d.whole == parts; };
    return (isOne(*this) && isOne(other)) || (along == other.along && std::abs(whole - other.whole) <= 1);
}

Division piecesUnder(const ElasticTool& tool, double spacing, double edge, double share) noexcept
{
    if (tool.pushed == Vec3(0.0)) {
        return {};
    }
    const double patch = share * radiusOfPatch(tool) / spacing;
    const Vec3 axis = tool.shape.b - tool.shape.a;
    const bool lies = glm::length(axis) > radiusOfPatch(tool) &&
                      std::abs(glm::dot(axis, tool.pushed)) < steep * glm::length(axis) * glm::length(tool.pushed);
    const auto* const found = std::find_if(closeness.begin() + (lies ? 1 : 0), closeness.end(),
                                           [&](const Closeness& c) { return patch < c.radius; });
    const int along = found == closeness.end() ? 1 : static_cast<int>(std::ceil(edge / (found->apart * spacing)));
    return {along, static_cast<int>(Division::parts * wrapping(tool))};
}

// A hand that trembles does not have points looked for in each tick.
bool stillServes(const Division& found, const ElasticTool& tool, double spacing, double edge) noexcept
{
    constexpr double beyond = 1.03;  // of a patch: 6 % of a depth
    return found.servesFor(piecesUnder(tool, spacing, edge, 1.0 / beyond)) ||
           found.servesFor(piecesUnder(tool, spacing, edge, beyond));
}

namespace {

// Lowest node of a window's cell, or of the fragment of it in which a cell of the finest level lies.
std::uint32_t nodeOf(const ElasticBody& body, std::span<const Window> windows, std::size_t level, Index3 cell,
                     Index3 finest) noexcept
{
    if (!body.levels[level].fragments.cells.empty()) {
        const std::uint32_t fragment = fragmentAt(body, level, finest);
        const std::uint32_t node = fragment != noFragment ? windows[level].fragments.nodeOf(fragment) : noFragment;
        if (node != noFragment) {
            return node;
        }
    }
    return static_cast<std::uint32_t>(windows[level].at(cell));
}

}  // namespace

void locate(const ElasticBody& body, std::span<const Window> windows, Vec3 rest, ContactSite& site) noexcept
{
    for (std::size_t l = 0; l < windows.size(); ++l) {
        const auto& grid = body.levels[l].nodes;
        const Vec3 at = (rest - grid.origin) / grid.spacing;
        const Index3 cell(glm::floor(at));
        if (!windows[l].contains(cell) || !windows[l].contains(cell + 1)) {
            continue;
        }
        const int scale = 1 << l;
        const auto& finest = body.levels.front().nodes;
        const Index3 in = finest.cellAt(rest);
        site.fraction = trilinear(at - Vec3(cell));
        site.node = nodeOf(body, windows, l, cell, glm::clamp(in, scale * cell, scale * cell + scale - 1));
        site.level = static_cast<std::uint16_t>(l);
        return;
    }
    site.level = static_cast<std::uint16_t>(windows.size());
}

void locateMiddle(const ElasticBody& body, std::span<const Window> windows, Index3 cell, ContactSite& site) noexcept
{
    for (std::size_t l = 0; l < windows.size(); ++l) {
        const int scale = 1 << l;
        const Index3 low = cell / scale;
        if (windows[l].contains(low) && windows[l].contains(low + 1)) {
            site.fraction = trilinear((Vec3(cell - scale * low) + 0.5) / static_cast<double>(scale));
            site.node = nodeOf(body, windows, l, low, cell);
            site.level = static_cast<std::uint16_t>(l);
            return;
        }
    }
    site.level = static_cast<std::uint16_t>(windows.size());
}

Stretch StretchAt::operator()(const ContactSite& site) noexcept
{
    if (site.node != node_ || site.level != level_) {
        node_ = site.node;
        level_ = site.level;
        const Window& w = stack_.windows()[site.level];
        const double quarter = 0.25 / stack_.body().levels[site.level].nodes.spacing;
        std::array<Vec3, 3> f{Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)};
        const Vec3 middle(w.cuts.at(site.node).middle);
        for (int c = 0; c < 8; ++c) {
            const Vec3 side(sideOf(c));
            const Vec3 at = 1.0 + side * middle;
            const Vec3 u = quarter * w.value(Field::u, w.layout.corner(site.node, c));
            f[0] += side.x * at.y * at.z * u;
            f[1] += side.y * at.z * at.x * u;
            f[2] += side.z * at.x * at.y * u;
        }
        cofactor_ = {glm::cross(f[1], f[2]), glm::cross(f[2], f[0]), glm::cross(f[0], f[1])};
        const double change = glm::dot(f[0], cofactor_[0]) - 1.0;
        const double square = glm::dot(f[0], f[0]) + glm::dot(f[1], f[1]) + glm::dot(f[2], f[2]);
        const auto b = static_cast<double>(w.stiffening[site.node]);
        const double i = volume::isochoric(square - 3.0 - 2.0 * change, change).i;
        const auto beyond = volume::beyond(law_, 1.0, b, i);
        modulus_ = 1.0 + beyond.slope;
    }
    if (site.isSubsurface) {
        return {1.0, std::min(modulus_, maxStiffer)};
    }
    const Vec3 n(stack_.body().points[site.point].normal);
    const Vec3 area = n.x * cofactor_[0] + n.y * cofactor_[1] + n.z * cofactor_[2];
    return {std::clamp(glm::length(area), minRatio, maxRatio), std::min(modulus_, maxStiffer)};
}

Between betweenNodes(const volume::NodeGrid& grid, const ElasticTool& tool) noexcept
{
    const Between mean;
    const double depth = glm::length(tool.pushed);
    if (depth <= 0.0) {
        return mean;
    }
    const Vec3 inward = tool.pushed / depth;
    const Vec3 a = tool.shape.a + tool.shape.radiusA * inward, b = tool.shape.b + tool.shape.radiusB * inward;
    const double ahead = glm::dot(a - b, inward);
    const Vec3 place = glm::fract(((ahead < 0.0 ? b : a) - tool.pushed - grid.origin) / grid.spacing);
    const Vec3 f = place * (1.0 - place), across = 1.0 - inward * inward;
    // A capsule presses as a ball does where it stands on its end, and where it is short beside its patch.
    const Vec3 lying = a - b - ahead * inward;
    const double isRound =
        std::clamp(std::max(std::abs(ahead) / depth, 1.0 - glm::length(lying) / radiusOfPatch(tool)), 0.0, 1.0);
    // What was measured is a ball on a half-space: less so from half a radius on, and no more at a radius.
    const double known = isRound * std::clamp(2.0 - 2.0 * depth / tool.shape.widest(), 0.0, 1.0);
    const double sum = glm::dot(across, f), square = glm::dot(across, f * f);
    return {glm::mix(mean.sum, sum, known), glm::mix(mean.square, square, known),
            glm::mix(mean.product, 0.5 * (sum * sum - square), known)};
}

ResolvedShare::ResolvedShare(double radiusInCells, double between, const Between& across) noexcept
{
    const Between mean;
    const LackingAt even = lackingAt(radiusInCells), uneven = lackingAt(between);
    mean_ = even.mean;
    uneven_ = uneven.sum * (across.sum - mean.sum) + uneven.square * (across.square - mean.square) +
              uneven.product * (across.product - mean.product);
    const double fades = std::max(0.5 * radiusInCells, 1.0);
    compressible_ = 0.6 * std::min(4.0 * radiusInCells, 1.0) / (fades * fades * fades * fades);
    sliver_ = std::min(2.0 * radiusInCells, 1.0);
}

double ResolvedShare::operator()(const Lacking& lacking) const noexcept
{
    const double soft = std::max(mean_ + (1.0 + 1.2 * lacking.compressible) * uneven_, 0.0);
    const double c = lacking.times * (soft + compressible_ * lacking.compressible) + sliver_ * lacking.sliver;
    return 1.0 / (1.0 + penalty * c);
}

Vec3 ValueAt::operator()(const ContactSite& site) noexcept
{
    if (site.node != node_ || site.level != level_) {
        node_ = site.node;
        level_ = site.level;
        const Window& w = windows_[site.level];
        for (std::size_t c = 0; c < nodes_.size(); ++c) {
            nodes_[c] = w.value(field_, w.layout.corner(site.node, static_cast<int>(c)));
        }
    }
    Vec3 sum(0.0);
    for (std::size_t c = 0; c < nodes_.size(); ++c) {
        sum += static_cast<double>(site.fraction[c]) * nodes_[c];
    }
    return sum;
}

namespace {

// Of a spring that gives way at `limit`.
double frictionEnergy(double stiffness, double stretch, double limit) noexcept
{
    const double held = std::min(stretch, limit);
    return stiffness * held * (stretch - 0.5 * held);
}

void addFriction(const ContactSite& s, double alpha, Along& sum) noexcept
{
    const Vec3 side = s.p - glm::dot(s.p, s.normal) * s.normal;
    const Vec3 stretch = s.along() - alpha * side;
    const double length = glm::length(stretch);
    const double held = length > 0.0 ? std::min(s.limit / length, 1.0) : 1.0;
    const double rate = glm::dot(stretch, side);
    const double turning = length < s.limit ? 0.0 : rate * rate / (length * length);
    sum.slope -= s.grip() * held * rate;
    sum.curvature += s.grip() * held * (glm::dot(side, side) - turning);
}

}  // namespace

void touch(ContactSite& site, std::span<const occupancy::ShapeDistance> shapes, std::span<const Tie> ties) noexcept
{
    if (site.isTie) {
        const Vec3 stretch = ties[site.owner].pulled(site.rest) - site.u;
        site.force = site.resist(stretch);
        site.energy = 0.5 * glm::dot(site.force, stretch);
        return;
    }
    const auto at = shapes[site.owner].sample(site.rest + site.u);
    site.depth = -at.distance;
    site.normal = at.gradient;
    press(site);
}

void press(ContactSite& site) noexcept
{
    const double push = site.stiffness * std::max(site.depth, 0.0);
    site.force = push * site.normal;
    site.energy = 0.5 * push * site.depth;
    if (site.limit <= 0.0) {
        return;
    }
    const Vec3 along = site.along();
    const double length = glm::length(along);
    const double held = std::min(length, site.limit);
    site.force += held > 0.0 ? site.grip() * held / length * along : Vec3(0.0);
    site.energy += frictionEnergy(site.grip(), length, site.limit);
}

void Along::add(const ContactSite& s, double alpha) noexcept
{
    if (s.isTie) {
        const Vec3 resisted = s.resist(s.p);
        const double along = glm::dot(resisted, s.p);
        const double start = -glm::dot(s.force, s.p);
        slope += start + along * alpha;
        curvature += along;
        return;
    }
    const double rate = -glm::dot(s.normal, s.p);
    const double depth = std::max(s.depth + alpha * rate, 0.0);
    const double push = s.stiffness * depth;
    slope += push * rate;
    curvature += depth > 0.0 ? s.stiffness * rate * rate : 0.0;
    if (s.limit > 0.0) {
        addFriction(s, alpha, *this);
    }
}

Along contactsAlong(std::span<const ContactSite> sites, double alpha) noexcept
{
    Along sum;
    for (const ContactSite& s : sites) {
        sum.add(s, alpha);
    }
    return sum;
}

Vec3 turnedWay(Vec3 off, Vec3 from, Vec3 to) noexcept
{
    const Vec3 turn = glm::cross(from, to), once = glm::cross(turn, off);
    const double cosine = glm::dot(from, to);
    return cosine > -1.0 + slightly ? once + glm::cross(turn, once) / (1.0 + cosine) : Vec3(0.0);
}

Vec3 Tie::pulled(Vec3 at) const noexcept
{
    const Vec3 off = at - rest;
    if (!piece.isRod() || axis == restAxis) {
        return u;
    }
    return u + turnedWay(off, restAxis, axis);
}

bool Tie::holdsAs(const Tie& other) const noexcept
{
    return rest == other.rest && axis == other.axis && along == other.along && across == other.across &&
           piece == other.piece && restAxis == other.restAxis;
}

}  // namespace palpate::chainmail
