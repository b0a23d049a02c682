#include <chainmail/propagate.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cassert>
#include <cmath>

namespace palpate::chainmail {

namespace {

// One run of propagate(): the lattice, the state and the queue together.
struct Run {
    const Lattice& lattice;
    std::span<Vec3f> u;
    PropagateScratch& scratch;
    Yield yield;
    float tolerance;  // violations below are rounding [m]
    PropagateResult result;

    // How node `n` may follow `step`: a held one only along `yield`, but then so far that the step's parts on this side of
    // the body are made up at once.
    Vec3f allowed(Node n, Vec3f step) const noexcept
    {
        if (lattice.isFixed(n)) {
            return Vec3f(0.0F);
        }
        if (scratch.held[n] != scratch.pass) {
            return step;
        }
        constexpr float flattest = 0.3F;  // parts across the yield would need a long way along it
        float way = 0.0F;
        for (int axis = 0; axis < 3; ++axis) {
            if (std::abs(yield[axis]) > flattest) {
                way = std::max(way, step[axis] / yield[axis]);
            }
        }
        return way * yield;
    }

    void move(Node n, Vec3f to) noexcept
    {
        u[n] = to;
        if (scratch.seen[n] != scratch.pass) {
            scratch.seen[n] = scratch.pass;
            scratch.moved.push_back(n);
        }
    }

    void pullNeighbours(Node a) noexcept
    {
        for (int side = 0; side < 6; ++side) {
            const Node b = lattice.beside(a, side);
            if (!lattice.isNode(b)) {
                continue;
            }
            const Vec3f step = correction(u[b] - u[a], side, lattice.between(a, b));
            const float square = glm::dot(step, step);
            if (square > tolerance * tolerance) {
                scratch.queue.push({a, side}, std::sqrt(square));
            }
        }
    }

    // Moves the far end of the link, or the near end where the far one may not.
    void follow(Node a, Node b, Vec3f step) noexcept
    {
        const Vec3f far = allowed(b, step);
        const Vec3f near = allowed(a, -step);
        if (glm::length(far) > tolerance) {
            move(b, u[b] + far);
            pullNeighbours(b);
        } else if (glm::length(near) > tolerance) {
            move(a, u[a] + near);
            pullNeighbours(a);
        } else {
            result.residual = std::max(result.residual, static_cast<double>(glm::length(step)));
            return;
        }
        ++result.moves;
    }

    Vec3f violationOf(const Pull& pull, Node b) const noexcept
    {
        return correction(u[b] - u[pull.from], pull.side, lattice.between(pull.from, b));
    }

    void settle() noexcept
    {
        while (!scratch.queue.empty() && result.moves < scratch.maxMoves) {
            const Pull pull = scratch.queue.pop();
            const Node b = lattice.beside(pull.from, pull.side);
            const Vec3f step = violationOf(pull, b);
            const float violation = glm::length(step);
            if (violation <= tolerance) {
                continue;
            }
            // Its ends have moved since it was put in: it may be another's turn.
            if (scratch.queue.holdsLarger(violation)) {
                scratch.queue.push(pull, violation);
                continue;
            }
            follow(pull.from, b, step);
        }
        while (!scratch.queue.empty()) {
            const Pull left = scratch.queue.pop();
            const Vec3f step = violationOf(left, lattice.beside(left.from, left.side));
            result.residual = std::max(result.residual, static_cast<double>(glm::length(step)));
        }
    }
};

}  // namespace

PropagateScratch::PropagateScratch(const Lattice& lattice, std::uint32_t most, std::uint32_t maxSeeds)
    // A move takes one pull out of the queue and puts in six at most.
    : queue(lattice.grid.spacing, 6 * (static_cast<std::size_t>(most) + maxSeeds) + 6),
      seen(lattice.tissue.size(), 0),
      held(lattice.tissue.size(), 0),
      maxMoves(most)
{
    moved.reserve(static_cast<std::size_t>(most) + maxSeeds);
}

void PropagateScratch::clear() noexcept
{
    moved.clear();
    ++pass;
}

PropagateResult propagate(const Lattice& lattice, std::span<Vec3f> u, PropagateScratch& scratch,
                          std::span<const Seed> seeds, Yield yield) noexcept
{
    scratch.clear();
    Run run{lattice, u, scratch, yield, static_cast<float>(lattice.grid.spacing) * 1e-5F, {}};
    for (const Seed& seed : seeds) {
        assert(lattice.tissue[seed.node] != 0);
        run.move(seed.node, seed.u);
        scratch.held[seed.node] = scratch.pass;
    }
    for (const Seed& seed : seeds) {
        run.pullNeighbours(seed.node);
    }
    run.settle();
    return run.result;
}

}  // namespace palpate::chainmail
