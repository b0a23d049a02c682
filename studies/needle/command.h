#pragma once

#include <CLI/App.hpp>

namespace palpate::studies {

/// `palpate bench needle`.
void addBenchNeedle(CLI::App& bench);

}  // namespace palpate::studies
