#include <volume/distance.h>
#include <volume/thin_parts.h>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <glm/common.hpp>

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace palpate::volume {

namespace {

constexpr float half = 0.5F;
constexpr float known = 0.6F;       // blurred fraction of a part that its surface knows
constexpr float root = 0.65F;       // blurred fraction of the nodes where it stands on the rest, 0.625, and 0.75 of a face
constexpr std::size_t fewest = 64;  // nodes of a part

// The nodes of the grid at most `reach` beside node n.
struct Beside {
    Index3 low, high;
    Beside(const NodeGrid& grid, Index3 n, int reach)
        : low(glm::max(n - reach, Index3(0))), high(glm::min(n + reach, grid.size - 1))
    {
    }
};

bool isKnown(const NodeGrid& grid, std::span<const float> blurred, Index3 n, int reach)
{
    const Beside beside(grid, n, reach);
    for (int z = beside.low.z; z <= beside.high.z; ++z) {
        for (int y = beside.low.y; y <= beside.high.y; ++y) {
            const auto row = blurred.begin() + static_cast<std::ptrdiff_t>(grid.offset({beside.low.x, y, z}));
            if (std::any_of(row, row + beside.high.x - beside.low.x + 1, [](float f) { return f > known; })) {
                return true;
            }
        }
    }
    return false;
}

// Takes the piece of marked nodes that `first` is of out of `marked`.
std::vector<std::size_t> takePiece(const NodeGrid& grid, std::size_t first, std::vector<std::uint8_t>& marked)
{
    std::vector<std::size_t> piece{first};
    marked[first] = 0;
    for (std::size_t k = 0; k < piece.size(); ++k) {
        const Beside beside(grid, grid.node(piece[k]), 1);
        forEachIndex(beside.low, beside.high, [&](Index3 n) {
            if (std::uint8_t& mark = marked[grid.offset(n)]; mark != 0) {
                mark = 0;
                piece.push_back(grid.offset(n));
            }
        });
    }
    return piece;
}

}  // namespace

ThinParts thinParts(const NodeGrid& grid, std::span<const float> fraction, std::span<const float> blurred, double voxel)
{
    const int reach = static_cast<int>(std::ceil(voxel - 1e-6));
    std::vector<std::uint8_t> marked(grid.count(), 0);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, marked.size()), [&](const tbb::blocked_range<std::size_t>& nodes) {
        for (std::size_t i = nodes.begin(); i != nodes.end(); ++i) {
            const bool isThin = fraction[i] > half && blurred[i] <= known && !isKnown(grid, blurred, grid.node(i), reach);
            marked[i] = isThin ? 1 : 0;
        }
    });
    ThinParts thin{{}, {}, voxel};
    for (std::size_t i = 0; i < marked.size(); ++i) {
        if (marked[i] == 0) {
            continue;
        }
        const std::vector<std::size_t> piece = takePiece(grid, i, marked);
        if (piece.size() < fewest) {
            continue;
        }
        if (thin.around.empty()) {
            thin.around.resize(grid.count(), 0);
            thin.rest.assign(fraction.begin(), fraction.end());
        }
        for (const std::size_t node : piece) {
            const Index3 n = grid.node(node);
            const Beside beside(grid, n, reach + 1), next(grid, n, 1);
            forEachIndex(beside.low, beside.high, [&](Index3 b) {
                const std::size_t at = grid.offset(b);
                thin.around[at] = 1;
                thin.rest[at] = fraction[at] > half && blurred[at] <= root ? 0.0F : thin.rest[at];
            });
            // Their faces may lie between nodes: cells next to them hold the rest of them.
            forEachIndex(next.low, next.high, [&](Index3 b) {
                float& rest = thin.rest[grid.offset(b)];
                rest = rest <= half ? 0.0F : rest;
            });
        }
    }
    return thin;
}

void addThinParts(const NodeGrid& grid, std::span<const float> fraction, const ThinParts& thin,
                  std::vector<float>& distance)
{
    // Nowhere in such a part is deeper: nodes around its root may be far from its faces.
    const auto deepest = -static_cast<float>(0.5 * thin.voxel * grid.spacing);
    const std::vector<float> parts = signedDistance(grid, fraction, half, thin.around);
    std::transform(distance.begin(), distance.end(), parts.begin(), distance.begin(),
                   [&](float all, float part) { return std::min(all, std::max(part, deepest)); });
}

}  // namespace palpate::volume
