#include <studies/accuracy/deep.h>

#include <base/outputs.h>
#include <command/json.h>
#include <report/chart/chart.h>
#include <studies/kernel/kernel_trial.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace palpate::studies {

using nlohmann::json;

namespace {

// A part of the way, in a chart of its own.
struct Panel {
    const char *name, *title, *way;
    bool logX;
    double least, most;  // of the depth over the radius
};
constexpr std::array<Panel, 3> panels{{{"touch", "first touch", "in", true, 0.0, 0.2},
                                       {"press", "pressed", "in", false, 0.0, 2.1},
                                       {"retreat", "drawn back", "out", false, 0.0, 2.1}}};

std::string nameOfCase(const json& entry)
{
    return entry.at("scene").get<std::string>() + ", " + entry.at("tool").get<std::string>();
}

std::vector<std::string> differentValues(const json& entries, const auto& value)
{
    std::vector<std::string> out;
    for (const json& e : entries) {
        if (const std::string v = value(e); std::ranges::find(out, v) == out.end()) {
            out.push_back(v);
        }
    }
    return out;
}

// Errors at each depth, over the places in the grid.
std::map<double, std::vector<double>> errorsOf(const json& figures, const std::string& what, const std::string& setting,
                                               const Panel& panel)
{
    std::map<double, std::vector<double>> out;
    for (const json& e : figures.at("depth")) {
        const double radii = e.at("depth_radii");
        if (nameOfCase(e) == what && e.at("setting") == setting && e.at("way") == panel.way && radii >= panel.least &&
            radii <= panel.most) {
            out[radii].push_back(std::abs(e.at("error_pct").get<double>()));
        }
    }
    return out;
}

report::Chart chartOf(const json& figures, const std::string& what, const Panel& panel)
{
    report::Chart chart;
    chart.title = fmt::format("{}: error of the force, {}", what, panel.title);
    chart.xLabel = "depth [radii of the tool]";
    chart.yLabel = "error of the force [%]";
    chart.logX = panel.logX;
    chart.logY = true;
    for (const auto& setting : differentValues(figures.at("summary"), [](const json& e) { return e.at("setting"); })) {
        report::ChartSeries middle, worst;
        middle.name = setting + ", median";
        worst.name = setting + ", worst place";
        middle.line = worst.line = true;
        for (const auto& [radii, errors] : errorsOf(figures, what, setting, panel)) {
            middle.x.push_back(radii);
            middle.y.push_back(median(errors));
            worst.x.push_back(radii);
            worst.y.push_back(std::ranges::max(errors));
        }
        if (!middle.x.empty()) {
            chart.series.push_back(std::move(middle));
            chart.series.push_back(std::move(worst));
        }
    }
    chart.note = fmt::format(
        "Level elastic at {:g} mm/s, 1000 updates a second, against finite elements. Median and worst over places of the "
        "contact in the grid of cells.",
        figures.at("speed_mm_s").get<double>());
    return chart;
}

std::string csvOf(const json& figures)
{
    std::string out =
        "scene,tool,setting,way,place_x,place_z,depth_mm,fx_n,fy_n,fz_n,reference_x_n,reference_y_n,reference_z_n,error_"
        "pct,"
        "direction_deg\n";
    for (const json& e : figures.at("depth")) {
        out += fmt::format("{},{},{},{}", e.at("scene").get<std::string>(), e.at("tool").get<std::string>(),
                           e.at("setting").get<std::string>(), e.at("way").get<std::string>());
        for (const json& number : {e.at("place_cells")[0], e.at("place_cells")[1], e.at("depth_mm"), e.at("force_n")[0],
                                   e.at("force_n")[1], e.at("force_n")[2], e.at("reference_n")[0], e.at("reference_n")[1],
                                   e.at("reference_n")[2], e.at("error_pct"), e.at("direction_deg")}) {
            out += fmt::format(",{:.6g}", number.get<double>());
        }
        out += "\n";
    }
    return out;
}

std::string fileName(std::string what)
{
    std::erase(what, ',');
    std::ranges::replace(what, ' ', '-');
    return what;
}

}  // namespace

std::vector<std::filesystem::path> writeDeepFolder(const std::filesystem::path& folder, const json& figures)
{
    std::filesystem::create_directories(folder);
    command::writeJson(folder / "depth.json", figures);
    base::writeWhole(folder / "depth.csv", csvOf(figures));
    std::vector<report::Chart> charts;
    std::vector<std::filesystem::path> pictures;
    for (const std::string& what : differentValues(figures.at("summary"), nameOfCase)) {
        for (const Panel& panel : panels) {
            report::Chart chart = chartOf(figures, what, panel);
            if (chart.series.empty()) {
                continue;
            }
            pictures.push_back(folder / fmt::format("depth-{}-{}.png", fileName(what), panel.name));
            report::writeChartPng(chart, pictures.back());
            charts.push_back(std::move(chart));
        }
    }
    if (!charts.empty()) {
        report::writeChartHtml(charts, "First touch, deep presses and the way out", folder / "depth.html");
    }
    return pictures;
}

}  // namespace palpate::studies
