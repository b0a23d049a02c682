#pragma once

#include <studies/kernel/bench_kernel.h>
#include <studies/kernel/bench_operator.h>

#include <nlohmann/json_fwd.hpp>

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace palpate::studies {

/// Nodes along the windows of these settings and of the default one, each once; with settings, a larger window, too.
std::vector<int> operatorWindows(const std::vector<std::string>& settings);

/// Medians of the looks' errors as NAME_pct and worst values as NAME_worst_pct; NAME is rms, near, max, force, energy or
/// volume.
nlohmann::json errorFigures(std::span<const TrialErrors> looks);

/// How much longer than the windows the fastest single grid takes whose error in `figure` is no larger; 0 when there is
/// none, or the case has no rivals.
double singleGridRatio(const KernelCase& c, double TrialErrors::*figure);

/// What `bench kernel --json` writes. The single figures are those of setting `headline`.
nlohmann::json kernelFigures(const std::vector<KernelCase>& cases, const OperatorBench& operators,
                             const std::string& headline);

/// The single figures, for people.
void printSummary(const nlohmann::json& figures);

/// Writes kernel.json, kernel.png and kernel.html: error against time, one series per setting and rival. Throws
/// std::runtime_error.
void writeKernelFolder(const std::filesystem::path& folder, const nlohmann::json& figures,
                       const std::vector<KernelCase>& cases);

}  // namespace palpate::studies
