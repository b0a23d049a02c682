#include <chainmail/deformation.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::chainmail {

namespace {

// Of a way through the body no more than this is looked at, in spacings: a pose that jumps must not cost a tick.
constexpr double longestPress = 25.0;

// Calls visit(node, position at rest) for the nodes that are not fixed in the box [low, high].
template <typename Visit>
void visitNodes(const Lattice& lattice, Vec3 lowest, Vec3 highest, Visit&& visit) noexcept
{
    const auto& grid = lattice.grid;
    const Vec3 last(grid.size - Index3(1));
    const Index3 low(glm::clamp(glm::ceil((lowest - grid.origin) / grid.spacing), Vec3(0.0), last));
    const Index3 high(glm::clamp(glm::floor((highest - grid.origin) / grid.spacing), Vec3(0.0), last));
    volume::forEachIndex(low, high, [&](Index3 at) {
        const auto n = static_cast<Node>(grid.offset(at));
        if (lattice.isNode(n) && !lattice.isFixed(n)) {
            visit(n, grid.position(at));
        }
    });
}

}  // namespace

Deformation::Deformation(const Lattice& lattice, std::uint32_t maxMoves, std::size_t maxSeeds)
    : shape_(lattice), scratch_(lattice, maxMoves, static_cast<std::uint32_t>(maxSeeds))
{
    before_.reserve(lattice.tissue.size());
}

PropagateResult Deformation::deform(std::span<const Seed> seeds, Yield yield) noexcept
{
    before_.assign(shape_.moved().begin(), shape_.moved().end());
    const auto u = shape_.raw();
    for (const Node n : before_) {
        u[n] = Vec3f(0.0F);
    }
    const PropagateResult result = propagate(shape_.lattice(), u, scratch_, seeds, yield);
    for (const Node n : before_) {
        if (scratch_.seen[n] != scratch_.pass) {
            shape_.place(n);
        }
    }
    for (const Node n : scratch_.moved) {
        shape_.place(n);
    }
    return result;
}

std::size_t maxPressSeeds(const Lattice& lattice, double radius) noexcept
{
    // Nodes in a capsule, widened by one spacing for those on its rim.
    const double r = std::max(radius / lattice.grid.spacing, 1.0) + 1.0;
    return static_cast<std::size_t>(std::numbers::pi * r * r * (longestPress + 2.0 * r)) + 1;
}

std::size_t pressSeeds(const Lattice& lattice, Vec3 from, Vec3 to, double radius, std::span<Seed> out) noexcept
{
    const double whole = glm::distance(from, to);
    if (whole <= 0.0) {
        return 0;
    }
    const Vec3 ahead = (to - from) / whole;
    const double way = std::min(whole, longestPress * lattice.grid.spacing);
    const double seen = std::max(radius, lattice.grid.spacing);
    const Vec3 start = to - (way + seen - radius) * ahead;
    const Vec3 end = start + way * ahead;
    std::size_t count = 0;
    visitNodes(lattice, glm::min(start, end) - seen, glm::max(start, end) + seen, [&](Node n, Vec3 rest) {
        const Vec3 r = rest - start;
        const double along = glm::dot(r, ahead);
        const double inside = seen * seen - (glm::dot(r, r) - along * along);
        if (inside <= 0.0 || along < -seen || count == out.size()) {
            return;
        }
        const double push = way + std::sqrt(inside) - along;
        if (push > 0.0) {
            out[count++] = {n, Vec3f(push * ahead)};
        }
    });
    return count;
}

std::size_t dragSeeds(const Lattice& lattice, Vec3 rest, Vec3 u, std::span<Seed> out) noexcept
{
    const double reach = lattice.grid.spacing;
    std::size_t count = 0;
    visitNodes(lattice, rest - reach, rest + reach, [&](Node n, Vec3 at) {
        if (glm::distance(at, rest) <= reach && count < out.size()) {
            out[count++] = {n, Vec3f(u)};
        }
    });
    return count;
}

}  // namespace palpate::chainmail
