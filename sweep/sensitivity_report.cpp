#include <sweep/report.h>

#include <base/mapped.h>
#include <base/rank_correlation.h>
#include <sweep/sensitivity.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace palpate::sweep {

using nlohmann::json;

namespace {

json number(double v)
{
    return std::isfinite(v) ? json(v) : json();
}

// Mean over the repeats of each point; not finite where none was done.
std::vector<double> meansOf(const SweepPlan& plan, const std::vector<std::optional<SweepRow>>& rows, std::size_t output)
{
    std::vector<double> sum(plan.points.size(), 0.0), count(plan.points.size(), 0.0);
    for (const auto& row : rows) {
        if (row && !row->failed() && std::isfinite(row->outputs[output])) {
            sum[row->index / plan.repeats] += row->outputs[output];
            count[row->index / plan.repeats] += 1;
        }
    }
    for (std::size_t i = 0; i < sum.size(); ++i) {
        sum[i] = count[i] > 0 ? sum[i] / count[i] : std::numeric_limits<double>::quiet_NaN();
    }
    return sum;
}

struct Ranking {
    std::string method;
    std::vector<std::string> measures;
    std::size_t block;  // points in a row that make a sample
    // For an output's means: the measures of each axis; empty: none can be had. The first one decides the order.
    std::vector<std::vector<double>> (*of)(const SweepPlan&, const std::vector<double>&);
};

std::vector<std::vector<double>> bySobol(const SweepPlan& plan, const std::vector<double>& means)
{
    return base::mapped<std::vector<double>>(sobolIndices(means, plan.axes.size()), [&](const SobolIndex& i) {
        return std::vector<double>{i.total, i.totalError, i.first, i.firstError};
    });
}

std::vector<std::vector<double>> byMorris(const SweepPlan& plan, const std::vector<double>& means)
{
    UnitPoints places = plan.points;
    for (auto& point : places) {
        for (std::size_t a = 0; a < point.size(); ++a) {
            point[a] = plan.axes[a].placeAt(point[a]);
        }
    }
    return base::mapped<std::vector<double>>(morrisEffects(places, means), [&](const MorrisEffect& e) {
        return std::vector<double>{e.absolute, e.mean, e.spread};
    });
}

std::vector<std::vector<double>> byShare(const SweepPlan& plan, const std::vector<double>& means)
{
    std::vector<std::vector<double>> out;
    const bool whole = std::ranges::all_of(means, [](double v) { return std::isfinite(v); });
    for (std::size_t a = 0; whole && a < plan.axes.size(); ++a) {
        const auto level =
            base::mapped<std::size_t>(plan.points, [&](const auto& point) { return static_cast<std::size_t>(point[a]); });
        out.push_back({mainEffect(means, level)});
    }
    return out;
}

std::vector<std::vector<double>> byRank(const SweepPlan& plan, const std::vector<double>& means)
{
    std::vector<std::vector<double>> out;
    for (std::size_t a = 0; a < plan.axes.size(); ++a) {
        std::vector<double> x, y;
        for (std::size_t p = 0; p < means.size(); ++p) {
            const auto at = numberOf(sweepPoint(plan, p * plan.repeats).parameters[a]);
            if (at && std::isfinite(means[p])) {
                x.push_back(*at);
                y.push_back(means[p]);
            }
        }
        const double r = x.size() > 2 ? base::rankCorrelation(x, y) : std::numeric_limits<double>::quiet_NaN();
        out.push_back({std::abs(r), r});
    }
    return out;
}

Ranking rankingOf(const SweepPlan& plan)
{
    switch (plan.design) {
        case DesignKind::saltelli:
            return {
                "Sobol's indices: shares of the variance, with all that an axis has a part in (total) and by itself "
                "(first); errors: half of a 95 % interval",
                {"total", "total_error", "first", "first_error"},
                plan.axes.size() + 2,
                bySobol};
        case DesignKind::morris:
            return {"Morris's elementary effects over the whole range: mean size, mean, spread",
                    {"mu_star", "mu", "sigma"},
                    plan.axes.size() + 1,
                    byMorris};
        case DesignKind::grid:
            if (plan.constraints.empty()) {
                return {"Share of the variance over the grid that an axis makes by itself", {"share"}, 1, byShare};
            }
            break;
        case DesignKind::list:
        case DesignKind::latinHypercube:
        case DesignKind::sobol:
            break;
    }
    return {
        "Spearman's rank correlation of axis and output: its size, and with its sign", {"size", "correlation"}, 1, byRank};
}

}  // namespace

json sensitivity(const SweepPlan& plan, const std::vector<std::optional<SweepRow>>& rows)
{
    const Ranking ranking = rankingOf(plan);
    json outputs = json::object(), used = json::object();
    for (std::size_t o = 0; o < plan.outputs.size(); ++o) {
        const auto means = meansOf(plan, rows, o);
        auto values = ranking.of(plan, means);
        if (values.empty()) {
            const std::vector<double> none(ranking.measures.size(), std::numeric_limits<double>::quiet_NaN());
            values.assign(plan.axes.size(), none);
        }
        std::vector<std::pair<double, json>> ranked;
        for (std::size_t a = 0; a < values.size(); ++a) {
            json of = json::array();
            std::ranges::transform(values[a], std::back_inserter(of), number);
            ranked.emplace_back(std::isfinite(values[a][0]) ? values[a][0] : -1.0,
                                json{{"axis", plan.axes[a].name}, {"values", std::move(of)}});
        }
        std::ranges::stable_sort(ranked, std::greater(), &std::pair<double, json>::first);
        json list = json::array();
        for (auto& [size, entry] : ranked) {
            list.push_back(std::move(entry));
        }
        outputs[plan.outputs[o].name] = std::move(list);
        used[plan.outputs[o].name] = wholeSamples(means, ranking.block);
    }
    return {{"method", ranking.method},
            {"measures", ranking.measures},
            {"outputs", std::move(outputs)},
            {"used", std::move(used)},
            {"samples", plan.points.size() / ranking.block}};
}

}  // namespace palpate::sweep
