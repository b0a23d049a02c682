#pragma once

#include <CLI/App.hpp>

namespace palpate::studies {

/// `palpate bench load`.
void addBenchLoad(CLI::App& bench);

}  // namespace palpate::studies
