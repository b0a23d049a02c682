#pragma once

#include <report/chart/chart.h>
#include <studies/stability/fuzz.h>
#include <studies/stability/matrix.h>

#include <nlohmann/json.hpp>

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::studies {

/// One entry of cells[]: id, scene, method, device, grip, rate_hz, pass, figure, unit, bound, measure. A figure that is no
/// number is null.
nlohmann::json cellEntry(const CellResult& result);
nlohmann::json fuzzEntry(const FuzzResult& result);
/// theory[]{name, predicted, simulated, error_pct} and limits[]{map, label, x, predicted_n_m, simulated_n_m}.
void addTheory(nlohmann::json& figures);
/// The limits as charts.
std::vector<report::Chart> limitCharts(const nlohmann::json& figures);

/// Prints, for every scene and method, how many cells pass, and the worst figure.
void printStability(const nlohmann::json& figures);
/// One line per cell.
std::string stabilityCsv(const nlohmann::json& figures);
/// Writes stability.html, .json and .csv, and charts as PNG. Throws std::runtime_error.
void writeStabilityFolder(const std::filesystem::path& folder, const nlohmann::json& figures);

/// Scenes or methods of the cells, in the order in which they come.
std::vector<std::string> namesOf(const nlohmann::json& figures, const char* key);
/// How a method did in a scene.
struct Tally {
    std::size_t cells = 0, passed = 0;
    double worst = 0;  // figure, of a hand that holds on (of one that lets go where there is no other)
    bool worstFinite = true;
    std::string unit;
};
Tally tallyOf(const nlohmann::json& figures, const std::string& scene, const std::string& method);

}  // namespace palpate::studies
