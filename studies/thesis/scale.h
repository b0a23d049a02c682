#pragma once

#include <CLI/App.hpp>

namespace palpate::studies {

/// `palpate bench scale`: the largest scene that holds 1 kHz.
void addBenchScale(CLI::App& bench);

}  // namespace palpate::studies
