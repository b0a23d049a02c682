#pragma once

#include <CLI/App.hpp>

namespace palpate::studies {

/// `palpate bench ipc` and `palpate bench sync`: the thesis's experiments 1 and 2.
void addBenchIpc(CLI::App& bench);
void addBenchSync(CLI::App& bench);

}  // namespace palpate::studies
