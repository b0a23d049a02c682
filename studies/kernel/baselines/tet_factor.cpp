#include <studies/kernel/baselines/tet_factor.h>

#include <base/error.h>

#include <Eigen/SparseCholesky>

#include <vector>

namespace palpate::studies {

struct TetFactor::Impl {
    Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> factors;
};

namespace {

// The lower half of the block that point `q` puts into the rows of point `p`.
void addBlock(const Mat3& block, std::uint32_t p, std::uint32_t q, std::vector<Eigen::Triplet<double>>& entries)
{
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            const Eigen::Index row = 3 * Eigen::Index{p} + i, column = 3 * Eigen::Index{q} + j;
            if (row >= column) {
                entries.emplace_back(row, column, block[j][i]);
            }
        }
    }
}

}  // namespace

TetFactor::TetFactor(const TetBody& mesh, std::span<const std::uint32_t> unknown, std::size_t unknowns)
    : impl_(std::make_unique<Impl>())
{
    std::vector<Eigen::Triplet<double>> entries;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const auto stiffness = stiffnessOf(mesh, t);
        for (std::size_t ab = 0; ab < 16; ++ab) {
            const std::uint32_t p = unknown[mesh.tets[t][ab / 4]], q = unknown[mesh.tets[t][ab % 4]];
            if (p != held && q != held) {
                addBlock(stiffness[ab / 4][ab % 4], p, q, entries);
            }
        }
    }
    const auto size = static_cast<Eigen::Index>(3 * unknowns);
    Eigen::SparseMatrix<double> matrix(size, size);
    matrix.setFromTriplets(entries.begin(), entries.end());
    impl_->factors.compute(matrix);
    base::failIf(impl_->factors.info() != Eigen::Success,
                 "prefactored tetrahedra: the stiffness is not positive definite; is the body held?");
}

TetFactor::~TetFactor() = default;

void TetFactor::solve(std::span<double> columns) const
{
    const Eigen::Index rows = impl_->factors.rows();
    Eigen::Map<Eigen::MatrixXd> all(columns.data(), rows, static_cast<Eigen::Index>(columns.size()) / rows);
    all = impl_->factors.solve(all).eval();
}

}  // namespace palpate::studies
