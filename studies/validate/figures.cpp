#include <studies/validate/figures.h>

#include <base/outputs.h>
#include <base/split.h>
#include <command/json.h>
#include <report/chart/chart.h>
#include <report/html.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <array>
#include <cmath>

namespace palpate::studies {

using nlohmann::json;

namespace {

const char* wordOf(Verdict verdict)
{
    constexpr std::array words{"holds", "FAILS", "not run"};
    return words[static_cast<std::size_t>(verdict)];
}

json number(double value)
{
    return std::isfinite(value) ? json(value) : json();
}

std::string percent(const Experiment& e, double value)
{
    return e.verdict == Verdict::notRun ? "" : fmt::format("{:.2f}", value);
}

std::string tableHtml(const std::vector<Experiment>& experiments)
{
    std::string out =
        "<section class=\"card\"><h2>All experiments</h2><div class=\"scroll\"><table "
        "class=\"plain\"><tr><th>experiment</th>"
        "<th>what is compared</th><th>measured</th><th>fitted on</th><th>predicted</th><th>error %</th><th>worst %</th>"
        "<th>scatter %</th><th>bound %</th><th>verdict</th><th></th></tr>\n";
    for (const Experiment& e : experiments) {
        out += "<tr>";
        for (const std::string& cell :
             {e.name, e.quantity, e.source, e.fittedOn, e.predicted, percent(e, e.error), percent(e, e.worst),
              percent(e, e.scatter), percent(e, e.bound), std::string(wordOf(e.verdict)), e.note}) {
            out += "<td>" + report::escape(cell) + "</td>";
        }
        out += "</tr>\n";
    }
    return out + "</table></div></section>\n";
}

report::Chart chartOf(const Experiment& e)
{
    report::Chart chart{e.picture.title, e.picture.xLabel, e.picture.yLabel};
    for (const ValidateCurve& c : e.picture.curves) {
        report::ChartSeries s{c.name};
        s.x = c.x;
        s.y = c.y;
        s.line = c.line;
        s.markers = !c.line;
        chart.series.push_back(std::move(s));
    }
    chart.note = fmt::format("{}: {:.2f} % of at most {:g} %: {}. {}", e.name, e.error, e.bound, wordOf(e.verdict), e.note);
    return chart;
}

}  // namespace

void printExperiments(const std::vector<Experiment>& experiments)
{
    fmt::print("{:<34} {:>8} {:>8} {:>8} {:>8}  {}\n", "", "error %", "worst %", "scatter", "bound %", "");
    std::size_t held = 0, run = 0;
    for (const Experiment& e : experiments) {
        fmt::print("{:<34} {:>8} {:>8} {:>8} {:>8}  {}\n    {}\n    {}\n", e.name, percent(e, e.error), percent(e, e.worst),
                   percent(e, e.scatter), percent(e, e.bound), wordOf(e.verdict), e.quantity, e.note);
        held += e.verdict == Verdict::holds ? 1 : 0;
        run += e.verdict != Verdict::notRun ? 1 : 0;
    }
    fmt::print("{} of {} experiments hold; {} not run\n", held, run, experiments.size() - run);
}

json experimentsJson(const std::vector<Experiment>& experiments)
{
    json all = json::array();
    for (const Experiment& e : experiments) {
        const bool run = e.verdict != Verdict::notRun;
        json parameters = json::object();
        for (const auto& [name, value] : e.parameters) {
            parameters[name] = number(value);
        }
        all.push_back({{"name", e.name},
                       {"quantity", e.quantity},
                       {"source", e.source},
                       {"fitted_on", e.fittedOn},
                       {"predicted", e.predicted},
                       {"error_pct", run ? number(e.error) : json()},
                       {"worst_pct", run ? number(e.worst) : json()},
                       {"scatter_pct", run ? number(e.scatter) : json()},
                       {"bound_pct", run ? number(e.bound) : json()},
                       {"pass", run ? json(e.verdict == Verdict::holds) : json()},
                       {"note", e.note},
                       {"parameters", parameters}});
    }
    return {{"experiments", all}};
}

std::string experimentsCsv(const std::vector<Experiment>& experiments)
{
    std::string out = "name,verdict,error_pct,worst_pct,scatter_pct,bound_pct,quantity,source,fitted_on,predicted,note\n";
    for (const Experiment& e : experiments) {
        out +=
            fmt::format("{},{},{},{},{},{},{},{},{},{},{}\n", e.name,
                        e.verdict == Verdict::fails ? "fails" : wordOf(e.verdict), percent(e, e.error), percent(e, e.worst),
                        percent(e, e.scatter), percent(e, e.bound), base::csvQuoted(e.quantity), base::csvQuoted(e.source),
                        base::csvQuoted(e.fittedOn), base::csvQuoted(e.predicted), base::csvQuoted(e.note));
    }
    return out;
}

void writeValidateFolder(const std::filesystem::path& folder, const std::vector<Experiment>& experiments)
{
    std::filesystem::create_directories(folder);
    std::vector<report::Chart> charts;
    for (const Experiment& e : experiments) {
        if (!e.picture.empty()) {
            charts.push_back(chartOf(e));
            report::writeChartPng(charts.back(), folder / (e.name + ".png"));
        }
    }
    report::writeChartHtml(charts, "Validation", folder / "validation.html", tableHtml(experiments));
    base::writeWhole(folder / "validation.csv", experimentsCsv(experiments));
    command::writeJson(folder / "validation.json", experimentsJson(experiments));
}

}  // namespace palpate::studies
