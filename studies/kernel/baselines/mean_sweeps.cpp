#include <studies/kernel/baselines/mean_sweeps.h>

#include <glm/common.hpp>

#include <cstring>

namespace palpate::studies {

using namespace chainmail;

namespace {

// Three floats per node, one behind the other: a neighbour along x is three floats away.
inline __attribute__((always_inline)) void meanRow(const float* __restrict u, const float* __restrict weight,
                                                   std::ptrdiff_t row, std::ptrdiff_t plane, std::ptrdiff_t n,
                                                   float* __restrict out) noexcept
{
    for (std::ptrdiff_t i = 0; i < n; ++i) {
        const float sum = u[i - 3] + u[i + 3] + u[i - row] + u[i + row] + u[i - plane] + u[i + plane];
        out[i] = weight[i] > 0.0F ? weight[i] * sum : u[i];
    }
}

void meanRowPlain(const float* u, const float* weight, std::ptrdiff_t row, std::ptrdiff_t plane, std::ptrdiff_t n,
                  float* out) noexcept
{
    meanRow(u, weight, row, plane, n, out);
}

__attribute__((target("avx2"))) void meanRowWide(const float* u, const float* weight, std::ptrdiff_t row,
                                                 std::ptrdiff_t plane, std::ptrdiff_t n, float* out) noexcept
{
    meanRow(u, weight, row, plane, n, out);
}

}  // namespace

MeanSweeps::MeanSweeps(const Lattice& lattice)
    : lattice_(lattice),
      weight_(3 * lattice.tissue.size(), 0.0F),
      row_(3 * static_cast<std::size_t>(lattice.grid.size.x)),
      wide_(__builtin_cpu_supports("avx2") != 0)
{
    for (Node n = 0; n < lattice.tissue.size(); ++n) {
        hold({&n, 1}, !lattice.isNode(n));
    }
}

void MeanSweeps::hold(std::span<const Node> nodes, bool yes)
{
    for (const Node n : nodes) {
        int beside = 0;
        for (int side = 0; side < 6 && !yes && !lattice_.isFixed(n); ++side) {
            beside += lattice_.isNode(lattice_.beside(n, side)) ? 1 : 0;
        }
        const float weight = beside > 0 ? 1.0F / static_cast<float>(beside) : 0.0F;
        for (std::size_t c = 0; c < 3; ++c) {
            weight_[3 * std::size_t{n} + c] = weight;
        }
    }
}

void MeanSweeps::sweep(std::span<Vec3f> u, std::span<const Node> moved, std::span<const Node> held, int count)
{
    const auto& grid = lattice_.grid;
    low_ = grid.size;
    high_ = Index3(0);
    for (const Node n : moved) {
        low_ = glm::min(low_, grid.node(n));
        high_ = glm::max(high_, grid.node(n));
    }
    low_ = glm::max(low_ - count, Index3(1));
    high_ = glm::min(high_ + count, grid.size - 2);
    if (moved.empty()) {
        return;
    }
    hold(held, true);
    const auto along = wide_ ? meanRowWide : meanRowPlain;
    const std::ptrdiff_t row = 3 * grid.size.x, plane = row * grid.size.y, n = 3 * (high_.x - low_.x + 1);
    for (int s = 0; s < count; ++s) {
        // Back and forth, so that motion spreads as fast either way.
        const bool back = s % 2 != 0;
        for (int k = low_.z; k <= high_.z; ++k) {
            for (int j = low_.y; j <= high_.y; ++j) {
                const Index3 first =
                    back ? Index3(low_.x, high_.y + low_.y - j, high_.z + low_.z - k) : Index3(low_.x, j, k);
                float* const at = &u[grid.offset(first)].x;
                along(at, &weight_[3 * grid.offset(first)], row, plane, n, row_.data());
                std::memcpy(at, row_.data(), static_cast<std::size_t>(n) * sizeof(float));
            }
        }
    }
    hold(held, false);
}

}  // namespace palpate::studies
