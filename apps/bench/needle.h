#pragma once

#include <CLI/App.hpp>

namespace palpate::apps {

/// `palpate bench needle`.
void addBenchNeedle(CLI::App& bench);

}  // namespace palpate::apps
