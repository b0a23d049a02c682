#include <studies/validate/cell_body.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <utility>

namespace palpate::studies {

using namespace chainmail;

namespace {

constexpr std::size_t remembered = 6;  // steps: more cost more than they save
constexpr int maxHalvings = 12;

double dot(const std::vector<double>& a, const std::vector<double>& b) noexcept
{
    double sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        sum += a[i] * b[i];
    }
    return sum;
}

void add(std::vector<double>& to, double factor, const std::vector<double>& what) noexcept
{
    for (std::size_t i = 0; i < to.size(); ++i) {
        to[i] += factor * what[i];
    }
}

}  // namespace

// Pairs of a step and the change of the gradient along it.
struct CellBody::Memory {
    std::deque<std::pair<std::vector<double>, std::vector<double>>> pairs;

    void add(std::vector<double> step, std::vector<double> change)
    {
        if (dot(step, change) > 0.0) {
            pairs.emplace_back(std::move(step), std::move(change));
        }
        if (pairs.size() > remembered) {
            pairs.pop_front();
        }
    }
};

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

// The two loops of Nocedal 1980.
std::vector<double> CellBody::direction(const Memory& memory) const
{
    std::vector<double> q = gradient_;
    std::vector<double> alpha;
    for (auto pair = memory.pairs.rbegin(); pair != memory.pairs.rend(); ++pair) {
        alpha.push_back(dot(pair->first, q) / dot(pair->first, pair->second));
        add(q, -alpha.back(), pair->second);
    }
    double scale = 0.5;
    if (!memory.pairs.empty()) {
        const auto& [step, change] = memory.pairs.back();
        double weighted = 0.0;
        for (std::size_t i = 0; i < change.size(); ++i) {
            weighted += diagonal_[i] > 0.0 ? change[i] * change[i] / diagonal_[i] : 0.0;
        }
        scale = dot(step, change) / weighted;
    }
    for (std::size_t i = 0; i < q.size(); ++i) {
        q[i] *= diagonal_[i] > 0.0 ? scale / diagonal_[i] : 0.0;
    }
    for (const auto& [step, change] : memory.pairs) {
        add(q, alpha.back() - dot(change, q) / dot(step, change), step);
        alpha.pop_back();
    }
    for (double& v : q) {
        v = -v;
    }
    return q;
}

// Goes along `step`, halved until the slope there is no longer steeply up: the energy's last bits are too coarse to tell.
bool CellBody::advance(const std::vector<double>& step)
{
    const double before = dot(gradient_, step);
    if (!(before < 0.0)) {
        return false;
    }
    double gone = 1.0;
    add(u_, 1.0, step);
    for (int i = 0; i < maxHalvings; ++i) {
        evaluate();
        const double slope = dot(gradient_, step);
        if (std::isfinite(slope) && slope <= -0.9 * before) {
            return true;
        }
        add(u_, -0.5 * gone, step);
        gone *= 0.5;
    }
    add(u_, -gone, step);
    evaluate();
    return false;
}

bool CellBody::solve(double tolerance, int most)
{
    evaluate();
    Memory memory;
    for (int i = 0; i < most && unbalanced_ > tolerance; ++i) {
        const std::vector<double> u = u_, gradient = gradient_;
        if (!advance(direction(memory))) {
            if (memory.pairs.empty()) {
                return false;
            }
            memory = {};
            continue;
        }
        std::vector<double> step = u_, change = gradient_;
        add(step, -1.0, u);
        add(change, -1.0, gradient);
        memory.add(std::move(step), std::move(change));
    }
    return unbalanced_ <= tolerance;
}

}  // namespace palpate::studies
