#pragma once

#include <experiments/planner.h>

#include <CLI/CLI.hpp>

#include <filesystem>

namespace palpate::apps {

void addBenchCosts(CLI::App& bench);

/// What `palpate bench costs --json` wrote on some machine. Throws std::runtime_error ("FILE: what is wrong").
experiments::PlanCosts loadCosts(const std::filesystem::path& file);

}  // namespace palpate::apps
