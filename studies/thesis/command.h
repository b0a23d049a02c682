#pragma once

#include <CLI/App.hpp>

namespace palpate::studies {

/// `palpate bench tasks`: the thesis's measurement of its tasks, with as many objects as it had and on to a million.
void addBenchTasks(CLI::App& bench);

}  // namespace palpate::studies
