#include <chainmail/propagate.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cassert>
#include <cmath>

namespace palpate::chainmail {

namespace {

using Pull = PropagateScratch::Pull;

// A function object, so that the heap's loops take it in.
struct Later {
    bool operator()(const Pull& a, const Pull& b) const noexcept
    {
        return a.violation != b.violation ? a.violation < b.violation : a.order > b.order;
    }
};

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

    void push(Pull pull) noexcept
    {
        pull.order = scratch.order++;
        scratch.queue.push_back(pull);
        std::push_heap(scratch.queue.begin(), scratch.queue.end(), Later{});
    }

    Pull pop() noexcept
    {
        std::pop_heap(scratch.queue.begin(), scratch.queue.end(), Later{});
        const Pull pull = scratch.queue.back();
        scratch.queue.pop_back();
        return pull;
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
                push({std::sqrt(square), 0, a, side});
            }
        }
    }

    // Moves the far end of the link, or the near end where the far one may not.
    void follow(const Pull& pull, Node b, Vec3f step) noexcept
    {
        const Node a = pull.from;
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

    void settle() noexcept
    {
        while (!scratch.queue.empty() && result.moves < scratch.maxMoves) {
            Pull pull = pop();
            const Node b = lattice.beside(pull.from, pull.side);
            const Vec3f step = correction(u[b] - u[pull.from], pull.side, lattice.between(pull.from, b));
            const float violation = glm::length(step);
            if (violation <= tolerance) {
                continue;
            }
            if (violation < pull.violation && !scratch.queue.empty() && violation < scratch.queue.front().violation) {
                pull.violation = violation;
                push(pull);
                continue;
            }
            follow(pull, b, step);
        }
        for (const Pull& left : scratch.queue) {
            result.residual = std::max(result.residual, static_cast<double>(left.violation));
        }
        scratch.queue.clear();
    }
};

}  // namespace

PropagateScratch::PropagateScratch(const Lattice& lattice, std::uint32_t most, std::uint32_t maxSeeds)
    : seen(lattice.tissue.size(), 0), held(lattice.tissue.size(), 0), maxMoves(most)
{
    // A move takes one pull out of the queue and puts in six at most.
    queue.reserve(6 * (static_cast<std::size_t>(most) + maxSeeds) + 6);
    moved.reserve(static_cast<std::size_t>(most) + maxSeeds);
}

void PropagateScratch::clear() noexcept
{
    moved.clear();
    ++pass;
    order = 0;
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
