#pragma once

#include <CLI/App.hpp>

namespace palpate::apps {

/// `palpate bench kernel`.
void addBenchKernel(CLI::App& bench);

}  // namespace palpate::apps
