#include <studies/kernel/baselines/fifo_mail.h>

#include <glm/geometric.hpp>

namespace palpate::studies {

using namespace chainmail;

namespace {

constexpr std::size_t movesPerNode = 4;  // held nodes that disagree could keep others moving for ever
constexpr float rounding = 1e-5F;        // fraction of the spacing

void move(FifoScratch& scratch, std::span<Vec3f> u, Node n, Vec3f to)
{
    u[n] = to;
    if (scratch.seen[n] != scratch.pass) {
        scratch.seen[n] = scratch.pass;
        scratch.moved.push_back(n);
    }
    if (scratch.waits[n] == 0) {
        scratch.waits[n] = 1;
        scratch.queue.push_back(n);
    }
}

}  // namespace

FifoScratch::FifoScratch(const Lattice& lattice)
    : seen(lattice.tissue.size(), 0), held(lattice.tissue.size(), 0), waits(lattice.tissue.size(), 0)
{
}

std::size_t propagateFifo(const Lattice& lattice, std::span<Vec3f> u, FifoScratch& scratch, std::span<const Seed> seeds)
{
    ++scratch.pass;
    scratch.queue.clear();
    scratch.moved.clear();
    for (const Seed& seed : seeds) {
        scratch.held[seed.node] = scratch.pass;
        move(scratch, u, seed.node, seed.u);
    }
    const float least = rounding * static_cast<float>(lattice.grid.spacing);
    const std::size_t most = movesPerNode * lattice.tissue.size();
    std::size_t moves = 0;
    for (std::size_t head = 0; head < scratch.queue.size(); ++head) {
        const Node a = scratch.queue[head];
        scratch.waits[a] = 0;
        for (int side = 0; side < 6 && moves < most; ++side) {
            const Node b = lattice.beside(a, side);
            if (!lattice.isNode(b) || lattice.isFixed(b) || scratch.held[b] == scratch.pass) {
                continue;
            }
            const Vec3f step = correction(u[b] - u[a], side, lattice.between(a, b));
            if (glm::dot(step, step) > least * least) {
                move(scratch, u, b, u[b] + step);
                ++moves;
            }
        }
    }
    return moves;
}

}  // namespace palpate::studies
