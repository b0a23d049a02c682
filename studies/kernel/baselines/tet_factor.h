#pragma once

#include <studies/kernel/baselines/tets.h>

#include <cstdint>
#include <memory>
#include <span>

namespace palpate::studies {

/// The stiffness of linear tetrahedra, factored (Eigen's sparse Cholesky decomposition).
class TetFactor {
public:
    static constexpr std::uint32_t held = ~0U;

    /// @param unknown  number of each point, `held` for those that do not move (count x 1)
    /// Throws std::runtime_error when the matrix is not positive definite: nothing holds the body.
    TetFactor(const TetBody& mesh, std::span<const std::uint32_t> unknown, std::size_t unknowns);
    ~TetFactor();

    /// Solves for several right sides at once, in place.
    /// @param columns  (count x 3 unknowns), each column contiguous
    void solve(std::span<double> columns) const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::studies
