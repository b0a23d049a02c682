#pragma once

#include <volume/geometry.h>

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

namespace palpate::experiments {

/// Stiffness of an element with four points, each with three unknowns: block (a, b) is what point b does to point a.
using ElementStiffness = std::array<std::array<Mat3, 4>, 4>;

/// What is to be factored: a symmetric positive definite matrix that is the sum of its elements.
struct LatticeMatrix {
    std::span<const Index3> corner;  // of each unknown point on a lattice; points of an element are neighbours there
    std::vector<std::array<std::uint32_t, 4>> elements;  // points; `held` for those that are no unknowns
    std::function<ElementStiffness(std::size_t element)> stiffness;
    static constexpr std::uint32_t held = ~0U;
};

/// Cholesky factors by fronts: planes of the lattice part it again and again into halves that know nothing of each other.
///
/// Sources: A. George, "Nested dissection of a regular finite element mesh", SIAM J. Numer. Anal. 10, 1973; J. W. H. Liu,
/// "The multifrontal method for sparse matrix solution", SIAM Review 34, 1992.
class LatticeCholesky {
public:
    /// Throws std::runtime_error when the matrix is not positive definite.
    explicit LatticeCholesky(const LatticeMatrix& matrix);
    ~LatticeCholesky();

    /// Solves for several right sides at once, in place.
    /// @param columns  (count x unknowns), three to a point, each column contiguous
    void solve(std::span<double> columns, std::size_t count) const;
    std::size_t unknowns() const noexcept;
    std::size_t entries() const noexcept;  // of the factors

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::experiments
