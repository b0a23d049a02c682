#include <chainmail/level.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::chainmail {

namespace {

constexpr double shaftPiece = 4e-3;      // of the shaft that one tie stands for, at least [m]
constexpr double tieStiffness = 8.0;     // of a held point, in E h: stiff beside the tissue, soft enough to converge fast
constexpr float minShown = 20e-6F;       // displacements below are not carried to the outer lattice [m]
constexpr int nearNodes = 4;             // nodes to each side of the tool that every call writes
constexpr int layersPerCall = 4;         // of the finest window, beside those
constexpr int turnsPerCall = 128;        // nodes of the outer lattice per call and window
constexpr int turnsAtRest = 512;         // the same, when all go back to rest
constexpr std::size_t windowsShown = 3;  // the finest, and two by turns
constexpr float minVolume = 0.05F;       // of a cell that still counts as not inverted, fraction of its volume at rest
constexpr std::array<float, 4> fractions{1.0F, 0.5F, 0.25F, 0.0F};

// Means over the eight nodes of each of `count` cells in a row, from that of the lowest node `at` on.
void cellMeans(const Window& window, std::size_t at, std::size_t count, Vec3f* out) noexcept
{
    const Layout& l = window.layout;
    for (int c = 0; c < 3; ++c) {
        const float* f = window.field(Field::u) + static_cast<std::size_t>(c) * l.count + at;
        for (std::size_t i = 0; i < count; ++i) {
            const float low = f[i] + f[i + 1] + f[i + l.row] + f[i + l.row + 1];
            const float high = f[i + l.plane] + f[i + l.plane + 1] + f[i + l.plane + l.row] + f[i + l.plane + l.row + 1];
            out[i][c] = 0.125F * (low + high);
        }
    }
}

// Of the links that begin in a row of `count` floats with neighbours `row` and `plane` floats on: the longest shift.
float longestLink(const float* from, std::size_t count, std::size_t row, std::size_t plane) noexcept
{
    float longest = 0.0F;
    for (std::size_t i = 0; i < count; ++i) {
        const float x = std::abs(from[i + 3] - from[i]);
        const float y = std::abs(from[i + row] - from[i]);
        const float z = std::abs(from[i + plane] - from[i]);
        const float most = x > y ? x : y;
        const float further = most > z ? most : z;
        longest = further > longest ? further : longest;
    }
    return longest;
}

float largest(Vec3f v) noexcept
{
    return glm::max(glm::max(std::abs(v.x), std::abs(v.y)), std::abs(v.z));
}

}  // namespace

Reaction SpringLevel::deform(const Grip&) noexcept
{
    for (int i = 0; i < turnsAtRest && !shape_.moved().empty(); ++i) {
        shape_.set(shape_.moved().back(), Vec3f(0.0F));
    }
    return {static_cast<std::uint32_t>(shape_.moved().size()), 0.0, std::nullopt};
}

ChainMailLevel::ChainMailLevel(Deformation& deformation, double toolRadius)
    : deformation_(deformation), seeds_(maxPressSeeds(deformation.shape().lattice(), toolRadius))
{
}

Reaction ChainMailLevel::deform(const Grip& grip) noexcept
{
    const Lattice& lattice = deformation_.shape().lattice();
    const Vec3 pushed = grip.position - grip.proxy;
    std::size_t count = 0;
    Yield yield(0.0F);
    if (grip.kind == Grip::Kind::press) {
        count = pressSeeds(lattice, grip.proxy + grip.deepest, grip.position + grip.deepest, grip.shape.radiusA, seeds_);
        yield = Yield(glm::normalize(pushed));
    } else if (grip.kind == Grip::Kind::point && grip.inside) {
        count = dragSeeds(lattice, grip.proxy, pushed, seeds_);
    } else if (grip.kind == Grip::Kind::point) {
        // The tip that presses is a ball of its own radius, with the held point in front.
        const Vec3 back = -grip.radius * glm::normalize(pushed);
        count = pressSeeds(lattice, grip.proxy + back, grip.position + back, grip.radius, seeds_);
        yield = Yield(glm::normalize(pushed));
    }
    const auto result = deformation_.deform(std::span(seeds_).first(count), yield);
    return {static_cast<std::uint32_t>(deformation_.moved().size()), result.residual, std::nullopt};
}

ElasticLevel::ElasticLevel(DisplacedLattice& shape, const ElasticBody& body, const volume::DistanceField& surface,
                           const ElasticOptions& options, Vec3 start)
    : shape_(shape),
      surface_(surface),
      elastic_(body, options, focusAt(surface, start)),
      period_(options.heldPeriod),
      turns_(body.levels.size(), Index3(0))
{
    const Index3 size = elastic_.stack().windows().front().size();
    const std::size_t cells = base::countOf(size);
    strained_.assign(shape.u().size(), 0);
    before_.resize(cells);
    now_.resize(cells);
    longRows_.resize(static_cast<std::size_t>(size.y + 2) * static_cast<std::size_t>(size.z + 2));
}

ElasticLoad ElasticLevel::load(const Grip& grip) noexcept
{
    const std::size_t others = std::min(grip.others.size(), maxOthers);
    std::copy_n(grip.others.begin(), others, tools_.begin());
    ElasticLoad load{{}, {}, focusAt(surface_, grip.position)};
    if (grip.kind == Grip::Kind::press) {
        ElasticTool& tool = tools_[others];
        tool.shape = grip.shape;
        tool.pushed = grip.position - grip.proxy;
        tool.friction = grip.friction;
        const Vec3 at = grip.proxy + grip.deepest;
        const Vec3 under = at - surface_.distance(at) * surface_.normal(at);
        load.focus = focusAt(surface_, under);
        load.led = others;
    } else if (grip.kind == Grip::Kind::point) {
        load = tie(grip);
    }
    load.tools = std::span(tools_).first(others + (grip.kind == Grip::Kind::press ? 1 : 0));
    return load;
}

double tieStiffnessAt(const ElasticBody& body, Vec3 rest) noexcept
{
    const CellLevel& level = body.levels.front();
    return tieStiffness * youngsModulusOf(muAt(level, rest)) * level.nodes.spacing;
}

// The tip holds its point in all directions, and so does the shaft the tissue that it carries along.
ElasticLoad ElasticLevel::tie(const Grip& grip) noexcept
{
    // At the surface the cell around the point may be half empty: the tie holds the tissue just under it.
    const double h = elastic_.body().levels.front().nodes.spacing;
    const double under = std::max(0.0, 0.5 * h + surface_.distance(grip.proxy));
    const Vec3 rest = grip.proxy - under * surface_.normal(grip.proxy);
    const double stiffness = tieStiffnessAt(elastic_.body(), rest);
    ties_[0] = {rest, grip.position - grip.proxy, grip.axis, stiffness, stiffness};
    std::size_t count = 1;
    const double inserted = glm::distance(grip.entry, grip.proxy);
    const auto pieces = static_cast<std::size_t>(std::min(inserted / shaftPiece, static_cast<double>(maxShaftTies)));
    for (std::size_t i = 0; grip.inside && i < pieces; ++i) {
        const double back = inserted * (static_cast<double>(i) + 1.0) / (static_cast<double>(pieces) + 1.0);
        const Vec3 at = glm::mix(grip.proxy, grip.entry, back / inserted);
        const Vec3 way = grip.position - back * grip.axis - at;
        const double held = tieStiffnessAt(elastic_.body(), at);
        const double carried =
            grip.drag + glm::dot(glm::mix(grip.pushedAtTip, grip.pushedAtEntry, back / inserted), grip.axis);
        ties_[count++] = {at, way + (carried - glm::dot(way, grip.axis)) * grip.axis, grip.axis, held, held};
    }
    return {{}, std::span(ties_).first(count), focusAt(surface_, grip.proxy)};
}

Reaction ElasticLevel::deform(const Grip& grip) noexcept
{
    // Where no hand presses, only the shape is asked for, not the force: solving and writing take turns.
    const bool isShapeOnly = grip.kind == Grip::Kind::point || (grip.kind == Grip::Kind::none && !grip.others.empty());
    const bool inParts = isShapeOnly && period_ > 1, takesTurns = inParts && isShapeOnly_;
    isShapeOnly_ = isShapeOnly;
    turn_ = takesTurns ? (turn_ + 1) % period_ : 0;
    const bool wasAtRest = elastic_.atRest(), isFirst = std::exchange(isFirst_, false);
    bool isMet = !takesTurns;
    ++since_;
    if (turn_ == 0) {
        ElasticLoad all = load(grip);
        all.periods = std::exchange(since_, 0);
        // A tip that is in tissue in the first call takes over from another level: its shape is asked for at once.
        const bool takesOver = isFirst && grip.kind == Grip::Kind::point && grip.inside;
        const bool begins = inParts && !takesOver;
        const double residual = last_.residual;
        last_ = begins ? elastic_.begin(all) : elastic_.relax(all);
        last_.residual = last_.residual > 0.0 || elastic_.atRest() ? last_.residual : residual;
        isMet = isMet || !begins || !last_.moved;
    } else {
        const ElasticResult further = elastic_.goOn(turn_ == period_ - 1);
        last_ = further.residual > 0.0 ? further : last_;
        isMet = further.moved;
    }
    // Of a pose in parts the shape is written where it is met, along the last increment: no other part has less to do.
    if (isMet) {
        const int calls = takesTurns ? period_ : 1;
        if (!(wasAtRest && elastic_.atRest())) {
            writeFinest(grip.proxy, calls * layersPerCall);
        }
        for (int i = 0; i < calls; ++i) {
            writeWider();
            revisitMoved();
        }
    }
    Reaction reaction{static_cast<std::uint32_t>(shape_.moved().size()), last_.residual, std::nullopt};
    const std::size_t others = std::min(grip.others.size(), maxOthers);
    if (grip.kind == Grip::Kind::press) {
        reaction.force = elastic_.toolForce(others);
        reaction.behind = elastic_.behind(others);
        reaction.depth = elastic_.depth(others);
    }
    for (std::size_t i = 0; i < others; ++i) {
        reaction.othersForce += elastic_.toolForce(i);
    }
    return reaction;
}

void ElasticLevel::writeWider() noexcept
{
    for (std::size_t l = 1; l < std::min(turns_.size(), windowsShown) && !elastic_.atRest(); ++l) {
        writeByTurns(l);
    }
}

// The finest window: around the tool in every call, elsewhere a few layers of nodes at a time.
void ElasticLevel::writeFinest(Vec3 around, int layers) noexcept
{
    const Window& window = elastic_.stack().windows().front();
    const auto& grid = shape_.lattice().grid;
    const Index3 low = glm::max(window.low, Index3(1));
    const Index3 high = glm::min(window.low + window.size() - 2, grid.size - 2);
    if (glm::any(glm::lessThan(high, low))) {
        return;  // the elastic body's nodes go on beyond the lattice, and a tool that is there takes the window along
    }
    const Index3 middle(glm::round((around - grid.origin) / grid.spacing));
    writeBox(glm::clamp(middle - nearNodes, low, high), glm::clamp(middle + nearNodes, low, high));
    int& layer = turns_.front().z;
    layer = layer < low.z || layer > high.z ? low.z : layer;
    const int last = std::min(layer + layers - 1, high.z);
    writeBox({low.x, low.y, layer}, {high.x, high.y, last});
    layer = last + 1;
}

void ElasticLevel::writeBox(Index3 low, Index3 high) noexcept
{
    const Window& window = elastic_.stack().windows().front();
    const auto& grid = shape_.lattice().grid;
    const auto u = shape_.raw();
    const auto inRow = static_cast<std::size_t>(std::max(high.x - low.x + 1, 0));
    const auto forEachRow = [&](auto&& visit) {
        std::size_t first = 0;
        volume::forEachIndex(low, {low.x, high.y, high.z}, [&](Index3 at) {
            visit(at, grid.offset(at), first);
            first += inRow;
        });
    };
    forEachRow([&](Index3 at, std::size_t n, std::size_t first) {
        cellMeans(window, window.at(at), inRow, &now_[first]);
        takeFragments(at, inRow, &now_[first]);
        for (std::size_t i = 0; i < inRow; ++i) {
            before_[first + i] = u[n + i];
            if (!shape_.lattice().isNode(static_cast<Node>(n + i))) {
                now_[first + i] = Vec3f(0.0F);
            }
        }
    });
    for (const float fraction : fractions) {
        forEachRow([&](Index3, std::size_t n, std::size_t first) {
            for (std::size_t i = 0; i < inRow; ++i) {
                const Vec3f old = before_[first + i];
                u[n + i] = old + fraction * (now_[first + i] - old);
            }
        });
        if (keepsOrientation(glm::max(low - 1, Index3(1)), glm::min(high + 1, grid.size - 2))) {
            break;
        }
    }
    forEachRow([&](Index3, std::size_t n, std::size_t first) {
        for (std::size_t i = 0; i < inRow; ++i) {
            if (u[n + i] != before_[first + i]) {
                shape_.place(static_cast<Node>(n + i));
            }
        }
    });
}

// Of the cells of a row that are fragments, the means over their nodes.
void ElasticLevel::takeFragments(Index3 first, std::size_t count, Vec3f* out) const noexcept
{
    const CellLevel& level = elastic_.body().levels.front();
    const Window& window = elastic_.stack().windows().front();
    for (const CellFragment& f :
         level.fragments.cellsOf(first, first.x + static_cast<int>(count) - 1, level.nodes.size.y)) {
        const auto index = static_cast<std::uint32_t>(&f - level.fragments.cells.data());
        const std::uint32_t node = window.fragments.nodeOf(index);
        if (node != noFragment) {
            cellMeans(window, node, 1, out + (f.cell.x - first.x));
        }
    }
}

// Edges that are shifted by less than a third of their length cannot turn a cell over: their matrix is diagonally dominant.
// So only nodes with a longer shift are looked at in full, with those beside them.
bool ElasticLevel::keepsOrientation(Index3 low, Index3 high) noexcept
{
    const auto& lattice = shape_.lattice();
    if (!findLongLinks(low, high)) {
        return true;
    }
    const auto inRow = static_cast<Node>(high.x - low.x + 1);
    const auto rows = static_cast<std::size_t>(high.y - low.y + 2);
    const auto isLong = [&](int y, int z) {
        return longRows_[static_cast<std::size_t>(z - low.z + 1) * rows + static_cast<std::size_t>(y - low.y + 1)] != 0;
    };
    // A node's links begin in its row, and in those before it along y and z.
    volume::forEachIndex(low, {low.x, high.y, high.z}, [&](Index3 at) {
        const auto n = static_cast<Node>(lattice.grid.offset(at));
        if (isLong(at.y, at.z) || isLong(at.y - 1, at.z) || isLong(at.y, at.z - 1)) {
            for (Node i = n; i < n + inRow; ++i) {
                markStrained(i);
            }
        } else {
            std::fill_n(strained_.begin() + n, inRow, std::uint8_t{0});
        }
    });
    bool all = true;
    volume::forEachIndex(low, {low.x, high.y, high.z}, [&](Index3 at) {
        const auto n = static_cast<Node>(lattice.grid.offset(at));
        for (Node i = n; all && i < n + inRow; ++i) {
            all = strained_[i] == 0 || upright(i);
        }
    });
    return all;
}

// Whether a long link, to tissue or not, begins in a box. Whole rows at once: few have one. In longRows_ are those of the
// box's rows and of those before it along y and z, from the node before the box on.
bool ElasticLevel::findLongLinks(Index3 low, Index3 high) noexcept
{
    const auto& grid = shape_.lattice().grid;
    const float* u = &shape_.u().front().x;
    const std::size_t row = 3 * static_cast<std::size_t>(grid.size.x);
    const std::size_t plane = row * static_cast<std::size_t>(grid.size.y);
    const std::size_t count = 3 * static_cast<std::size_t>(high.x - low.x + 1);
    const float third = static_cast<float>(grid.spacing) / 3.0F;
    bool around = false;
    std::size_t i = 0;
    volume::forEachIndex(low - 1, Index3(low.x - 1, high.y, high.z), [&](Index3 at) {
        const bool isLong = longestLink(u + 3 * grid.offset(at), count + 3, row, plane) > third;
        longRows_[i++] = isLong ? 1 : 0;
        around = around || isLong;
    });
    bool any = false;
    volume::forEachIndex(low, Index3(low.x, around ? high.y : low.y - 1, high.z),
                         [&](Index3 at) { any = any || longestLink(u + 3 * grid.offset(at), count, row, plane) > third; });
    return any;
}

void ElasticLevel::markStrained(Node n) noexcept
{
    const auto& lattice = shape_.lattice();
    const auto u = shape_.u();
    const float third = static_cast<float>(lattice.grid.spacing) / 3.0F;
    const auto link = [&](Node other) { return lattice.isNode(other) && largest(u[other] - u[n]) > third; };
    strained_[n] =
        lattice.isNode(n) && (link(lattice.beside(n, 1)) || link(lattice.beside(n, 3)) || link(lattice.beside(n, 5)) ||
                              link(lattice.beside(n, 0)) || link(lattice.beside(n, 2)) || link(lattice.beside(n, 4)))
            ? 1
            : 0;
}

void ElasticLevel::markWithNeighbours(Node n) noexcept
{
    markStrained(n);
    for (int side = 0; side < 6; ++side) {
        markStrained(shape_.lattice().beside(n, side));
    }
}

// True when the three edges that meet at node n keep their orientation, on all eight sides of it.
bool ElasticLevel::upright(Node n) const noexcept
{
    const Lattice& lattice = shape_.lattice();
    const auto u = shape_.u();
    const auto spacing = static_cast<float>(lattice.grid.spacing);
    std::array<Vec3f, 6> edge{};
    for (int side = 0; side < 6; ++side) {
        const Node other = lattice.beside(n, side);
        Vec3f shift = lattice.isNode(other) ? u[other] - u[n] : Vec3f(0.0F);
        shift[side / 2] += side % 2 != 0 ? spacing : -spacing;
        edge[static_cast<std::size_t>(side)] = shift;
    }
    const float least = minVolume * spacing * spacing * spacing;
    for (std::size_t side = 0; side < 4; ++side) {
        const std::size_t y = side & 1, z = side >> 1;
        const Vec3f across = glm::cross(edge[2 + y], edge[4 + z]);
        const float sign = (y + z) % 2 != 0 ? 1.0F : -1.0F;
        if (sign * glm::dot(edge[0], across) < least || -sign * glm::dot(edge[1], across) < least) {
            return false;
        }
    }
    return true;
}

// Node by node, where one alone may not turn a cell over.
void ElasticLevel::write(Node n, Index3 at) noexcept
{
    const auto& lattice = shape_.lattice();
    Vec3f u(elastic_.atRest() ? Vec3(0.0) : elastic_.displacementOf(at));
    if (glm::dot(u, u) < minShown * minShown) {
        u = Vec3f(0.0F);
    }
    const auto all = shape_.raw();
    const Vec3f old = all[n];
    if (u == old) {
        return;
    }
    all[n] = u;
    const bool was = strained_[n] != 0;
    markStrained(n);
    bool keeps = strained_[n] == 0 || upright(n);
    for (int side = 0; side < 6 && keeps; ++side) {
        const Node other = lattice.beside(n, side);
        if (lattice.isNode(other) && (was || strained_[n] != 0)) {
            markStrained(other);
        }
        keeps = strained_[other] == 0 || upright(other);
    }
    if (!keeps) {
        all[n] = old;
        markWithNeighbours(n);
    }
    shape_.place(n);
}

void ElasticLevel::writeByTurns(std::size_t level) noexcept
{
    const auto& grid = shape_.lattice().grid;
    const Window& window = elastic_.stack().windows()[level];
    const int scale = 1 << level;
    const Index3 low = glm::max(scale * window.low, Index3(1));
    const Index3 high = glm::min(scale * (window.low + window.size() - 1) - 1, grid.size - 2);
    if (glm::any(glm::lessThan(high, low))) {
        return;
    }
    Index3& at = turns_[level];
    for (int i = 0; i < turnsPerCall; ++i) {
        if (at.x < low.x || at.x > high.x || at.y < low.y || at.y > high.y || at.z < low.z || at.z > high.z) {
            at = low;
        }
        const auto n = static_cast<Node>(grid.offset(at));
        if (shape_.lattice().isNode(n)) {
            write(n, at);
        }
        if (++at.x > high.x) {
            at.x = low.x;
            if (++at.y > high.y) {
                at.y = low.y;
                at.z = at.z < high.z ? at.z + 1 : low.z;
            }
        }
    }
}

// What moved once is looked at again, also where no window is any more.
void ElasticLevel::revisitMoved() noexcept
{
    const int turns = elastic_.atRest() ? turnsAtRest : turnsPerCall;
    if (elastic_.atRest() && shape_.moved().size() <= static_cast<std::size_t>(turnsAtRest)) {
        // The last of them together: one alone may have no way past the others, and the lattice at rest is upright.
        while (!shape_.moved().empty()) {
            const Node n = shape_.moved().back();
            shape_.set(n, Vec3f(0.0F));
            markWithNeighbours(n);
        }
        return;
    }
    for (int i = 0; i < turns && !shape_.moved().empty(); ++i) {
        revisited_ = revisited_ < shape_.moved().size() ? revisited_ : 0;
        const std::size_t before = shape_.moved().size();
        const Node n = shape_.moved()[revisited_];
        write(n, shape_.lattice().grid.node(n));
        // A node that is at rest now left its place to another.
        revisited_ += shape_.moved().size() == before ? 1 : 0;
    }
}

}  // namespace palpate::chainmail
