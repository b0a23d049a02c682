#include <training/cusum.h>

#include <Eigen/SparseLU>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <utility>

namespace palpate::training {

constexpr std::size_t maxStates = 2000;  // of a chain

std::vector<CusumPoint> cusum(const CusumPlan& plan, const std::vector<bool>& failed)
{
    std::vector<CusumPoint> points;
    double alarm = 0, learning = 0;
    for (const bool f : failed) {
        const double weight = f ? plan.failureWeight() : plan.successWeight();
        CusumPoint p;
        p.alarm = std::max(0.0, alarm + weight);
        p.learning = std::max(0.0, learning - weight);
        p.alarmed = p.alarm >= plan.alarmLimit() - cusumTie;
        p.proficient = p.learning >= plan.learningLimit() - cusumTie;
        alarm = p.alarmed ? 0 : p.alarm;
        learning = p.proficient ? 0 : p.learning;
        points.push_back(p);
    }
    return points;
}

namespace {

struct RunArrow {
    std::size_t from, to;
    double chance;
};
struct RunChain {
    std::size_t states = 0;  // the first is 0; what has no arrow ends in a signal
    std::vector<RunArrow> arrows;
};
struct RunStep {
    double by, chance;
};

// All values that can be reached, by what is the same within rounding. None where there are too many.
std::optional<RunChain> reachable(const std::array<RunStep, 2>& steps, double limit)
{
    constexpr double grain = 1e-9;
    std::map<std::int64_t, std::size_t> index{{0, 0}};
    std::vector<double> values{0};
    RunChain chain;
    for (std::size_t i = 0; i < values.size(); ++i) {
        for (const RunStep& step : steps) {
            const double next = std::max(0.0, values[i] + step.by);
            if (step.chance <= 0 || next >= limit) {
                continue;
            }
            const auto [at, made] = index.emplace(std::llround(next / grain), values.size());
            if (made) {
                values.push_back(next);
            }
            chain.arrows.push_back({i, at->second, step.chance});
        }
        if (values.size() > maxStates) {
            return std::nullopt;
        }
    }
    chain.states = values.size();
    return chain;
}

// Evenly spaced values: a step that ends between two of them ends in both, so that it is as long on average as it is.
RunChain spaced(const std::array<RunStep, 2>& steps, double limit)
{
    RunChain chain{maxStates, {}};
    for (std::size_t i = 0; i < maxStates; ++i) {
        for (const RunStep& step : steps) {
            const double next = std::max(0.0, static_cast<double>(i) + step.by / limit * static_cast<double>(maxStates));
            const auto below = static_cast<std::size_t>(std::min(next, static_cast<double>(maxStates)));
            const double above = next - std::floor(next);
            for (const auto& [to, share] : {std::pair(below, 1 - above), std::pair(below + 1, above)}) {
                if (to < maxStates && step.chance * share > 0) {
                    chain.arrows.push_back({i, to, step.chance * share});
                }
            }
        }
    }
    return chain;
}

}  // namespace

double averageRunLength(const CusumPlan& plan, CusumChart chart, double failureRate)
{
    const double sign = chart == CusumChart::alarm ? 1 : -1;
    const double limit = (chart == CusumChart::alarm ? plan.alarmLimit() : plan.learningLimit()) - cusumTie;
    const std::array<RunStep, 2> steps{
        {{sign * plan.failureWeight(), failureRate}, {sign * plan.successWeight(), 1 - failureRate}}};
    const auto few = reachable(steps, limit);
    const auto [states, arrows] = few ? *few : spaced(steps, limit);
    // m = 1 + Q m, from the state 0. A state has at most four arrows: a full matrix of 2000 states took seconds.
    const auto n = static_cast<Eigen::Index>(states);
    std::vector<Eigen::Triplet<double>> entries;
    for (Eigen::Index i = 0; i < n; ++i) {
        entries.emplace_back(static_cast<int>(i), static_cast<int>(i), 1.0);
    }
    for (const RunArrow& a : arrows) {
        entries.emplace_back(static_cast<int>(a.from), static_cast<int>(a.to), -a.chance);
    }
    Eigen::SparseMatrix<double> system(n, n);
    system.setFromTriplets(entries.begin(), entries.end());
    Eigen::SparseLU<Eigen::SparseMatrix<double>> solver(system);
    if (solver.info() != Eigen::Success) {
        return std::numeric_limits<double>::infinity();  // no signal can come
    }
    const double length = solver.solve(Eigen::VectorXd::Ones(n))(0);
    return std::isfinite(length) && length >= 1 && length < 1e12 ? length : std::numeric_limits<double>::infinity();
}

}  // namespace palpate::training
