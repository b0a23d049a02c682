#include <studies/accuracy/figures.h>

#include <base/outputs.h>
#include <command/json.h>
#include <datasets/scene.h>
#include <report/chart/chart.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

namespace palpate::studies {

using nlohmann::json;

namespace {

constexpr std::array<std::pair<const char*, const char*>, 11> shownNames{
    {{"elastic", "Palpate, small strain"},
     {"elastic_finite", "Palpate, finite strain"},
     {"single_grid", "one grid, small strain"},
     {"single_grid_finite", "one grid, finite strain"},
     {"chainmail", "ChainMail, by violation"},
     {"chainmail_fifo", "ChainMail, first in first out"},
     {"tets_prefactored", "tetrahedra, factored before"},
     {"tets_conforming", "conforming tetrahedra (TetGen), factored before"},
     {"xpbd", "XPBD, neo-Hookean"},
     {"bullet", "Bullet, neo-Hookean"},
     {"calculix", "CalculiX, neo-Hookean"}}};

// What a chart shows: one scene against one law, all looks or a part of them.
struct View {
    std::string scene, law;
    std::string part;   // "", "press" or "drag"
    const char* title;  // ", pressed"
};

// The block's press and drag stand beside each other: what only follows a steady push shows there.
std::vector<View> viewsOf(const json& figures)
{
    std::vector<View> views;
    for (const json& e : figures.at("chart")) {
        const std::string scene = e.at("scene"), law = e.at("law");
        if (std::ranges::any_of(views, [&](const View& v) { return v.scene == scene && v.law == law; })) {
            continue;
        }
        if (scene == "block") {
            views.push_back({scene, law, "press", " pressed"});
            views.push_back({scene, law, "drag", " pressed, then dragged sideways"});
        } else {
            views.push_back({scene, law, "", " pressed and dragged"});
        }
    }
    return views;
}

const json& partOf(const json& entry, const View& view)
{
    return view.part.empty() ? entry : entry.at(view.part);
}

bool shown(const json& entry, const View& view)
{
    return entry.at("scene") == view.scene && entry.at("law") == view.law && entry.contains("near_pct");
}

void addPoint(report::Chart& chart, const json& entry, const View& view)
{
    const std::string method = entry.at("method");
    const auto* const shown = std::ranges::find_if(shownNames, [&](const auto& name) { return method == name.first; });
    const std::string name = shown != shownNames.end() ? shown->second : method;
    auto series = std::ranges::find(chart.series, name, &report::ChartSeries::name);
    if (series == chart.series.end()) {
        series = chart.series.insert(chart.series.end(), report::ChartSeries{});
        series->name = name;
    }
    series->add(entry.at("us_per_update"), partOf(entry, view).at("near_pct"));
    series->label.push_back(entry.at("setting"));
    if (method == "elastic" || method == "elastic_finite") {
        const std::string& setting = series->label.back();
        const auto names = datasets::elasticSettings();
        const bool named = std::ranges::find(names, setting) != names.end();
        series->written.push_back(named || entry.value("on_front", false) ? setting : "");
    }
}

// The least error that any method has within a time: a staircase.
report::ChartSeries frontOf(const report::Chart& chart)
{
    std::vector<AccuracyPoint> points;
    double longest = 0.0;
    for (const report::ChartSeries& s : chart.series) {
        for (std::size_t i = 0; i < s.x.size(); ++i) {
            points.push_back({s.x[i], s.y[i]});
            longest = std::max(longest, s.x[i]);
        }
    }
    report::ChartSeries front{"best within the time (Pareto front)", {}, {}, true, false};
    for (const std::size_t i : paretoFront(points)) {
        if (!front.y.empty()) {
            front.add(points[i].seconds, front.y.back());
        }
        front.add(points[i].seconds, points[i].error);
    }
    front.add(longest, front.y.empty() ? 0.0 : front.y.back());
    return front;
}

// Where an update takes as long as there is time for it: as high as the points.
report::ChartSeries deadlineOf(const report::Chart& chart)
{
    constexpr double deadline = 1000.0;  // [us]
    double low = std::numeric_limits<double>::infinity(), high = 0.0;
    const auto include = [&](double y) {
        low = std::min(low, y);
        high = std::max(high, y);
    };
    for (const report::ChartSeries& s : chart.series) {
        std::ranges::for_each(s.y, include);
    }
    for (const report::ChartLine& b : chart.bounds) {
        include(b.y);
    }
    report::ChartSeries line{"1 kHz: 1000 us per update"};
    line.x = {deadline, deadline};
    line.y = {low, high};
    line.line = true;
    line.markers = false;
    return line;
}

report::Chart chartOf(const json& figures, const View& view)
{
    report::Chart chart{fmt::format("{}{}: error against time, {} reference", view.scene, view.title,
                                    view.law == "neo-hookean" ? "neo-Hookean" : view.law),
                        "processor time per update [us]",
                        "error within 30 mm of the contact [% of the largest displacement]", true, true};
    for (const json& e : figures.at("chart")) {
        if (!shown(e, view)) {
            continue;
        }
        if (e.at("method") == "nothing") {
            const double error = partOf(e, view).at("near_pct");
            chart.bounds.push_back({fmt::format("tissue that does not move: {:.1f} %", error), error});
        } else if (e.at("method") != "spring") {
            addPoint(chart, e, view);
        }
    }
    chart.series.push_back(frontOf(chart));
    chart.series.push_back(deadlineOf(chart));
    for (const json& f : figures.at("floors")) {
        if (f.at("scene") == view.scene && f.at("law") == view.law) {
            const double error = partOf(f, view).at("near_pct");
            chart.bounds.push_back({fmt::format("linear law, solved exactly: {:.1f} %", error), error});
        }
    }
    chart.note =
        "Left and down is better. One marker per method and setting: a sphere of 10 mm radius at 20 mm/s, 1000 updates a "
        "second, one core; median over the looks, against finite elements on a mesh that conforms to the tissues. The "
        "staircase is the least error that any method has within a time.";
    return chart;
}

}  // namespace

std::vector<std::filesystem::path> writeAccuracyFolder(const std::filesystem::path& folder, const json& figures)
{
    std::filesystem::create_directories(folder);
    command::writeJson(folder / "accuracy.json", figures);
    base::writeWhole(folder / "accuracy.csv", accuracyCsv(figures));
    std::vector<report::Chart> charts;
    std::vector<std::filesystem::path> pictures;
    for (const View& view : viewsOf(figures)) {
        report::Chart chart = chartOf(figures, view);
        if (std::ranges::all_of(chart.series, [](const report::ChartSeries& s) { return !s.markers; })) {
            continue;
        }
        pictures.push_back(folder /
                           fmt::format("{}{}{}-{}.png", view.scene, view.part.empty() ? "" : "-", view.part, view.law));
        report::writeChartPng(chart, pictures.back());
        charts.push_back(std::move(chart));
    }
    if (!charts.empty()) {
        report::writeChartHtml(charts, "Error against time per update", folder / "accuracy.html");
    }
    return pictures;
}

}  // namespace palpate::studies
