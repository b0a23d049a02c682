#include <studies/stability/figures.h>

#include <studies/stability/theory.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate::studies {

using nlohmann::json;

namespace {

constexpr std::array cellColumns{"id",   "scene",  "method",  "device", "grip", "rate_hz",
                                 "pass", "figure", "measure", "unit",   "bound"};

std::string csvCell(const json& value)
{
    return value.is_string() ? value.get<std::string>() : value.is_null() ? std::string() : value.dump();
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
    for (const TheoryRow& row : theoryRows()) {
        figures["theory"].push_back({{"name", row.name},
                                     {"predicted", row.predicted},
                                     {"simulated", row.simulated},
                                     {"error_pct", row.errorPct()}});
    }
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

}  // namespace palpate::studies
