#pragma once

#include <studies/validate/experiment.h>

#include <nlohmann/json_fwd.hpp>

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::studies {

/// One line per experiment, what it was about below it, and how many hold.
void printExperiments(const std::vector<Experiment>& experiments);
/// {"experiments": [...]}: keys in docs/validation.md.
nlohmann::json experimentsJson(const std::vector<Experiment>& experiments);
/// A row per experiment.
std::string experimentsCsv(const std::vector<Experiment>& experiments);
/// Table and a picture per experiment in one page, and a PNG of each picture beside it. Throws as report::writeChartHtml().
void writeValidateFolder(const std::filesystem::path& folder, const std::vector<Experiment>& experiments);

}  // namespace palpate::studies
