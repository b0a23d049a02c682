#pragma once

#include <CLI/App.hpp>

namespace palpate::apps {

/// Adds `palpate sweep`.
void addSweep(CLI::App& app);

}  // namespace palpate::apps
