#include <studies/stability/figures.h>

#include <base/mapped.h>
#include <base/outputs.h>
#include <command/json.h>
#include <report/html.h>
#include <studies/stability/theory.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <optional>

namespace palpate::studies {

using nlohmann::json;

namespace {

constexpr std::array cellColumns{"id",   "scene",  "method",  "device", "grip", "rate_hz",
                                 "pass", "figure", "measure", "unit",   "bound"};

std::string csvCell(const json& value)
{
    return value.is_string() ? value.get<std::string>() : value.is_null() ? std::string() : value.dump();
}

// A figure against a number in the scenes' names: "slide-30deg-20mm_s" with prefix "slide-" and ending "deg-20mm_s" is 30.
struct StabilityView {
    const char *file, *title, *prefix, *ending, *xLabel, *yLabel;
};
constexpr StabilityView views[] = {
    {"ripple", "Sliding over a staircase of voxels at 20 mm/s", "slide-", "deg-20mm_s",
     "slope against the voxels [degrees]", "ripple [% of the force]"},
    {"ridge", "Dragged across a ridge at 40 mm/s", "outer-", "deg", "angle of the ridge [degrees]",
     "largest force step [% of the cap per ms]"},
    {"groove", "Dragged across a groove at 40 mm/s", "inner-", "deg", "angle of the groove [degrees]",
     "largest force step [% of the cap per ms]"},
    {"late", "Poses that stop ten times a second", "late-", "ms", "how long they stop [ms]", "energy made [J]"},
};

// The number in a scene's name, or nothing.
std::optional<double> numberIn(const std::string& scene, const StabilityView& view)
{
    if (!scene.starts_with(view.prefix)) {
        return std::nullopt;
    }
    char* end = nullptr;
    const char* const begin = scene.c_str() + std::string_view(view.prefix).size();
    const double value = std::strtod(begin, &end);
    return end != begin && std::string_view(end) == view.ending ? std::optional(value) : std::nullopt;
}

// The premium device under a hand that holds on, at 1 kHz.
std::optional<report::Chart> chartOfView(const json& figures, const StabilityView& view)
{
    report::Chart chart{view.title, view.xLabel, view.yLabel, false, true};
    for (const auto& method : namesOf(figures, "method")) {
        report::ChartSeries series{method, {}, {}, true};
        for (const json& cell : figures.at("cells")) {
            const auto x = numberIn(cell.at("scene"), view);
            if (x && cell.at("method") == method && cell.at("device") == "premium" && cell.at("grip") == "grip" &&
                cell.at("rate_hz") == 1000 && cell.at("figure").is_number()) {
                series.add(*x, std::max(cell.at("figure").get<double>(), 1e-6));
                chart.bounds = {{fmt::format("bound: {:g}", cell.at("bound").get<double>()), cell.at("bound")}};
            }
        }
        if (!series.x.empty()) {
            chart.series.push_back(std::move(series));
        }
    }
    chart.note = "PHANToM Premium in a firm grip, 1 kHz. Lower is better; figures under 1e-6 are drawn there.";
    const bool more = std::ranges::any_of(chart.series, [](const report::ChartSeries& s) { return s.x.size() > 1; });
    return more ? std::optional(chart) : std::nullopt;
}

std::string numberText(const json& value)
{
    return value.is_number() ? fmt::format("{:.4g}", value.get<double>()) : "no number";
}

std::string summaryTable(const json& figures)
{
    std::string out =
        "<section class=\"card\"><h2>Cells passed, and the worst figure under a hand that holds "
        "on</h2><div class=\"scroll\"><table class=\"plain\"><tr><th>scene</th>";
    const auto methods = namesOf(figures, "method");
    for (const auto& method : methods) {
        out += "<th>" + report::escape(method) + "</th>";
    }
    out += "<th>unit</th></tr>";
    for (const auto& scene : namesOf(figures, "scene")) {
        out += "<tr><td>" + report::escape(scene) + "</td>";
        std::string of;
        for (const auto& method : methods) {
            const Tally t = tallyOf(figures, scene, method);
            of = t.unit.empty() ? of : t.unit;
            const char* const colour = t.passed == t.cells ? "" : " style=\"color:var(--bad)\"";
            out += t.cells == 0 ? std::string("<td>-</td>")
                                : fmt::format("<td{}>{}/{}<br>{}</td>", colour, t.passed, t.cells,
                                              t.worstFinite ? fmt::format("{:.3g}", t.worst) : "no number");
        }
        out += "<td>" + report::escape(of) + "</td></tr>";
    }
    return out + "</table></div></section>";
}

std::string cellTable(const json& figures)
{
    std::string out =
        "<section class=\"card\"><h2>All cells</h2><div class=\"scroll\"><table "
        "class=\"plain\"><tr><th>cell</th><th>measure</th><th>figure</th><th>bound</th>"
        "<th>unit</th><th></th></tr>";
    for (const json& cell : figures.at("cells")) {
        const bool pass = cell.at("pass");
        out += fmt::format("<tr{}><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
                           pass ? "" : " style=\"color:var(--bad)\"", report::escape(cell.at("id").get<std::string>()),
                           report::escape(cell.at("measure").get<std::string>()), numberText(cell.at("figure")),
                           numberText(cell.at("bound")), report::escape(cell.at("unit").get<std::string>()),
                           pass ? "pass" : "FAIL");
    }
    return out + "</table></div></section>";
}

std::string theoryTable(const json& figures)
{
    if (figures.at("theory").empty()) {
        return {};
    }
    std::string out =
        "<section class=\"card\"><h2>Largest stable stiffness: formulas and simulation</h2><div class=\"scroll\"><table "
        "class=\"plain\"><tr><th>condition</th>"
        "<th>predicted</th><th>simulated</th><th>difference [%]</th></tr>";
    for (const json& row : figures.at("theory")) {
        out += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
                           report::escape(row.at("name").get<std::string>()), numberText(row.at("predicted")),
                           numberText(row.at("simulated")), numberText(row.at("error_pct")));
    }
    return out + "</table></div></section>";
}

}  // namespace

json cellEntry(const CellResult& r)
{
    json out{{"id", r.cell.id()},
             {"scene", r.cell.scene},
             {"method", r.cell.method},
             {"device", r.cell.device},
             {"grip", r.cell.grip()},
             {"rate_hz", r.cell.rate},
             {"pass", r.pass()},
             {"figure", nullptr},
             {"measure", name(r.bounded.figure)},
             {"unit", unit(r.bounded.figure)},
             {"bound", r.bounded.bound}};
    if (std::isfinite(r.figure)) {
        out["figure"] = r.figure;
    }
    return out;
}

json fuzzEntry(const FuzzResult& r)
{
    return {{"runs", r.runs},          {"ticks", r.ticks},          {"crashes", r.crashes}, {"over_cap", r.overCap},
            {"over_slew", r.overSlew}, {"non_finite", r.nonFinite}, {"pulled", r.pulled},   {"failed_seeds", r.failed}};
}

void addTheory(json& figures)
{
    figures["theory"] = base::mapped<json>(theoryRows(), [](const TheoryRow& r) -> json {
        return {{"name", r.name}, {"predicted", r.predicted}, {"simulated", r.simulated}, {"error_pct", r.errorPct()}};
    });
    for (const LimitMap& map : limitMaps()) {
        for (const LimitPoint& p : map.points) {
            figures["limits"].push_back({{"map", map.name},
                                         {"label", map.xLabel},
                                         {"x", p.x},
                                         {"predicted_n_m", p.predicted},
                                         {"simulated_n_m", p.simulated}});
        }
    }
}

std::vector<std::string> namesOf(const json& figures, const char* key)
{
    std::vector<std::string> names;
    for (const json& cell : figures.at("cells")) {
        const std::string name = cell.at(key);
        if (std::ranges::find(names, name) == names.end()) {
            names.push_back(name);
        }
    }
    return names;
}

Tally tallyOf(const json& figures, const std::string& scene, const std::string& method)
{
    Tally t;
    bool held = false;
    for (const json& cell : figures.at("cells")) {
        if (cell.at("scene") != scene || cell.at("method") != method) {
            continue;
        }
        ++t.cells;
        t.passed += cell.at("pass").get<bool>() ? 1 : 0;
        const bool grip = cell.at("grip") == "grip";
        if (grip && !held) {
            held = true;
            t.worst = 0.0;
            t.worstFinite = true;
        }
        if (grip == held) {
            t.unit = cell.at("unit");
            t.worstFinite = t.worstFinite && cell.at("figure").is_number();
            t.worst = cell.at("figure").is_number() ? std::max(t.worst, cell.at("figure").get<double>()) : t.worst;
        }
    }
    return t;
}

void printStability(const json& figures)
{
    const auto methods = namesOf(figures, "method");
    if (methods.empty()) {
        return;
    }
    fmt::print("Cells passed of each scene and method, and the worst figure of a hand that holds on\n\n{:<20}", "scene");
    for (const auto& method : methods) {
        fmt::print(" {:>18}", method);
    }
    fmt::print("  unit\n");
    for (const auto& scene : namesOf(figures, "scene")) {
        fmt::print("{:<20}", scene);
        std::string of;
        for (const auto& method : methods) {
            const Tally t = tallyOf(figures, scene, method);
            of = t.unit.empty() ? of : t.unit;
            const std::string text = t.cells == 0
                                         ? "-"
                                         : fmt::format("{}/{} {:>9}", t.passed, t.cells,
                                                       t.worstFinite ? fmt::format("{:.3g}", t.worst) : "no number");
            fmt::print(" {:>18}", text);
        }
        fmt::print("  {}\n", of);
    }
}

std::string stabilityCsv(const json& figures)
{
    std::string out = fmt::format("{}\n", fmt::join(cellColumns, ","));
    for (const json& cell : figures.at("cells")) {
        for (const char* const key : cellColumns) {
            out += (key == cellColumns.front() ? "" : ",") + csvCell(cell.at(key));
        }
        out += '\n';
    }
    return out;
}

std::vector<report::Chart> limitCharts(const json& figures)
{
    std::vector<report::Chart> charts;
    for (const json& point : figures.at("limits")) {
        const std::string label = point.at("label");
        if (charts.empty() || charts.back().xLabel != label) {
            report::Chart chart{"Largest stable stiffness against " + point.at("map").get<std::string>(), label,
                                "stiffness [N/m]", false, true};
            chart.logX = point.at("map") == "rate";
            chart.series = {{"formula, (b + b_hand) / (T / 2 + delay)", {}, {}, true, false},
                            {"simulated", {}, {}, false, true}};
            chart.note = "A device of 75 g with 0.5 N s/m of friction. Below the line a release dies away, above it grows.";
            charts.push_back(std::move(chart));
        }
        for (report::ChartSeries& series : charts.back().series) {
            series.add(point.at("x"), point.at(series.line ? "predicted_n_m" : "simulated_n_m"));
        }
    }
    return charts;
}

void writeStabilityFolder(const std::filesystem::path& folder, const json& figures)
{
    std::filesystem::create_directories(folder);
    command::writeJson(folder / "stability.json", figures);
    base::writeWhole(folder / "stability.csv", stabilityCsv(figures));
    std::vector<report::Chart> charts = limitCharts(figures);
    for (const report::Chart& chart : charts) {
        report::writeChartPng(chart, folder / fmt::format("limit-{}.png", &chart - charts.data() + 1));
    }
    for (const StabilityView& view : views) {
        if (const auto chart = chartOfView(figures, view)) {
            report::writeChartPng(*chart, folder / fmt::format("{}.png", view.file));
            charts.push_back(*chart);
        }
    }
    report::writeChartHtml(charts, "Stability: where methods fail", folder / "stability.html",
                           summaryTable(figures) + theoryTable(figures) + cellTable(figures));
}

}  // namespace palpate::studies
