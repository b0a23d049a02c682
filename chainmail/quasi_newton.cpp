#include <chainmail/quasi_newton.h>

#include <algorithm>
#include <cmath>

namespace palpate::chainmail {

namespace {

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

QuasiNewton::QuasiNewton(Values& u, const Values& gradient, Limits limits, std::function<void()> evaluate,
                         std::function<void(Values&, const Pair*)> guess)
    : u_(u), gradient_(gradient), limits_(limits), evaluate_(std::move(evaluate)), guess_(std::move(guess))
{
}

// The two loops of Nocedal 1980.
QuasiNewton::Values QuasiNewton::direction() const
{
    Values q = gradient_;
    std::vector<double> alpha;
    for (auto pair = pairs_.rbegin(); pair != pairs_.rend(); ++pair) {
        alpha.push_back(dot(pair->first, q) / dot(pair->first, pair->second));
        add(q, -alpha.back(), pair->second);
    }
    guess_(q, pairs_.empty() ? nullptr : &pairs_.back());
    for (const auto& [step, change] : pairs_) {
        add(q, alpha.back() - dot(change, q) / dot(step, change), step);
        alpha.pop_back();
    }
    for (double& v : q) {
        v = -v;
    }
    return q;
}

double QuasiNewton::advance(const Values& start, const Values& step)
{
    const double before = dot(gradient_, step);
    if (!(before < 0.0)) {
        return 0.0;
    }
    double length = 1.0;
    for (int i = 0; i < limits_.halvings; ++i, length *= 0.5) {
        u_ = start;
        add(u_, length, step);
        evaluate_();
        const double slope = dot(gradient_, step);
        if (std::isfinite(slope) && slope <= -0.9 * before) {
            return length;
        }
    }
    u_ = start;
    evaluate_();
    return 0.0;
}

double QuasiNewton::step()
{
    const Values start = u_, gradient = gradient_;
    const Values whole = direction();
    const double length = advance(start, whole);
    largest_ = 0.0;
    for (const double v : whole) {
        largest_ = std::max(largest_, std::abs(v));
    }
    stuck_ = length <= 0.0 && pairs_.empty();
    if (length <= 0.0) {
        pairs_.clear();
        return 0.0;
    }
    Values moved = u_, change = gradient_;
    add(moved, -1.0, start);
    add(change, -1.0, gradient);
    if (dot(moved, change) > 0.0) {
        pairs_.emplace_back(std::move(moved), std::move(change));
    }
    if (pairs_.size() > limits_.remembered) {
        pairs_.pop_front();
    }
    return length;
}

}  // namespace palpate::chainmail
