#include <studies/thesis/figures.h>

#include <base/mapped.h>
#include <command/json.h>
#include <report/chart/chart.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <thread>

namespace palpate::studies {

using nlohmann::json;

namespace {

constexpr double us = 1e6;
constexpr std::size_t table2Most = thesisObjects.back();

using EventsOf = std::vector<EventTimes> TasksCase::*;

// Times of one event against the number of objects.
struct Series {
    std::vector<double> objects, seconds;
};

Series seriesOf(const std::vector<TasksCase>& cases, EventsOf of, std::string_view event, std::size_t most)
{
    Series s;
    for (const auto& c : cases) {
        const auto found = std::ranges::find(c.*of, event, &EventTimes::event);
        if (found != (c.*of).end() && c.objects <= most) {
            s.objects.push_back(static_cast<double>(c.objects));
            s.seconds.push_back(found->process);
        }
    }
    return s;
}

json lineEntry(const TaskLine& line)
{
    return {{"slope_us_per_object", us * line.slope}, {"intercept_us", us * line.intercept}};
}

json fitEntry(std::string_view event, const LineFit& fit)
{
    return {{"event", event},
            {"points", fit.points},
            {"slope_us_per_object", us * fit.slope},
            {"slope_error", us * fit.slopeError},
            {"intercept_us", us * fit.intercept},
            {"intercept_error", us * fit.interceptError},
            {"r_squared", fit.rSquared}};
}

// Lines of every event that has three points or more up to `most` objects.
json fitsOf(const std::vector<TasksCase>& cases, EventsOf of, std::size_t most)
{
    json fits = json::array();
    for (const auto& event : taskEvents) {
        const Series s = seriesOf(cases, of, event.name, most);
        if (s.objects.size() < 3) {
            continue;
        }
        const LineFit fit = fitLine(s.objects, s.seconds);
        auto entry = fitEntry(event.name, fit);
        entry["most_objects"] = s.objects.back();
        entry["zero_within_error"] = fit.flat();
        fits.push_back(std::move(entry));
    }
    return fits;
}

json eventsOf(const std::vector<TasksCase>& cases, EventsOf of)
{
    json events = json::array();
    for (const auto& c : cases) {
        for (const auto& e : c.*of) {
            json tasks;
            for (std::size_t i = 0; i < haptics::taskCount; ++i) {
                tasks[std::string(haptics::taskNames[i])] = us * e.tasks[i];
            }
            events.push_back({{"event", e.event},
                              {"objects", c.objects},
                              {"process_us", us * e.process},
                              {"tick_us_p50", us * e.p50},
                              {"tick_us_p99", us * e.p99},
                              {"publish_us", us * e.publish},
                              {"tasks_us", tasks}});
        }
    }
    return events;
}

json casesOf(const std::vector<TasksCase>& cases)
{
    json out = json::array();
    for (const auto& c : cases) {
        json entry{{"objects", c.objects}, {"voxels", c.voxels}, {"h1_build_s", c.build}};
        if (c.viewer) {
            entry["g1_first_picture_s"] = c.viewer->setUp;
            entry["g2_read_ms"] = 1e3 * c.viewer->read;
            entry["g3_picture_ms"] = 1e3 * c.viewer->picture;
            entry["pictures"] = c.viewer->pictures;
        }
        out.push_back(std::move(entry));
    }
    return out;
}

json modelEntry(const TaskModel& m)
{
    return {{"graphics", lineEntry(m.graphics)},     {"position", lineEntry(m.position)},
            {"collision", lineEntry(m.collision)},   {"feedback", lineEntry(m.feedback)},
            {"monitoring", lineEntry(m.monitoring)}, {"additional", lineEntry(m.additional)},
            {"servo", lineEntry(m.servo())},         {"total", lineEntry(m.total())}};
}

// Equation 29 from lines; nothing where an event is missing.
json modelOf(const json& fits)
{
    const auto names = base::mapped<std::string>(fits, [](const json& f) { return f["event"]; });
    std::vector<EventLine> lines;
    for (std::size_t i = 0; i < names.size(); ++i) {
        lines.push_back(
            {names[i], {fits[i]["slope_us_per_object"].get<double>() / us, fits[i]["intercept_us"].get<double>() / us}});
    }
    const auto has = [&](const char* event) { return std::ranges::find(names, event) != names.end(); };
    const bool all = has("A1") && has("A2") && has("A4") && has("A6") && has("A7") && has("A9");
    return all ? modelEntry(taskModel(lines)) : json();
}

json thesisEntry()
{
    json fits = json::array(), again = json::array(), events = json::array();
    for (const auto& s : thesisSeries()) {
        auto printed = fitEntry(s.event, s.line);
        printed.erase("r_squared");
        fits.push_back(std::move(printed));
        again.push_back(fitEntry(s.event, fitLine(s.objects, s.seconds)));
        for (std::size_t i = 0; i < s.objects.size(); ++i) {
            events.push_back({{"event", s.event}, {"objects", s.objects[i]}, {"process_us", us * s.seconds[i]}});
        }
    }
    return {{"events", events}, {"fits", fits}, {"fits_of_table_2", again}, {"timing_model", modelEntry(thesisModel())}};
}

const json* fitOf(const json& fits, std::string_view event)
{
    const auto found = std::ranges::find_if(fits, [&](const json& f) { return f["event"] == event; });
    return found == fits.end() ? nullptr : &*found;
}

// Where the loop takes as long as ours, from lines of event A8; nothing where it never does.
json crossing(const json& ours, const json& loop)
{
    const json *a = fitOf(ours, "A8"), *b = fitOf(loop, "A8");
    if (a == nullptr || b == nullptr) {
        return {};
    }
    const double slower = (*b)["slope_us_per_object"].get<double>() - (*a)["slope_us_per_object"].get<double>();
    const double ahead = (*a)["intercept_us"].get<double>() - (*b)["intercept_us"].get<double>();
    return slower > 0.0 ? json(std::max(0.0, ahead / slower)) : json();
}

// Rows: numbers of objects; columns: events.
void printTable(const json& events, const char* title)
{
    std::vector<std::string> names;
    for (const auto& event : taskEvents) {
        const auto is = [&](const json& e) { return e["event"] == event.name; };
        if (std::ranges::any_of(events, is)) {
            names.emplace_back(event.name);
        }
    }
    fmt::print("\n{}\n{:>9}", title, "objects");
    for (const auto& name : names) {
        fmt::print(" {:>7}", name);
    }
    std::map<double, std::map<std::string, double>> rows;
    for (const auto& e : events) {
        rows[e["objects"]][e["event"]] = e["process_us"];
    }
    for (const auto& [objects, row] : rows) {
        fmt::print("\n{:>9.0f}", objects);
        for (const auto& name : names) {
            const auto at = row.find(name);
            fmt::print(" {:>7}", at == row.end() ? "-" : fmt::format("{:.1f}", at->second));
        }
    }
    fmt::print("\n");
}

void printFits(const char* title, const json& fits)
{
    for (const auto& f : fits) {
        const auto flat = f.find("zero_within_error");
        fmt::print("{:<28} {:<4} {:>11.3e} +- {:>8.1e} {:>9.2f} +- {:>6.2f} {:>7} {}\n", title,
                   f["event"].get<std::string>(), f["slope_us_per_object"].get<double>(), f["slope_error"].get<double>(),
                   f["intercept_us"].get<double>(), f["intercept_error"].get<double>(),
                   f.contains("r_squared") ? fmt::format("{:.4f}", f["r_squared"].get<double>()) : "",
                   flat == f.end()     ? ""
                   : flat->get<bool>() ? "zero within its error"
                                       : "not zero");
        title = "";
    }
}

void printModel(const json& ours, const json& thesis)
{
    struct Row {
        const char *key, *name;
    };
    constexpr Row rows[]{{"position", "Y_P   H2"},       {"collision", "Y_CD  H3"},     {"feedback", "Y_F   H4, H5"},
                         {"graphics", "Y_G   H8, H9"},   {"monitoring", "Y_MT  H6"},    {"additional", "Y_AF  H7"},
                         {"servo", "Y_SV  equation 18"}, {"total", "Y_T   equation 29"}};
    fmt::print("\ntask-timing model [us], x objects\n{:<20} {:>30} {:>26}\n", "", "ours", "thesis");
    for (const Row& row : rows) {
        const auto line = [&](const json& model) {
            return model.is_null() ? std::string("-")
                                   : fmt::format("{:9.3f} + {:.4g} x", model[row.key]["intercept_us"].get<double>(),
                                                 model[row.key]["slope_us_per_object"].get<double>());
        };
        fmt::print("{:<20} {:>30} {:>26}\n", row.name, line(ours), line(thesis));
    }
}

void printCases(const json& cases)
{
    fmt::print("\n{:>9} {:>11} {:>9} {:>15} {:>13} {:>13}\n{:>9} {:>11} {:>9} {:>15} {:>13} {:>13}\n", "objects", "voxels",
               "H1 [s]", "G1 [s]", "G2 [ms]", "G3 [ms]", "", "", "build", "first picture", "read", "picture");
    for (const auto& c : cases) {
        const auto value = [&](const char* key) {
            return c.contains(key) ? fmt::format("{:.2f}", c[key].get<double>()) : std::string("-");
        };
        fmt::print("{:>9} {:>11} {:>9} {:>15} {:>13} {:>13}\n", c["objects"].get<std::size_t>(),
                   c["voxels"].get<std::size_t>(), value("h1_build_s"), value("g1_first_picture_s"), value("g2_read_ms"),
                   value("g3_picture_ms"));
    }
}

report::ChartSeries timesOf(const json& events, const char* event, std::string name)
{
    report::ChartSeries s{std::move(name), {}, {}, true};
    for (const auto& e : events) {
        if (e["event"] == event) {
            s.add(e["objects"], e["process_us"]);
        }
    }
    return s;
}

// The thesis's line where it did not measure.
report::ChartSeries thesisBeyond(const json& figures, double most)
{
    const json& fit = *fitOf(figures["thesis"]["fits"], "A1");
    report::ChartSeries s{"thesis, line of A1 carried on", {}, {}, true, false};
    const auto& slope = fit["slope_us_per_object"];
    constexpr int points = 20;
    for (int i = 0; i <= points; ++i) {
        const auto from = static_cast<double>(table2Most);
        const double objects = from * std::pow(most / from, static_cast<double>(i) / points);
        s.add(objects, fit["intercept_us"].get<double>() + slope.get<double>() * objects);
    }
    return s;
}

report::Chart chartOf(const json& f)
{
    report::Chart chart{"Process time of the haptic loop against the number of objects", "objects",
                        "process time of a tick [us]", true, true};
    const auto& thesis = f["thesis"]["events"];
    chart.series.push_back(timesOf(thesis, "A1", "thesis A1: graphics, touching"));
    chart.series.push_back(timesOf(thesis, "A4", "thesis A4: not touching"));
    const double most = f["cases"].back()["objects"];
    if (most > static_cast<double>(table2Most)) {
        chart.series.push_back(thesisBeyond(f, most));
    }
    chart.series.push_back(timesOf(f["loop"]["events"], "A8", "loop over objects A8, this machine"));
    for (const auto& [event, what] :
         {std::pair("A1", "graphics, touching"), {"A4", "not touching"}, {"A8", "touching, additional force"}}) {
        auto s = timesOf(f["events"], event, fmt::format("Palpate {}: {}", event, what));
        if (!s.x.empty()) {
            chart.series.push_back(std::move(s));
        }
    }
    chart.bounds = {{"a tick", 1000.0}, {"haptic part, chapter VI", us * thesisHapticLimit}};
    chart.note = fmt::format("Palpate: inclusions in one block of tissue, level {}. Thesis: 300 MHz Pentium, GHOST.",
                             f["model"].get<std::string>());
    return chart;
}

// Where a tick's time goes: tasks of event A8.
report::Chart tasksChartOf(const json& f)
{
    report::Chart chart{"Time of single tasks against the number of objects (event A8)", "objects",
                        "time in a tick, median [us]", true, true};
    for (const auto task : haptics::taskNames) {
        report::ChartSeries s{std::string(task), {}, {}, true};
        for (const auto& e : f["events"]) {
            if (e["event"] == "A8") {
                s.add(e["objects"], e["tasks_us"][std::string(task)]);
            }
        }
        chart.series.push_back(std::move(s));
    }
    return chart;
}

}  // namespace

json tasksFigures(const TasksResult& r)
{
    constexpr auto all = static_cast<std::size_t>(-1);
    const json fits = fitsOf(r.cases, &TasksCase::events, all), loop = fitsOf(r.cases, &TasksCase::loop, all);
    return {{"model", r.level},
            {"graphics", r.graphics},
            {"cores", std::thread::hardware_concurrency()},
            {"events", eventsOf(r.cases, &TasksCase::events)},
            {"fits", fits},
            {"fits_to_600", fitsOf(r.cases, &TasksCase::events, table2Most)},
            {"timing_model", modelOf(fits)},
            {"cases", casesOf(r.cases)},
            {"loop",
             {{"events", eventsOf(r.cases, &TasksCase::loop)},
              {"fits", loop},
              {"fits_to_600", fitsOf(r.cases, &TasksCase::loop, table2Most)},
              {"as_slow_as_ours_at_objects", crossing(fits, loop)}}},
            {"thesis", thesisEntry()}};
}

void printTasks(const json& f)
{
    fmt::print("level {}; graphics: {}; {} cores\n", f["model"].get<std::string>(), f["graphics"].get<std::string>(),
               f["cores"].get<int>());
    printTable(f["events"], "process time of a tick by event [us]");
    printTable(f["loop"]["events"], "the same with a loop over objects, as the thesis had it [us]");
    printTable(f["thesis"]["events"], "the thesis, Table 2 [us]");
    fmt::print("\nleast squares, as Table 4 [us]\n{:<28} {:<4} {:>23} {:>19} {:>7}\n", "", "", "slope per object",
               "intercept", "R^2");
    printFits("ours", f["fits"]);
    printFits("ours, up to 600 objects", f["fits_to_600"]);
    printFits("loop over objects", f["loop"]["fits"]);
    printFits("thesis, Table 4", f["thesis"]["fits"]);
    printFits("thesis, Table 2 fitted again", f["thesis"]["fits_of_table_2"]);
    printModel(f["timing_model"], f["thesis"]["timing_model"]);
    printCases(f["cases"]);
    if (const auto& at = f["loop"]["as_slow_as_ours_at_objects"]; !at.is_null()) {
        fmt::print("\na loop over objects is as slow as level {} at {:.3g} objects (lines of A8)\n",
                   f["model"].get<std::string>(), at.get<double>());
    }
}

void writeTasksChart(const json& figures, const std::filesystem::path& png)
{
    report::writeChartPng(chartOf(figures), png);
}

void writeTasksFolder(const std::filesystem::path& folder, const json& figures)
{
    std::filesystem::create_directories(folder);
    const std::vector<report::Chart> charts{chartOf(figures), tasksChartOf(figures)};
    report::writeChartPng(charts[0], folder / "tasks.png");
    report::writeChartHtml(charts, "Tasks", folder / "tasks.html");
    command::writeJson(folder / "tasks.json", figures);
}

}  // namespace palpate::studies
