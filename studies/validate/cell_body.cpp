#include <studies/validate/cell_body.h>

#include <algorithm>
#include <cmath>

namespace palpate::studies {

using namespace chainmail;

constexpr QuasiNewton::Limits limits{6, 12};  // more steps cost more than they save

CellBody::CellBody(Index3 cells, double side)
    : layout_(Layout::of(cells.x + 1, cells.y + 1, cells.z + 1)),
      side_(side),
      mu_(layout_.count + Layout::lanes, 0.0F),
      lambda_(mu_),
      stiffening_(mu_),
      narrow_(layout_.fieldSize(), 0.0F),
      force_(narrow_),
      scratch_(layout_.scratchSize(), 0.0F),
      u_(layout_.fieldSize()),
      load_(u_),
      gradient_(u_),
      diagonal_(u_),
      given_(layout_.fieldSize(), 1)
{
}

std::size_t CellBody::at(Index3 node, int component) const noexcept
{
    return static_cast<std::size_t>(component) * layout_.count + layout_.at(node.x, node.y, node.z);
}

void CellBody::fill(Index3 cell, const Material& material, double fraction)
{
    const double mu = fraction * material.youngsModulus / (2.0 * (1.0 + material.poisson));
    const double lambda = 2.0 * mu * material.poisson / (1.0 - 2.0 * material.poisson);
    const std::size_t index = layout_.at(cell.x, cell.y, cell.z);
    const double scaled = side_ / 32.0;
    mu_[index] = static_cast<float>(scaled * mu);
    lambda_[index] = static_cast<float>(scaled * lambda);
    stiffening_[index] = static_cast<float>(material.stiffening);
    for (int corner = 0; corner < 8; ++corner) {
        const Index3 node = cell + Index3(corner & 1, corner >> 1 & 1, corner >> 2);
        for (int c = 0; c < 3; ++c) {
            diagonal_[at(node, c)] += side_ * (mu + lambda / 16.0);
            given_[at(node, c)] = 0;
        }
    }
}

void CellBody::prescribe(Index3 node, int component, double value)
{
    given_[at(node, component)] = 1;
    u_[at(node, component)] = value;
}

void CellBody::load(Index3 node, Vec3 force)
{
    for (int c = 0; c < 3; ++c) {
        load_[at(node, c)] += force[c];
    }
}

void CellBody::scale(double factor) noexcept
{
    for (double& u : u_) {
        u *= factor;
    }
}

Vec3 CellBody::displacement(Index3 node) const noexcept
{
    return {u_[at(node, 0)], u_[at(node, 1)], u_[at(node, 2)]};
}

Vec3 CellBody::reaction(Index3 node) const noexcept
{
    Vec3 sum(0.0);
    for (int c = 0; c < 3; ++c) {
        const std::size_t i = at(node, c);
        sum[c] = given_[i] != 0 ? static_cast<double>(force_[i]) - load_[i] : 0.0;
    }
    return sum;
}

// Energy and its gradient; both with the loads'.
void CellBody::evaluate()
{
    std::ranges::transform(u_, narrow_.begin(), [](double u) { return static_cast<float>(u); });
    energy_ = kernels().applyFinite(layout_, {mu_.data(), lambda_.data(), stiffening_.data()},
                                    static_cast<float>(1.0 / side_), narrow_.data(), force_.data(), scratch_.data());
    double open = 0.0, all = 0.0;
    for (std::size_t i = 0; i < u_.size(); ++i) {
        const double residual = static_cast<double>(force_[i]) - load_[i];
        gradient_[i] = given_[i] != 0 ? 0.0 : residual;
        open += gradient_[i] * gradient_[i];
        all += given_[i] != 0 ? residual * residual : load_[i] * load_[i];
    }
    unbalanced_ = all > 0.0 ? std::sqrt(open / all) : 0.0;
}

// The inverse's diagonal, scaled by what the last step has shown.
void CellBody::precondition(std::vector<double>& values, const QuasiNewton::Pair* last) const
{
    double scale = 0.5;
    if (last != nullptr) {
        const auto& [step, change] = *last;
        double along = 0.0, weighted = 0.0;
        for (std::size_t i = 0; i < change.size(); ++i) {
            along += step[i] * change[i];
            weighted += diagonal_[i] > 0.0 ? change[i] * change[i] / diagonal_[i] : 0.0;
        }
        scale = along / weighted;
    }
    for (std::size_t i = 0; i < values.size(); ++i) {
        values[i] *= diagonal_[i] > 0.0 ? scale / diagonal_[i] : 0.0;
    }
}

bool CellBody::solve(double tolerance, int most)
{
    evaluate();
    QuasiNewton newton(
        u_, gradient_, limits, [this] { evaluate(); },
        [this](std::vector<double>& q, const QuasiNewton::Pair* last) { precondition(q, last); });
    for (int i = 0; i < most && unbalanced_ > tolerance && !newton.stuck(); ++i) {
        newton.step();
    }
    return unbalanced_ <= tolerance;
}

}  // namespace palpate::studies
