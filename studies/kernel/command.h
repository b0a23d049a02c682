#pragma once

#include <CLI/App.hpp>

namespace palpate::studies {

/// `palpate bench kernel`.
void addBenchKernel(CLI::App& bench);

}  // namespace palpate::studies
