#include <experiments/lattice_cholesky.h>

#include <fmt/format.h>
#include <Eigen/Dense>

#include <algorithm>
#include <numeric>
#include <stdexcept>

namespace palpate::experiments {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr std::size_t leafPoints = 24;  // fewer are eliminated in one front

// Points that are eliminated together, and those later ones that they are coupled to.
struct Front {
    std::vector<std::uint32_t> points;  // own ones first, then the later ones, by order of elimination
    std::size_t own = 0;
    std::vector<std::uint32_t> elements;  // whose first point is eliminated here
    std::vector<std::size_t> children;
    MatrixXd diagonal;  // lower triangle of the factor of the own points       (3 own x 3 own)
    MatrixXd below;     // the factor's rows of the later ones         (3 (points - own) x 3 own)

    Index ownRows() const { return static_cast<Index>(3 * own); }
    Index rows() const { return static_cast<Index>(3 * points.size()); }
};

class Dissection {
public:
    explicit Dissection(const LatticeMatrix& matrix) : matrix_(matrix) {}

    // All fronts, children before their parents.
    std::vector<Front> fronts()
    {
        std::vector<std::uint32_t> all(matrix_.corner.size());
        std::iota(all.begin(), all.end(), 0U);
        dissect(std::move(all));
        number();
        assignElements();
        for (Front& f : fronts_) {
            addLaterPoints(f);
        }
        return std::move(fronts_);
    }

private:
    // Adds the fronts of these points, children first. Returns the last one.
    std::size_t dissect(std::vector<std::uint32_t> points)
    {
        std::vector<std::size_t> children;
        if (points.size() > leafPoints) {
            const auto [axis, plane] = widestAxis(points);
            std::vector<std::uint32_t> low, high, on;
            for (const std::uint32_t p : points) {
                const int at = matrix_.corner[p][axis];
                (at < plane ? low : at > plane ? high : on).push_back(p);
            }
            for (auto* half : {&low, &high}) {
                if (!half->empty()) {
                    children.push_back(dissect(std::move(*half)));
                }
            }
            points = std::move(on);
        }
        Front front;
        front.own = points.size();
        front.points = std::move(points);
        front.children = std::move(children);
        fronts_.push_back(std::move(front));
        return fronts_.size() - 1;
    }

    // The longest side of the points' box, and the plane across it with as many points on either side.
    std::pair<int, int> widestAxis(const std::vector<std::uint32_t>& points) const
    {
        Index3 low = matrix_.corner[points.front()], high = low;
        for (const std::uint32_t p : points) {
            for (int a = 0; a < 3; ++a) {
                low[a] = std::min(low[a], matrix_.corner[p][a]);
                high[a] = std::max(high[a], matrix_.corner[p][a]);
            }
        }
        int axis = 0;
        for (int a = 1; a < 3; ++a) {
            axis = high[a] - low[a] > high[axis] - low[axis] ? a : axis;
        }
        std::vector<int> at;
        for (const std::uint32_t p : points) {
            at.push_back(matrix_.corner[p][axis]);
        }
        std::nth_element(at.begin(), at.begin() + static_cast<std::ptrdiff_t>(at.size() / 2), at.end());
        return {axis, at[at.size() / 2]};
    }

    void number()
    {
        order_.resize(matrix_.corner.size());
        frontOf_.resize(matrix_.corner.size());
        std::uint32_t next = 0;
        for (std::size_t f = 0; f < fronts_.size(); ++f) {
            for (const std::uint32_t p : fronts_[f].points) {
                order_[p] = next++;
                frontOf_[p] = f;
            }
        }
    }

    void assignElements()
    {
        for (std::size_t e = 0; e < matrix_.elements.size(); ++e) {
            std::uint32_t first = LatticeMatrix::held;
            for (const std::uint32_t p : matrix_.elements[e]) {
                if (p != LatticeMatrix::held && (first == LatticeMatrix::held || order_[p] < order_[first])) {
                    first = p;
                }
            }
            if (first != LatticeMatrix::held) {
                fronts_[frontOf_[first]].elements.push_back(static_cast<std::uint32_t>(e));
            }
        }
    }

    void addLaterPoints(Front& front) const
    {
        const std::uint32_t last = order_[front.points[front.own - 1]];
        std::vector<std::uint32_t> later;
        const auto add = [&](std::uint32_t p) {
            if (p != LatticeMatrix::held && order_[p] > last) {
                later.push_back(p);
            }
        };
        for (const std::uint32_t e : front.elements) {
            std::ranges::for_each(matrix_.elements[e], add);
        }
        for (const std::size_t c : front.children) {
            std::ranges::for_each(fronts_[c].points, add);
        }
        std::ranges::sort(later, {}, [&](std::uint32_t p) { return order_[p]; });
        later.erase(std::unique(later.begin(), later.end()), later.end());
        front.points.insert(front.points.end(), later.begin(), later.end());
    }

    const LatticeMatrix& matrix_;
    std::vector<Front> fronts_;
    std::vector<std::uint32_t> order_;  // of elimination, by point
    std::vector<std::size_t> frontOf_;  // by point
};

// Adds an element to the lower triangle of `sum`, where its points are rows `at` (in points; -1: held).
void addElement(const ElementStiffness& stiffness, const std::array<Index, 4>& at, MatrixXd& sum)
{
    for (std::size_t a = 0; a < 4; ++a) {
        for (std::size_t b = 0; b < 4; ++b) {
            if (at[b] >= 0 && at[a] >= at[b]) {
                sum.block<3, 3>(3 * at[a], 3 * at[b]) += Eigen::Map<const Eigen::Matrix3d>(&stiffness[a][b][0][0]);
            }
        }
    }
}

}  // namespace

struct LatticeCholesky::Impl {
    std::size_t points = 0;
    std::vector<Front> fronts;

    // The front's matrix with all that was eliminated before.
    MatrixXd assemble(const LatticeMatrix& matrix, const Front& front, std::vector<MatrixXd>& updates,
                      std::vector<Index>& rowOf) const
    {
        MatrixXd sum = MatrixXd::Zero(front.rows(), front.rows());
        for (std::size_t i = 0; i < front.points.size(); ++i) {
            rowOf[front.points[i]] = static_cast<Index>(i);
        }
        for (const std::uint32_t e : front.elements) {
            std::array<Index, 4> at{};
            for (std::size_t i = 0; i < 4; ++i) {
                const std::uint32_t p = matrix.elements[e][i];
                at[i] = p == LatticeMatrix::held ? -1 : rowOf[p];
            }
            addElement(matrix.stiffness(e), at, sum);
        }
        for (const std::size_t c : front.children) {
            extend(fronts[c], updates[c], rowOf, sum);
            updates[c].resize(0, 0);
        }
        return sum;
    }

    static void extend(const Front& child, const MatrixXd& update, const std::vector<Index>& rowOf, MatrixXd& sum)
    {
        for (std::size_t j = child.own; j < child.points.size(); ++j) {
            for (std::size_t i = j; i < child.points.size(); ++i) {
                const auto from = [&](std::size_t k) { return static_cast<Index>(3 * (k - child.own)); };
                sum.block<3, 3>(3 * rowOf[child.points[i]], 3 * rowOf[child.points[j]]) +=
                    update.block<3, 3>(from(i), from(j));
            }
        }
    }
};

LatticeCholesky::LatticeCholesky(const LatticeMatrix& matrix) : impl_(std::make_unique<Impl>())
{
    impl_->points = matrix.corner.size();
    impl_->fronts = Dissection(matrix).fronts();
    std::vector<MatrixXd> updates(impl_->fronts.size());
    std::vector<Index> rowOf(impl_->points, -1);
    for (std::size_t f = 0; f < impl_->fronts.size(); ++f) {
        Front& front = impl_->fronts[f];
        MatrixXd sum = impl_->assemble(matrix, front, updates, rowOf);
        const Index own = front.ownRows(), later = front.rows() - own;
        const Eigen::LLT<MatrixXd> factor(sum.topLeftCorner(own, own));
        if (factor.info() != Eigen::Success) {
            throw std::runtime_error(fmt::format(
                "stiffness of {} unknowns is not positive definite: hold more of the body, or lower Poisson's ratio",
                unknowns()));
        }
        front.diagonal = factor.matrixLLT();
        front.below = sum.bottomLeftCorner(later, own);
        front.diagonal.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(front.below);
        updates[f] = sum.bottomRightCorner(later, later);
        updates[f].selfadjointView<Eigen::Lower>().rankUpdate(front.below, -1.0);
    }
}

LatticeCholesky::~LatticeCholesky() = default;

void LatticeCholesky::solve(std::span<double> columns, std::size_t count) const
{
    Eigen::Map<MatrixXd> x(columns.data(), static_cast<Index>(unknowns()), static_cast<Index>(count));
    const auto gather = [&](const Front& f, std::size_t from, std::size_t to) {
        MatrixXd part(static_cast<Index>(3 * (to - from)), x.cols());
        for (std::size_t i = from; i < to; ++i) {
            part.middleRows<3>(static_cast<Index>(3 * (i - from))) = x.middleRows<3>(3 * static_cast<Index>(f.points[i]));
        }
        return part;
    };
    const auto scatter = [&](const Front& f, std::size_t from, const MatrixXd& part) {
        for (Index i = 0; i < part.rows() / 3; ++i) {
            const std::uint32_t p = f.points[from + static_cast<std::size_t>(i)];
            x.middleRows<3>(3 * static_cast<Index>(p)) = part.middleRows<3>(3 * i);
        }
    };
    for (const Front& f : impl_->fronts) {
        MatrixXd own = gather(f, 0, f.own);
        f.diagonal.triangularView<Eigen::Lower>().solveInPlace(own);
        scatter(f, 0, own);
        MatrixXd later = gather(f, f.own, f.points.size());
        later.noalias() -= f.below * own;
        scatter(f, f.own, later);
    }
    for (auto f = impl_->fronts.rbegin(); f != impl_->fronts.rend(); ++f) {
        MatrixXd own = gather(*f, 0, f->own);
        own.noalias() -= f->below.transpose() * gather(*f, f->own, f->points.size());
        f->diagonal.triangularView<Eigen::Lower>().transpose().solveInPlace(own);
        scatter(*f, 0, own);
    }
}

std::size_t LatticeCholesky::unknowns() const noexcept
{
    return 3 * impl_->points;
}

std::size_t LatticeCholesky::entries() const noexcept
{
    std::size_t sum = 0;
    for (const Front& f : impl_->fronts) {
        sum += static_cast<std::size_t>(f.ownRows() * (f.ownRows() + 1) / 2 + f.below.size());
    }
    return sum;
}

}  // namespace palpate::experiments
