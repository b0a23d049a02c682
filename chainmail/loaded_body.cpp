#include <chainmail/loaded_body.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <utility>

namespace palpate::chainmail {

namespace {

constexpr int whole = (1 << 20) + 1;  // nodes of a window that holds any level whole
constexpr std::size_t remembered = 8;
constexpr int maxHalvings = 16;
constexpr double balanced = 1e-3;  // fraction of the load

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

double largest(const std::vector<double>& values) noexcept
{
    double most = 0.0;
    for (const double v : values) {
        most = std::max(most, std::abs(v));
    }
    return most;
}

}  // namespace

// Pairs of a step and the change of the gradient along it.
struct LoadedBody::Memory {
    std::deque<std::pair<Values, Values>> pairs;

    void add(Values step, Values change)
    {
        if (dot(step, change) > 0.0) {
            pairs.emplace_back(std::move(step), std::move(change));
        }
        if (pairs.size() > remembered) {
            pairs.pop_front();
        }
    }
};

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

LoadedBody::Values LoadedBody::precondition(const Values& residual)
{
    stack_.clear(Field::r);
    Window& w = stack_[0];
    std::ranges::transform(residual, w.field(Field::r), [](double r) { return static_cast<float>(r); });
    multigrid_.solve();
    Values z(residual.size());
    for (std::size_t i = 0; i < z.size(); ++i) {
        z[i] = static_cast<double>(w.dof[i % w.layout.count] * w.field(Field::z)[i]);
    }
    return z;
}

// The two loops of Nocedal 1980.
LoadedBody::Values LoadedBody::direction(const Memory& memory)
{
    Values q = gradient_;
    std::vector<double> alpha;
    for (auto pair = memory.pairs.rbegin(); pair != memory.pairs.rend(); ++pair) {
        alpha.push_back(dot(pair->first, q) / dot(pair->first, pair->second));
        add(q, -alpha.back(), pair->second);
    }
    q = precondition(q);
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
// Returns how much of it; 0 where there is no way down.
double LoadedBody::advance(const Values& step)
{
    const double before = dot(gradient_, step);
    if (!(before < 0.0)) {
        return 0.0;
    }
    const Values start = u_;
    double length = 1.0;
    for (int i = 0; i < maxHalvings; ++i, length *= 0.5) {
        u_ = start;
        add(u_, length, step);
        evaluate();
        const double slope = dot(gradient_, step);
        if (std::isfinite(slope) && slope <= -0.9 * before) {
            return length;
        }
    }
    u_ = start;
    evaluate();
    return 0.0;
}

LoadedBody::Outcome LoadedBody::solve(double tolerance, int most)
{
    evaluate();
    Memory memory;
    Outcome out{residual_ <= 0.0, 0, residual_, 0.0};
    while (!out.balanced && out.steps < most) {
        ++out.steps;
        const Values u = u_, gradient = gradient_;
        const Values step = direction(memory);
        const double length = advance(step);
        out.lastStep = length * largest(step);
        out.residual = residual_;
        if (length <= 0.0) {
            if (memory.pairs.empty()) {
                break;
            }
            memory = {};
            continue;
        }
        out.balanced = length >= 1.0 && out.lastStep <= tolerance && residual_ <= balanced;
        Values moved = u_, change = gradient_;
        add(moved, -1.0, u);
        add(change, -1.0, gradient);
        memory.add(std::move(moved), std::move(change));
    }
    return out;
}

}  // namespace palpate::chainmail
