#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

namespace palpate::reference {

/// A symmetric sparse matrix, all of it, column by column.
struct SymmetricMatrix {
    std::vector<std::size_t> start;  // of each column in `row`, and the end  (size + 1)
    std::vector<int> row;            //                                        (entries x 1)
    std::vector<double> value;       //                                        (entries x 1)
    std::vector<int> blocks;         // first column of each node, and the end (nodes + 1)

    std::size_t size() const noexcept { return start.empty() ? 0 : start.size() - 1; }
    void multiply(std::span<const double> x, std::span<double> y) const noexcept;
};

/// An L D L^T factorization by MUMPS.
/// Source: P. R. Amestoy, I. S. Duff, J. Koster, J.-Y. L'Excellent, "A Fully Asynchronous Multifrontal Solver Using
/// Distributed Dynamic Scheduling", SIAM J. Matrix Anal. Appl. 23, 2001.
class Factor {
public:
    /// Throws std::runtime_error when the matrix is singular or does not fit into memory.
    explicit Factor(const SymmetricMatrix& matrix);
    ~Factor();

    void solve(std::span<double> x) const;  // right-hand side to solution

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// Solves A x = b by GMRES with the factor of a nearby matrix on the right, from x = 0 until |b - A x| <= share |b|.
/// @returns  whether it got there in `most` iterations; x is its best otherwise
/// Source: Y. Saad, M. H. Schultz, "GMRES", SIAM J. Sci. Stat. Comput. 7, 1986.
bool solveNearby(const SymmetricMatrix& a, const Factor& nearby, std::span<const double> b, std::span<double> x,
                 double fraction, int most);

}  // namespace palpate::reference
