#include <chainmail/loaded_body.h>

#include <chainmail/quasi_newton.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::chainmail {

constexpr int whole = (1 << 20) + 1;  // nodes of a window that holds any level whole
constexpr QuasiNewton::Limits limits{8, 16};
constexpr double balanced = 1e-3;    // fraction of the load
constexpr double atMost = 0.03;      // the same where displacements are too coarse for it
constexpr double lastBit = 0x1p-24;  // of a number in single precision

LoadedBody::LoadedBody(const ElasticBody& body)
    : body_(body),
      stack_(body, whole, Focus()),
      multigrid_(stack_, 0),
      u_(3 * stack_[0].layout.count),
      load_(u_),
      gradient_(u_)
{
    multigrid_.prepare();
}

void LoadedBody::load(Index3 node, Vec3 force) noexcept
{
    const Window& w = stack_[0];
    const std::size_t at = w.at(node);
    for (int c = 0; c < 3 && w.dof[at] > 0.0F; ++c) {
        load_[static_cast<std::size_t>(c) * w.layout.count + at] += force[c];
    }
}

void LoadedBody::place(Index3 node, Vec3 displacement) noexcept
{
    const Window& w = stack_[0];
    const std::size_t at = w.at(node);
    for (int c = 0; c < 3 && w.dof[at] > 0.0F; ++c) {
        u_[static_cast<std::size_t>(c) * w.layout.count + at] = displacement[c];
    }
}

Vec3 LoadedBody::displacement(Index3 node) const noexcept
{
    const Window& w = stack_.windows()[0];
    const std::size_t at = w.at(node);
    return {u_[at], u_[w.layout.count + at], u_[2 * w.layout.count + at]};
}

Vec3 LoadedBody::reaction() const noexcept
{
    const Window& w = stack_.windows()[0];
    Vec3 sum(0.0);
    for (int c = 0; c < 3; ++c) {
        const float* force = w.field(Field::a) + static_cast<std::size_t>(c) * w.layout.count;
        for (std::size_t i = 0; i < w.layout.count; ++i) {
            sum[c] += w.dof[i] > 0.0F ? 0.0 : static_cast<double>(force[i]);
        }
    }
    return sum;
}

// The energy's gradient, with the loads'. Where a component is 0 at the end of a row of padding it stays 0.
void LoadedBody::evaluate()
{
    Window& w = stack_[0];
    std::ranges::transform(u_, w.field(Field::u), [](double u) { return static_cast<float>(u); });
    const auto inverse = static_cast<float>(1.0 / body_.levels.front().nodes.spacing);
    stack_.kernels().applyFinite(w.layout, w.stiffness(), inverse, w.field(Field::u), w.field(Field::a), stack_.scratch());
    double open = 0.0, all = 0.0;
    for (std::size_t i = 0; i < u_.size(); ++i) {
        const double free = static_cast<double>(w.dof[i % w.layout.count]);
        gradient_[i] = free * (static_cast<double>(w.field(Field::a)[i]) - load_[i]);
        open += gradient_[i] * gradient_[i];
        all += load_[i] * load_[i];
    }
    residual_ = all > 0.0 ? std::sqrt(open / all) : 0.0;
}

void LoadedBody::precondition(std::vector<double>& values)
{
    stack_.clear(Field::r);
    Window& w = stack_[0];
    std::ranges::transform(values, w.field(Field::r), [](double r) { return static_cast<float>(r); });
    multigrid_.solve();
    for (std::size_t i = 0; i < values.size(); ++i) {
        values[i] = static_cast<double>(w.dof[i % w.layout.count] * w.field(Field::z)[i]);
    }
}

// What rounding alone leaves out of balance: a displacement's last bit, and that of a strain in a cell, times the
// stiffness.
double LoadedBody::rounding() const noexcept
{
    const Window& w = stack_.windows()[0];
    const CellLevel& level = body_.levels.front();
    double shaken = 0.0, all = 0.0;
    volume::forEachIndex(Index3(0), level.nodes.size - 1, [&](Index3 n) {
        const std::size_t at = w.at(n);
        if (w.dof[at] > 0.0F) {
            const double moved = level.nodes.spacing + glm::length(displacement(n));
            shaken += std::pow(static_cast<double>(level.diagonal[level.nodes.offset(n)]) * lastBit * moved, 2);
            for (std::size_t i = at; i < load_.size(); i += w.layout.count) {
                all += load_[i] * load_[i];
            }
        }
    });
    return all > 0.0 ? std::sqrt(shaken / all) : 0.0;
}

LoadedBody::Outcome LoadedBody::solve(double tolerance, int most)
{
    evaluate();
    QuasiNewton newton(
        u_, gradient_, limits, [this] { evaluate(); },
        [this](std::vector<double>& q, const QuasiNewton::Pair*) { precondition(q); });
    Outcome out{residual_ <= 0.0, 0, residual_, 0.0};
    while (!out.balanced && !newton.stuck() && out.steps < most) {
        ++out.steps;
        const double length = newton.step();
        out.lastStep = length * newton.largest();
        out.residual = residual_;
        out.balanced = newton.largest() <= tolerance && residual_ <= std::max(balanced, std::min(atMost, rounding()));
    }
    return out;
}

}  // namespace palpate::chainmail
