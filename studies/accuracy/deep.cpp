#include <studies/accuracy/deep.h>

#include <base/build.h>
#include <base/error.h>
#include <base/outputs.h>
#include <base/vec_json.h>
#include <command/json.h>
#include <command/progress.h>
#include <report/chart/chart.h>
#include <session/open.h>
#include <studies/accuracy/deep_press.h>
#include <studies/accuracy/references.h>
#include <studies/kernel/kernel_trial.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <utility>

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
    report::Chart chart{fmt::format("{}: error of the force, {}", what, panel.title), "depth [radii of the tool]",
                        "error of the force [%]"};
    chart.logX = panel.logX;
    chart.logY = true;
    for (const auto& setting : differentValues(figures.at("summary"), [](const json& e) { return e.at("setting"); })) {
        report::ChartSeries middle, worst;
        middle.name = setting + ", median";
        worst.name = setting + ", worst place";
        middle.line = worst.line = true;
        for (const auto& [radii, errors] : errorsOf(figures, what, setting, panel)) {
            middle.add(radii, median(errors));
            worst.add(radii, std::ranges::max(errors));
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
        "pct,direction_deg\n";
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

constexpr std::array<std::pair<const char*, const char*>, 5> zones{
    {{"faint", "a < h/2"}, {"touch", "a h/2..1.5h"}, {"middle", "to 1 R"}, {"deep", "to 1.5 R"}, {"deepest", "to 2 R"}}};
constexpr std::size_t quickPlaces = 2;

const char* nameOf(DeepZone zone)
{
    return zones.at(static_cast<std::size_t>(zone)).first;
}

json entryOf(const DeepCase& what, const std::string& setting, double spacing, const DeepLook& look)
{
    const GridPlace& place = gridPlaces()[look.place];
    return {{"scene", what.scene},
            {"tool", what.tool.name},
            {"setting", setting},
            {"way", wayName(look.way)},
            {"place_cells", {place.across, place.along}},
            {"depth_mm", 1e3 * look.depth},
            {"depth_radii", look.depth / what.tool.radius},
            {"contact_cells", std::sqrt(what.tool.radius * look.depth) / spacing},
            {"zone", nameOf(zoneOf(look.depth, what.tool.radius, spacing))},
            {"force_n", look.force},
            {"reference_n", look.reference},
            {"reference_edges_mm", 1e3 * look.edges},
            {"error_pct", look.errorPercent()},
            {"direction_deg", look.directionDegrees()}};
}

// Median and worst of these looks. The worst error keeps its sign.
json errorsOf(std::span<const DeepLook* const> looks)
{
    std::vector<double> errors, sizes;
    double worst = 0.0, direction = 0.0;
    for (const DeepLook* look : looks) {
        const double error = look->errorPercent();
        errors.push_back(error);
        sizes.push_back(std::abs(error));
        worst = std::abs(error) > std::abs(worst) ? error : worst;
        direction = std::max(direction, look->directionDegrees());
    }
    return {{"looks", looks.size()},
            {"bias_pct", median(errors)},
            {"median_pct", median(sizes)},
            {"worst_pct", worst},
            {"direction_worst_deg", direction}};
}

void addCase(const DeepCase& what, const std::string& setting, const DeepPress& press, json& figures)
{
    std::map<std::pair<DeepZone, PressWay>, std::vector<const DeepLook*>> groups;
    for (const DeepLook& look : press.looks) {
        figures["depth"].push_back(entryOf(what, setting, press.spacing, look));
        groups[{zoneOf(look.depth, what.tool.radius, press.spacing), look.way}].push_back(&look);
    }
    json ways = json::array();
    for (const auto& [key, looks] : groups) {
        json entry = errorsOf(looks);
        entry["zone"] = nameOf(key.first);
        entry["way"] = wayName(key.second);
        ways.push_back(std::move(entry));
    }
    figures["summary"].push_back({{"scene", what.scene},
                                  {"tool", what.tool.name},
                                  {"setting", setting},
                                  {"spacing_mm", 1e3 * press.spacing},
                                  {"deepest_radii", what.deepest() / what.tool.radius},
                                  {"pull_n", press.pull},
                                  {"us_p50", 1e6 * press.times.p50},
                                  {"us_p99", 1e6 * press.times.p99},
                                  {"ticks", press.ticks},
                                  {"zones", ways}});
}

const json* zoneEntry(const json& summary, const char* zone, const char* way)
{
    const json& zones = summary.at("zones");
    const auto is = [&](const json& z) { return z.at("zone") == zone && z.at("way") == way; };
    const auto found = std::ranges::find_if(zones, is);
    return found == zones.end() ? nullptr : &*found;
}

std::string errorCells(const json* entry)
{
    if (entry == nullptr) {
        return fmt::format("{:>7} {:>7} {:>6}", "-", "-", "-");
    }
    return fmt::format("{:>7.1f} {:>+7.1f} {:>6.2f}", entry->at("median_pct").get<double>(),
                       entry->at("worst_pct").get<double>(), entry->at("direction_worst_deg").get<double>());
}

// Errors after the hold, where the tool is deepest.
const json* heldEntry(const json& summary)
{
    const json& zones = summary.at("zones");
    const auto held = [](const json& z) { return z.at("way") == wayName(PressWay::hold); };
    const auto found = std::ranges::find_if(zones, held);
    return found == zones.end() ? nullptr : &*found;
}

void printCase(const json& s)
{
    std::string what = s.at("scene").get<std::string>() + ", " + s.at("tool").get<std::string>();
    std::string setting = s.at("setting");
    std::string costs = fmt::format(" {:>8.2g} {:>6.0f} {:>6.0f}", s.at("pull_n").get<double>(),
                                    s.at("us_p50").get<double>(), s.at("us_p99").get<double>());
    const auto row = [&](const char* depth, const json* in, const json* out) {
        if (in != nullptr || out != nullptr) {
            fmt::print("{:<29} {:<8} {:<12} {} {}{}\n", what, setting, depth, errorCells(in), errorCells(out), costs);
            what = setting = costs = "";
        }
    };
    for (const auto& [zone, shown] : zones) {
        row(shown, zoneEntry(s, zone, wayName(PressWay::in)), zoneEntry(s, zone, wayName(PressWay::out)));
    }
    row("held", heldEntry(s), nullptr);
}

void printDeep(const json& figures)
{
    fmt::print("{:<29} {:<8} {:<12} {:^22} {:^22} {:>8} {:>13}\n", "", "", "", "way in", "way out", "pull", "us a tick");
    fmt::print("{:<29} {:<8} {:<12} {:>7} {:>7} {:>6} {:>7} {:>7} {:>6} {:>8} {:>6} {:>6}\n", "case", "setting", "depth",
               "median%", "worst%", "deg", "median%", "worst%", "deg", "N", "p50", "p99");
    for (const json& s : figures.at("summary")) {
        printCase(s);
    }
}

std::filesystem::path referenceFile()
{
    const auto folders = referenceFolders("").others;
    for (const auto& folder : folders) {
        if (auto file = folder / "deep.csv"; std::filesystem::exists(file)) {
            return file;
        }
    }
    return folders.back() / "deep.csv";
}

std::vector<DeepCase> chosen(const DeepCommand& c)
{
    std::vector<DeepCase> cases = loadDeepCases(referenceFile());
    std::set<std::string> scenes;
    std::ranges::transform(cases, std::inserter(scenes, scenes.end()), &DeepCase::scene);
    for (const std::string& scene : c.scenes) {
        base::failIf(!scenes.contains(scene), "--scenes {}: has no stored forces; scenes with stored forces are {}", scene,
                     fmt::join(scenes, ", "));
    }
    const std::vector<std::string> wanted = c.scenes.empty() && c.quick ? std::vector<std::string>{"block"} : c.scenes;
    std::erase_if(cases, [&](const DeepCase& one) {
        return !wanted.empty() && std::ranges::find(wanted, one.scene) == wanted.end();
    });
    return cases;
}

json runAll(const DeepCommand& c)
{
    std::vector<std::pair<std::string, datasets::ElasticSettings>> settings;
    for (const std::string& name : c.settings) {
        settings.emplace_back(name, datasets::elasticSetting(name));
    }
    DeepOptions options;
    options.speed = 1e-3 * c.speed;
    options.places = gridPlaces().first(c.quick ? quickPlaces : gridPlaces().size());
    json figures{{"build", std::string(base::build())},
                 {"speed_mm_s", c.speed},
                 {"depth", json::array()},
                 {"summary", json::array()}};
    command::Progress progress;
    for (const DeepCase& what : chosen(c)) {
        progress.show(what.scene + ": volume");
        session::SceneChanges changes;
        changes.model = "spring";  // each setting makes its own body
        const haptics::SessionModel model = session::openSession(what.scene, changes);
        for (auto& [name, setting] : settings) {
            progress.show(fmt::format("{}, {}: {}", what.scene, what.tool.name, name));
            addCase(what, name, pressDeep(model, what, setting, options), figures);
        }
    }
    return figures;
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

void deepCommand(const DeepCommand& c)
{
    const json figures = runAll(c);
    if (c.json != "-") {
        printDeep(figures);
    }
    if (!c.folder.empty()) {
        const auto pictures = writeDeepFolder(c.folder, figures);
        if (c.json != "-") {
            fmt::print("\n{}: depth.html, depth.csv, depth.json, {} pictures\n", c.folder.string(), pictures.size());
        }
    }
    command::writeJson(c.json, figures);
    for (const json& s : figures.at("summary")) {
        base::failIf(s.at("pull_n").get<double>() > 0.0, "{}, {}, {}: the tissue pulls the tool inwards by {:.2g} N",
                     s.at("scene").get<std::string>(), s.at("tool").get<std::string>(), s.at("setting").get<std::string>(),
                     s.at("pull_n").get<double>());
    }
}

}  // namespace palpate::studies
