#include <studies/kernel/figures.h>

#include <base/mapped.h>
#include <command/json.h>
#include <datasets/scene.h>
#include <report/chart/chart.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>

namespace palpate::studies {

namespace {

constexpr std::array<std::pair<const char*, double TrialErrors::*>, 6> errorNames{{{"rms", &TrialErrors::rms},
                                                                                   {"near", &TrialErrors::near},
                                                                                   {"max", &TrialErrors::max},
                                                                                   {"force", &TrialErrors::force},
                                                                                   {"energy", &TrialErrors::energy},
                                                                                   {"volume", &TrialErrors::volume}}};
constexpr std::array<const char*, 4> phaseNames{"press", "turn", "drag", "rest"};

// Those of all looks, and of the state at rest.
void addErrors(nlohmann::json& out, const TrialResult& result)
{
    out.update(errorFigures(result.looks));
    for (const auto& [name, figure] : errorNames) {
        out[fmt::format("{}_rest_pct", name)] = atRest(result).*figure;
    }
    out["tick_us_p50"] = 1e6 * result.p50;
    out["tick_us_mean"] = 1e6 * result.mean;
    out["tick_us_p99"] = 1e6 * result.p99;
}

nlohmann::json looksOf(const TrialResult& result)
{
    auto looks = nlohmann::json::array();
    for (const TrialErrors& e : result.looks) {
        nlohmann::json look{{"phase", phaseNames[static_cast<std::size_t>(e.phase)]}};
        for (const auto& [name, figure] : errorNames) {
            look[fmt::format("{}_pct", name)] = e.*figure;
        }
        looks.push_back(look);
    }
    return looks;
}

nlohmann::json rivalFigures(const KernelCase& c)
{
    const KernelRivals& r = *c.rivals;
    auto grids = nlohmann::json::array();
    for (const RivalRun& run : r.singleGrids) {
        nlohmann::json grid{{"coarsening", run.coarsening},
                            {"cycles", run.cycles},
                            {"nodes", run.nodes},
                            {"spacing_mm", 1e3 * c.spacing * run.coarsening}};
        addErrors(grid, run.result);
        grids.push_back(grid);
    }
    nlohmann::json out{{"full_solve_us", 1e6 * r.full.warm},
                       {"full_solve_from_rest_us", 1e6 * r.full.fromRest},
                       {"full_solve_ratio", r.full.warm / c.result.mean},
                       {"full_solve_from_rest_ratio", r.full.fromRest / c.result.mean},
                       {"coarse_grid_ratio", singleGridRatio(c, &TrialErrors::rms)},
                       {"coarse_grid_near_ratio", singleGridRatio(c, &TrialErrors::near)},
                       {"coarse_grid_force_ratio", singleGridRatio(c, &TrialErrors::force)},
                       {"single_grids", grids}};
    addErrors(out["no_increment"], r.standing);
    addErrors(out["chainmail"], r.chainMail);
    addErrors(out["nothing"], r.nothing);
    for (const char* shapeOnly : {"chainmail", "nothing"}) {
        for (const char* key :
             {"force_pct", "force_worst_pct", "force_rest_pct", "energy_pct", "energy_worst_pct", "energy_rest_pct"}) {
            out[shapeOnly][key] = nullptr;
        }
    }
    return out;
}

nlohmann::json workFigures(std::span<const KernelWork> work)
{
    return base::mapped<nlohmann::json>(work, [](const KernelWork& w) -> nlohmann::json {
        const double kilobytes = 1e-3 * w.bytes;
        return {{"operation", w.operation},
                {"purpose", w.purpose},
                {"calls", w.calls},
                {"nodes", w.nodes},
                {"kilobytes", kilobytes}};
    });
}

nlohmann::json caseFigures(const KernelCase& c, const MachineRates& rates)
{
    nlohmann::json out{{"scene", c.scene},
                       {"tool", c.tool},
                       {"speed_mm_s", 1e3 * c.speed},
                       {"setting", c.setting},
                       {"spacing_mm", 1e3 * c.spacing},
                       {"window", c.window},
                       {"cycles", c.cycles},
                       {"nodes", c.nodes},
                       {"full_nodes", c.fullNodes},
                       {"ticks", c.result.ticks},
                       {"contact_points", c.result.meanTouched},
                       {"shortened_steps", c.result.shortened},
                       {"window_moves", c.result.windowMoves},
                       {"strain", c.strain},
                       {"reference_residual", c.residual},
                       {"looks", looksOf(c.result)},
                       {"tick_us_cpu", 1e6 * c.result.cpu},
                       {"tick_bound_us", 1e6 * minTime(c.work, rates)},
                       {"tick_bound_fraction", minTime(c.work, rates) / c.result.cpu},
                       {"work", workFigures(c.work)}};
    addErrors(out, c.result);
    if (c.rivals) {
        out["rivals"] = rivalFigures(c);
    }
    return out;
}

nlohmann::json operatorFigures(const OperatorBench& bench)
{
    auto out = nlohmann::json::array();
    for (const OperatorCase& c : bench.cases) {
        out.push_back({{"set", c.set},
                       {"strain", c.finiteStrain ? "finite" : "small"},
                       {"window", c.window},
                       {"ns_per_node", 1e9 * c.secondsPerNode},
                       {"bound_ns_per_node", 1e9 * c.boundPerNode},
                       {"bound_by", c.boundByMemory ? "memory" : "arithmetic"},
                       {"bound_fraction", c.boundFraction()}});
    }
    return out;
}

nlohmann::json machineFigures(const OperatorBench& bench)
{
    nlohmann::json out;
    for (const auto& set : bench.sets) {
        out[set.name] = {{"additions_per_ns", 1e-9 * set.rates.additions},
                         {"multiplications_per_ns", 1e-9 * set.rates.multiplications},
                         {"both_per_ns", 1e-9 * set.rates.both},
                         {"copy_bytes_per_ns", 1e-9 * set.rates.bytes}};
    }
    for (const bool finite : {false, true}) {
        const OperatorCost cost = operatorCost(finite);
        out[finite ? "finite_cell" : "small_cell"] = {
            {"additions", cost.additions}, {"multiplications", cost.multiplications}, {"bytes", cost.bytes}};
    }
    return out;
}

// Median over the cases with rivals of one of their ratios; 0 without.
double medianRatio(const nlohmann::json& cases, const char* key)
{
    std::vector<double> values;
    for (const auto& c : cases) {
        if (c.contains("rivals")) {
            values.push_back(c["rivals"][key].get<double>());
        }
    }
    return median(values);
}

// Points of one name, in the order in which they come.
class SeriesList {
public:
    void add(const std::string& name, bool line, double microseconds, double error)
    {
        auto found = std::ranges::find(series_, name, &report::ChartSeries::name);
        if (found == series_.end()) {
            series_.push_back({name, {}, {}, line});
            found = series_.end() - 1;
        }
        found->add(microseconds, error);
    }
    std::vector<report::ChartSeries> take() { return std::move(series_); }

private:
    std::vector<report::ChartSeries> series_;
};

double medianOf(const TrialResult& result, double TrialErrors::*figure)
{
    return spreadOf(result.looks, figure).median;
}

report::Chart errorChart(const std::vector<KernelCase>& cases, const char* what, double TrialErrors::*figure, double bound)
{
    SeriesList list;
    for (const KernelCase& c : cases) {
        list.add(fmt::format("{}, {:g} mm/s", c.setting, 1e3 * c.speed), false, 1e6 * c.result.mean,
                 medianOf(c.result, figure));
    }
    for (const KernelCase& c : cases) {
        if (!c.rivals) {
            continue;
        }
        for (const RivalRun& run : c.rivals->singleGrids) {
            list.add(run.coarsening == 1 ? "whole grid, per tick" : fmt::format("one grid, {} h", run.coarsening), false,
                     1e6 * run.result.mean, medianOf(run.result, figure));
        }
        if (figure != &TrialErrors::force) {
            list.add("default, no increment", false, 1e6 * c.rivals->standing.mean, medianOf(c.rivals->standing, figure));
            list.add("chainmail", false, 1e6 * c.rivals->chainMail.mean, medianOf(c.rivals->chainMail, figure));
        }
    }
    report::Chart chart{fmt::format("Level elastic: {} against time", what), "time per tick, mean [us]",
                        fmt::format("{} [%]", what), true, true};
    chart.series = list.take();
    chart.bounds.push_back({fmt::format("{:g} %", bound), bound});
    chart.note =
        "One point per scene, tool and speed: median over the looks of a push, a drag and a rest, against the whole grid "
        "solved. h is the spacing of setting default.";
    return chart;
}

}  // namespace

std::vector<int> operatorWindows(const std::vector<std::string>& settings)
{
    auto windows =
        base::mapped<int>(settings, [&](const std::string& setting) { return datasets::elasticSetting(setting).window; });
    windows.push_back(datasets::elasticSetting("default").window);
    if (!settings.empty()) {
        windows.push_back(31);  // fills its rows, and leaves the first-level cache
    }
    std::ranges::sort(windows);
    windows.erase(std::unique(windows.begin(), windows.end()), windows.end());
    return windows;
}

nlohmann::json errorFigures(std::span<const TrialErrors> looks)
{
    nlohmann::json out;
    for (const auto& [name, figure] : errorNames) {
        const Spread spread = spreadOf(looks, figure);
        out[fmt::format("{}_pct", name)] = spread.median;
        out[fmt::format("{}_worst_pct", name)] = spread.worst;
    }
    return out;
}

double singleGridRatio(const KernelCase& c, double TrialErrors::*figure)
{
    return c.rivals ? ratioAtEqualError(c.rivals->singleGrids, figure, medianOf(c.result, figure), c.result.mean) : 0.0;
}

nlohmann::json kernelFigures(const std::vector<KernelCase>& cases, const OperatorBench& operators,
                             const std::string& headline)
{
    nlohmann::json list = base::mapped<nlohmann::json>(
        cases, [&](const KernelCase& c) { return caseFigures(c, operators.sets.back().rates); });
    const int window = datasets::elasticSetting("default").window;
    const std::string& widest = operators.sets.back().name;
    const OperatorCase& best = caseOf(operators, widest, false, window);
    nlohmann::json out{{"cases", list},
                       {"headline_setting", headline},
                       {"operator_set", widest},
                       {"operator_window", window},
                       {"operator_ns_per_node", 1e9 * best.secondsPerNode},
                       {"bound_fraction", best.boundFraction()},
                       {"operators", operatorFigures(operators)},
                       {"machine", machineFigures(operators)}};
    for (const OperatorCase& c : operators.cases) {
        if (c.window == window) {
            out["operator_ns_per_node_by_set"][c.finiteStrain ? c.set + ", finite strain" : c.set] = 1e9 * c.secondsPerNode;
        }
    }
    for (const char* key : {"full_solve_ratio", "full_solve_from_rest_ratio", "coarse_grid_ratio", "coarse_grid_near_ratio",
                            "coarse_grid_force_ratio"}) {
        out[key] = medianRatio(list, key);
    }
    return out;
}

void printSummary(const nlohmann::json& figures)
{
    const auto number = [&](const char* key) { return figures.at(key).get<double>(); };
    fmt::print("\n{}, window {}: {:.2f} ns per node, {:.0f} % of the bound\n",
               figures.at("operator_set").get<std::string>(), figures.at("operator_window").get<int>(),
               number("operator_ns_per_node"), 100.0 * number("bound_fraction"));
    fmt::print(
        "setting {}, medians: {:.0f} x faster than the whole grid solved in every tick ({:.0f} x: from rest); {:.1f} x "
        "faster than the best single grid with the same rms error ({:.1f} x: near error, {:.1f} x: force)\n",
        figures.at("headline_setting").get<std::string>(), number("full_solve_ratio"), number("full_solve_from_rest_ratio"),
        number("coarse_grid_ratio"), number("coarse_grid_near_ratio"), number("coarse_grid_force_ratio"));
}

void writeKernelFolder(const std::filesystem::path& folder, const nlohmann::json& figures,
                       const std::vector<KernelCase>& cases)
{
    std::filesystem::create_directories(folder);
    command::writeJson(folder / "kernel.json", figures);
    const std::array charts{errorChart(cases, "RMS error", &TrialErrors::rms, 1.0),
                            errorChart(cases, "error near the contact", &TrialErrors::near, 2.0),
                            errorChart(cases, "force error", &TrialErrors::force, 2.0)};
    report::writeChartPng(charts[0], folder / "kernel.png");
    report::writeChartHtml(charts, "Level elastic: error against time", folder / "kernel.html");
}

}  // namespace palpate::studies
