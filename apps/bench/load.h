#pragma once

#include <CLI/App.hpp>

namespace palpate::apps {

/// `palpate bench load`.
void addBenchLoad(CLI::App& bench);

}  // namespace palpate::apps
