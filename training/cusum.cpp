#include <training/cusum.h>

#include <Eigen/Dense>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <map>

namespace palpate::training {

constexpr std::size_t maxStates = 2000;  // of a chain; finer values are merged beyond

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

double averageRunLength(const CusumPlan& plan, CusumChart chart, double failureRate)
{
    const double sign = chart == CusumChart::alarm ? 1 : -1;
    const double limit = (chart == CusumChart::alarm ? plan.alarmLimit() : plan.learningLimit()) - cusumTie;
    const double steps[2] = {sign * plan.failureWeight(), sign * plan.successWeight()};
    const double chances[2] = {failureRate, 1 - failureRate};

    // All values that can be reached, by what is the same within rounding, or within the limit's share where there are
    // many.
    const double grain = std::max(1e-7, limit / static_cast<double>(maxStates));
    std::map<std::int64_t, std::size_t> index;
    std::vector<double> values;
    const auto stateOf = [&](double value) {
        const auto [at, made] = index.emplace(std::llround(value / grain), values.size());
        if (made) {
            values.push_back(value);
        }
        return at->second;
    };
    stateOf(0);
    struct Arrow {
        std::size_t from, to;
        double chance;
    };
    std::vector<Arrow> arrows;
    for (std::size_t i = 0; i < values.size(); ++i) {
        for (int k = 0; k < 2; ++k) {
            const double next = std::max(0.0, values[i] + steps[k]);
            if (chances[k] > 0 && next < limit) {
                arrows.push_back({i, stateOf(next), chances[k]});
            }
        }
    }
    // m = 1 + Q m, from the state 0.
    const auto n = static_cast<Eigen::Index>(values.size());
    Eigen::MatrixXd system = Eigen::MatrixXd::Identity(n, n);
    for (const Arrow& a : arrows) {
        system(static_cast<Eigen::Index>(a.from), static_cast<Eigen::Index>(a.to)) -= a.chance;
    }
    const Eigen::PartialPivLU<Eigen::MatrixXd> solver(system);
    const double length = solver.solve(Eigen::VectorXd::Ones(n))(0);
    return std::isfinite(length) && length >= 1 && length < 1e12 ? length : std::numeric_limits<double>::infinity();
}

}  // namespace palpate::training
