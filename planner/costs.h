#pragma once

#include <planner/planner.h>

#include <CLI/CLI.hpp>

#include <filesystem>

namespace palpate::planner {

void addBenchCosts(CLI::App& bench);

/// What `palpate bench costs --json` wrote on some machine. Throws std::runtime_error ("FILE: what is wrong").
PlanCosts loadCosts(const std::filesystem::path& file);

}  // namespace palpate::planner
